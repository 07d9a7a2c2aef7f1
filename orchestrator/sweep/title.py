"""What stands on the figure of a sweep: its finding, with units."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.orchestrator.results.figures import short
from hapticlink.orchestrator.sweep.row import Row

UNITS = {"rate": "Hz", "duration": "s", "phase": "s", "mass": "kg", "inertia": "kg m2"}
"""Of what is varied most, by the last part of its key."""


def unit(key: str) -> str:
    """The unit of a scene's key, "" where it has none or is not known."""
    return UNITS.get(key.rpartition(".")[2], "")


def axis(key: str) -> str:
    """`graphics.rate (Hz)`."""
    return f"{key} ({unit(key)})" if unit(key) else key


def title(best: Row, value: float, quantity: str, keys: Sequence[str], lost: int, of: int) -> str:
    """The least value of a quantity, as `RMS tracking error (mm)`, and where it stands; how many of
    the runs have none."""
    name, _, measured = quantity.partition(" (")
    where = ", ".join(f"{k} = {best.get(k, 'as in the scene')} {unit(k)}".rstrip() for k in keys)
    found = f"Least: {name} {short(value)} {measured.rstrip(')')}".rstrip()
    few = f"; {lost} of {of} runs ended early or failed" if lost else ""
    return f"{found} at {where}{few}"
