"""All that the study found, from which its page is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hapticlink.analysis.sweep.row import METRIC, Row
from studies.mismatch.figures import short
from studies.mismatch.method_choice import Cell, Cells, Choice, Margins, quartiles
from studies.mismatch.methods import Method

COMPENSATION = {"none": "Coriolis compensation off", "full": "Coriolis compensation on"}


@dataclass(frozen=True)
class Found:
    """runs: those by which methods were chosen, with the continuous ones; cells: the same by cell,
    method and case; margins: at rest; advice: by cell; methods: what was taken along to the cases
    kept apart, of which `tried` are the runs and `margins_apart` the maps."""

    runs: Sequence[Row]
    cells: Cells
    margins: Margins
    advice: Mapping[Cell, Choice]
    methods: Mapping[Cell, Method]
    tried: Sequence[Row]
    margins_apart: Margins


def named(method: Method) -> str:
    """A method as text."""
    own = "" if method.integrator == "rk4" else f", {method.integrator}"
    return f"`{method.hold}`, {method.gains}{own}"


def errors(rows: Sequence[Row]) -> str:
    """Median, quartiles and largest tracking error (mm) of some runs."""
    if not rows:
        return "-"
    low, middle, high, worst = map(short, quartiles(rows, METRIC))
    return f"{middle} ({low} to {high}; {worst})"


def both(names: Sequence[str]) -> str:
    """Names with commas and an `and`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
