"""Devices from their files, for tests."""

from functools import cache

from hapticlink.orchestrator.scene.overrides import write_options
from hapticlink.orchestrator.scene.read_and_check import read_scene


@cache
def _read(name, options):
    text = f'title = "a device"\nduration = 1.0\n[device]\nextends = "{name}"\n'
    return read_scene(text, options).device


def device(name="twin", keys=None, **own):
    """The device of a file with other values at keys of [device]."""
    given = {f"device.{key}": value for key, value in {**(keys or {}), **own}.items()}
    return _read(name, write_options(given))
