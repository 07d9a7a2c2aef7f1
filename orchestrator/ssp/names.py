"""The words of an SSP 1.0 (System Structure and Parameterization): names, and what of a scene
stands in the annotation, because the standard has no rates and no holds."""

from __future__ import annotations

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
RUN = "urn:hapticlink:run"
ANNOTATION = "hapticlink.run"
STRUCTURE = "SystemStructure.ssd"
FMU = "application/x-fmu-sharedlibrary"

NOT_IN_ANNOTATION = frozenset(
    (
        *("linkage", "contacts", "mechanism", "directions", "device", "controller", "hand"),
        *("sensing", "mechanism_at", "directions_from", "graphics", "fmu", "connection"),
        "packaging",
    )
)
"""Keys of a scene that its FMUs and the structure itself say; graphics keeps its rate."""


SCALAR = {"Boolean": "Boolean", "String": "String", "Real": "Real"}


def is_fixed(names: tuple[str, ...]) -> bool:
    """Whether the key of these names made the FMUs, which an option comes too late to change."""
    if names[0] == "graphics":
        return len(names) > 1 and names[1] not in ("rate", "align", "phase")
    made = NOT_IN_ANNOTATION - {"fmu", "connection"} | {"hands", "local_model"}
    return names[0] in made


def type_of(fmi_type: str) -> str:
    """The type of a connector or parameter for an FMI type."""
    if fmi_type.startswith("Float"):
        return "Real"
    return SCALAR.get(fmi_type, "Integer")
