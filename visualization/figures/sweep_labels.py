"""Title and axis labels of a sweep's figure, with units."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.analysis.sweep.row import Row
from hapticlink.orchestrator.results.numbers import short

UNITS = {"rate": "Hz", "duration": "s", "phase": "s", "mass": "kg", "inertia": "kg m2"}
"""Units of the keys that are varied most often, by the last part of the key."""


def unit(key: str) -> str:
    """The unit of a scene's key; "" if it has none or is not in `UNITS`."""
    return UNITS.get(key.rpartition(".")[2], "")


def axis(key: str) -> str:
    """A key with its unit, `graphics.rate (Hz)`."""
    return f"{key} ({unit(key)})" if unit(key) else key


def title(best: Row, value: float, quantity: str, keys: Sequence[str], ended: int, of: int) -> str:
    """A title with the smallest value of a quantity such as `RMS tracking error (mm)`, the point of
    the row `best` that has it, and how many of the `of` runs ended early or failed."""
    name, _, measured = quantity.partition(" (")
    where = ", ".join(f"{k} = {best.get(k, 'as in the scene')} {unit(k)}".rstrip() for k in keys)
    text = f"{name[:1].upper()}{name[1:]} down to {short(value)} {measured.rstrip(')')}".rstrip()
    few = f"; {ended} of {of} runs ended early or failed" if ended else ""
    return f"{text} at {where}{few}"
