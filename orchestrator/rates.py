"""Rates of a scene, as frozen records: a number of Hz, bounds and a seed, or a list of times."""

from __future__ import annotations

from dataclasses import dataclass

Rate = int | float | str
"""Hz; a fraction of whole numbers may be written as text ("30000/1001")."""
Seconds = int | float | str
"""s, written as a rate is ("1/2048")."""


@dataclass(frozen=True, kw_only=True)
class VariableRate:
    """Periods drawn uniformly between 1/max and 1/min (Hz), in whole haptic ticks."""

    min: Rate
    max: Rate
    seed: int = 0


AnyRate = Rate | VariableRate | tuple[float, ...]
"""A tuple holds the times (s) at which steps end. A file may also give a recorded trace,
`{ trace = FILE }`, which becomes such times."""
