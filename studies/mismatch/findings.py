"""All that the study found, from which its page is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from hapticlink.analysis.sweep.row import Row
from studies.mismatch.method_choice import Cell, Cells, Choice, Margins
from studies.mismatch.methods import Method

COMPENSATION = {"none": "Coriolis compensation off", "full": "Coriolis compensation on"}


@dataclass(frozen=True)
class Found:
    """runs: those by which methods were chosen, with the continuous ones; cells: the same by cell,
    method and case; margins: at rest; advice and `listed`, the methods to try: by cell, also of the
    rate kept apart; `tried` and `margins_apart`: runs and maps of the cases kept apart."""

    runs: Sequence[Row]
    cells: Cells
    margins: Margins
    advice: Mapping[Cell, Choice]
    listed: Mapping[Cell, Sequence[Method]]
    tried: Sequence[Row]
    margins_apart: Margins


def named(method: Method) -> str:
    """A method as text."""
    own = "" if method.integrator == "rk4" else f", {method.integrator}"
    return f"`{method.hold}`, {method.gains}{own}"


def both(names: Sequence[str]) -> str:
    """Names with commas and an `and`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def paragraph(text: str) -> str:
    return fill(text, 108, break_on_hyphens=False)
