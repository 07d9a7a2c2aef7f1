"""The capability flags of an FMU, by FMI version."""

from __future__ import annotations

from hapticlink.orchestrator.fmi.description import Description

VARIABLE_STEP = "canHandleVariableCommunicationStepSize"
NEEDS_TOOL = "needsExecutionTool"
STATE = {"2": "canGetAndSetFMUstate", "3": "canGetAndSetFMUState"}
SERIALISED = {"2": "canSerializeFMUstate", "3": "canSerializeFMUState"}
ONCE = "canBeInstantiatedOnlyOncePerProcess"
"""FMI 2.0.5 section 4.3.1, FMI 3.0 section 4.3.1."""
DIRECTIONAL_DERIVATIVES = {
    "2": "providesDirectionalDerivative",
    "3": "providesDirectionalDerivatives",
}


def has_event_mode(description: Description) -> bool:
    """Whether its importer may handle its events (FMI 3.0 section 4.3.1)."""
    return description.fmi == "3" and "hasEventMode" in description.flags


def varies_step(description: Description) -> bool:
    return VARIABLE_STEP in description.flags


def restores_state(description: Description) -> bool:
    return STATE[description.fmi] in description.flags


def gives_directional_derivatives(description: Description) -> bool:
    return DIRECTIONAL_DERIVATIVES[description.fmi] in description.flags
