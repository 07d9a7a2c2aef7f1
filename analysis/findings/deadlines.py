"""What a run in real time shows of its deadlines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticlink.orchestrator.results.numbers import short


def finding(found: Mapping[str, Any]) -> str:
    """What a run in real time shows, in a sentence."""
    missed = f"{found['deadlines_missed'] or 'none'} of {found['ticks']} deadlines missed"
    largest = (1e3 * found[name]["max"] for name in ("step_time", "lateness"))
    step, late = map(short, largest)
    rate = short(1 / found["period"])
    return f"{rate} Hz in real time: {missed}; largest step time {step} ms, lateness {late} ms"
