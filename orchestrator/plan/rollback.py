"""Schemes that repeat steps need FMUs that support rollback."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.fmi.capabilities import STATE, restores_state
from hapticlink.orchestrator.system.system import System


def require(system: System, names: Iterable[str], what: str) -> None:
    """Raises InputFault with the FMUs of `names` that cannot save and restore their state; `what`
    needs it."""
    unable = [n for n in names if not restores_state(system.fmu[n].description)]
    if unable:
        flags = {STATE[system.fmu[n].description.fmi] for n in unable}
        raise InputFault(
            f"{what} takes steps back, and {', '.join(unable)} cannot save and restore its state "
            f"({' or '.join(sorted(flags))} is not true); take coupling = 'gauss-seidel' or "
            "'jacobi' with a higher rate"
        )
