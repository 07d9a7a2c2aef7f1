"""The class of an FMU that is loaded into this process."""

from __future__ import annotations

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.event_mode import InProcessWithEvents
from hapticlink.orchestrator.fmi.fmi3_differences import InProcess3


def in_process(description: Description) -> type[InProcess]:
    """The class of an FMU in this process, by its version of FMI and what it offers."""
    if description.equations:
        try:
            from hapticlink.orchestrator.fmi.model_exchange import MODEL_EXCHANGE
        except OSError as error:
            raise InputFault(
                f"{description.path}: it is for model exchange, and its solver, SUNDIALS as fmpy "
                f"brings it, cannot be loaded: {error}; export it for co-simulation"
            ) from error
        return MODEL_EXCHANGE[description.fmi]
    if description.has_event_mode:
        return InProcessWithEvents
    return {"2": InProcess, "3": InProcess3}[description.fmi]
