"""The tables of a scene that describe components, as frozen records."""

from hapticlink.components.specs.contacts import (
    Contacts,
    Disc,
    Pair,
    Polygon,
)
from hapticlink.components.specs.control import (
    Controller,
    Passivity,
    Teleoperation,
    Topology,
)
from hapticlink.components.specs.device import (
    Device,
    Observer,
)
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    Hand,
    ProfileHand,
    SpringHand,
)
from hapticlink.components.specs.linkage import (
    Body,
    ConstantDrive,
    Directions,
    Drive,
    FurtherPoint,
    GraphicsCopy,
    Joint,
    Limits,
    Linkage,
    Loop,
    Mechanism,
    OperationalPoint,
    PDDrive,
    ProfileDrive,
    Spring,
)

__all__ = [
    "ArmHand",
    "Body",
    "ConstantDrive",
    "ConstantHand",
    "Contacts",
    "Controller",
    "Device",
    "Directions",
    "Disc",
    "Drive",
    "FurtherPoint",
    "GraphicsCopy",
    "Hand",
    "Joint",
    "Limits",
    "Linkage",
    "Loop",
    "Mechanism",
    "Observer",
    "OperationalPoint",
    "PDDrive",
    "Pair",
    "Passivity",
    "Polygon",
    "ProfileDrive",
    "ProfileHand",
    "Spring",
    "SpringHand",
    "Teleoperation",
    "Topology",
]
