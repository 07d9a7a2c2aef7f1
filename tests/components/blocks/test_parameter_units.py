"""A parameter of the device's FMU has the unit that the scene's key declares."""

import typing

from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.specs.device import Device, Observer
from hapticlink.components.specs.quantities import Quantity


def declared() -> dict[str, str]:
    found = {}
    for record in (Device, Observer):
        for name, hint in typing.get_type_hints(record, include_extras=True).items():
            beside = getattr(hint, "__metadata__", ())
            found.update((name, each.unit) for each in beside if isinstance(each, Quantity))
    return found


def test_device_and_observer() -> None:
    units = {
        p.name: p.unit for p in haptic_device(Device(motor_friction=0.01), encoders=True).parameters
    }
    keys = declared()
    assert len(keys) == 26
    unused = {"substeps"}  # structure
    assert {name: unit for name, unit in units.items() if name != "x_start"} == {
        name: unit for name, unit in keys.items() if name not in unused
    }
