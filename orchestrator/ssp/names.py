"""Names of SSP (System Structure and Parameterization), and the keys of a scene that are kept in an
annotation, because the standard has no rates and no holds."""

from __future__ import annotations

SSP1 = "http://ssp-standard.org/SSP1/"
SSD = f"{SSP1}SystemStructureDescription"
SSC = f"{SSP1}SystemStructureCommon"
SSV = f"{SSP1}SystemStructureParameterValues"
SSM = f"{SSP1}SystemStructureParameterMapping"
SSB = f"{SSP1}SystemStructureSignalDictionary"
RUN = "urn:hapticlink:run"
ANNOTATION = "hapticlink.run"
STRUCTURE = "SystemStructure.ssd"
FMU = "application/x-fmu-sharedlibrary"
PACKAGE, DEFINITION = "application/x-ssp-package", "application/x-ssp-definition"
"""The types of components: an FMU, an .ssp and an .ssd."""

NOT_IN_ANNOTATION = frozenset(
    (
        *("linkage", "contacts", "mechanism", "directions", "device", "controller", "hand"),
        *("sensing", "mechanism_at", "directions_from", "graphics", "fmu", "connection"),
        *("packaging", "hands", "devices", "controllers", "local_model", "start_time"),
    )
)
"""Keys of a scene that are contained in its FMUs and the structure."""
OF_GRAPHICS = ("rate", "align", "phase")
"""Those of graphics that are in the annotation."""


def is_fixed(names: tuple[str, ...]) -> bool:
    """Whether a key determines the FMUs, which are built already, so that no option can change
    it."""
    if names[0] == "graphics":
        return len(names) > 1 and names[1] not in OF_GRAPHICS
    return names[0] in NOT_IN_ANNOTATION - {"fmu", "connection"}
