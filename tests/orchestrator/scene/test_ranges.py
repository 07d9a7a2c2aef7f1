"""A number out of its range is refused, with its key, its place, the range and the unit."""

import math
import re

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.commands.json_schema import json_schema
from hapticlink.orchestrator.base.faults import SceneFault
from hapticlink.orchestrator.scene import overrides, read_and_check
from hapticlink.orchestrator.scene.scene_source import Source
from tests.orchestrator.scene.test_scene import GOOD
from tests.orchestrator.scene_numbers import SCENES, beyond, key, of_scene, put, tables, toml
from tests.shared_fixtures import status

SCHEMA = jsonschema.Draft202012Validator(json_schema())


@settings(max_examples=150)
@given(st.data())
def test_numbers_of_shipped_scenes_out_of_range(data):
    name = data.draw(st.sampled_from(SCENES), "scene")
    number = data.draw(st.sampled_from(of_scene(name)), "number")
    value = data.draw(beyond(number), "value")
    option = f"{'.'.join(map(str, number.path))}={toml(put(number.value, number.place, value))}"
    with pytest.raises(SceneFault) as refused:
        read_and_check.from_source(Source(name, tables(name), {}, (option,)))
    found = {re.sub(r" \(\w+\)", "", f.key): f for f in refused.value.findings}
    finding = found[key(number)]
    assert finding.option == f"--set {option}"
    limits, unit = number.quantity.range, number.quantity.unit
    assert f"{value!r:.90} is out of range" in finding.message.replace("...", "")
    assert (limits if limits != "finite" else "finite number") in finding.message
    assert unit == "1" or f"({unit})" in finding.message
    if isinstance(value, str) or math.isinf(value) or math.isnan(value):
        return  # JSON has none of these, and a fraction no bound that a pattern could say
    written = tables(name)
    if "family" not in written["linkage"]:
        overrides.apply(written, option)
        assert not SCHEMA.is_valid(written)


@pytest.mark.parametrize(
    ("option", "key", "limits"),
    [
        ("device.handle_mass=-1", "device.handle_mass", "> 0 (kg)"),
        ("device.rotor_inertia=-1e-3", "device.rotor_inertia", ">= 0 (kg.m2)"),
        ("device.encoder_resolution=-1", "device.encoder_resolution", "> 0 (rad)"),
        ("device.observer.omega_n=-5", "device.observer.omega_n", "> 0 (rad/s)"),
        ("device.reach_limit=5", "device.reach_limit", "> 0.5 and < 1"),
        ("directions.rank_tolerance=7", "directions.rank_tolerance", "> 0 and < 1"),
        ("graphics.stiffness=[-1,-1,-1]", "graphics.stiffness[2]", ">= 0 (N.m/rad)"),
        ("controller.damping=[-1,-1,-1]", "controller.damping[0]", ">= 0 (N.s/m)"),
    ],
)
def test_what_once_ran_is_refused(option, key, limits, capsys):
    assert status("run", "closed-loop", "--set", option) == 2
    value = option.partition("=")[2].strip("[]").partition(",")[0]
    expected = f": {key}: {float(value):g} is out of range: give a number {limits}"
    assert f"--set {option}{expected}\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["duration=0.001"], "0.001 s is less than a haptic period, 1/(512 Hz)"),
        (['power=[{effort="a.F", displacement="a.x", sign=0.5}]'], "0.5 is no sign: write 1 or -1"),
        (["directions.hysteresis=10"], "10.0 times rank_tolerance = 0.1 is 1"),
        (["device.base_y_a=0.3"], "0.3 m is not below base_y_b = 0.2 m"),
        (["device.distal_length=0.005"], "leaves an arm nothing between its two stops"),
        (["device.sensing=encoders"], "write `sensing` outside of [device]"),
        (["stop_when=hand.F[1] < nan"], "write a signal against a number"),
        (["linkage.family=n-four-bar", "linkage.n=1001"], ">= 1 and <= 1000"),
    ],
)
def test_numbers_that_limit_each_other(options, message):
    with pytest.raises(SceneFault, match=re.escape(message)):
        read_and_check.read(GOOD, options)
