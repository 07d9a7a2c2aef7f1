"""Which FMUs can be taken back to a state of before."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.description import Description
from hapticlink.orchestrator.faults import InputFault
from hapticlink.orchestrator.system import System

FLAG = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}
"""By FMI version (FMI 2.0.5 section 4.3.1, FMI 3.0 section 4.3.1)."""


def able(description: Description) -> bool:
    return FLAG[description.fmi] in description.flags


def require(system: System, names: Iterable[str], what: str) -> None:
    """Raises InputFault naming the FMUs that cannot roll back."""
    unable = [n for n in names if not able(system.unit[n].description)]
    if unable:
        flags = {FLAG[system.unit[n].description.fmi] for n in unable}
        raise InputFault(
            f"{what} takes steps back, and {', '.join(unable)} cannot save and restore its state "
            f"({' or '.join(sorted(flags))} is not true); take coupling = 'gauss-seidel' or "
            "'jacobi' with a higher rate"
        )
