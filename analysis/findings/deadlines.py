"""What a run in real time shows of its deadlines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticlink.orchestrator.results.numbers import short


def finding(report: Mapping[str, Any]) -> str:
    """A sentence of the report of a run in real time (`RealTimeRun.report`), or of one without a
    clock whose samples arrive as those of another run did."""
    rate = short(1 / report["period"])
    if "arrivals" in report:
        return f"{rate} Hz without a clock; samples arrived as those of {report['arrivals']} did"
    missed = f"{report['deadlines_missed'] or 'none'} of {report['ticks']} deadlines missed"
    largest = (1e3 * report[name]["max"] for name in ("step_time", "lateness"))
    step, late = map(short, largest)
    return f"{rate} Hz in real time: {missed}; largest step time {step} ms, lateness {late} ms"
