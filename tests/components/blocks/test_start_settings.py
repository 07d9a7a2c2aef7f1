"""Start settings change the start values of their parameters, and nothing else of a component."""

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import pytest

from hapticlink.components.blocks.start_settings import START_SETTINGS, without_start_values
from hapticlink.components.component import Component
from hapticlink.components.specs.control import Controller, PassivityLaw, Teleoperation, Topology
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    FingertipHand,
    ProfileHand,
    SpringHand,
)
from hapticlink.components.specs.linkage import Directions
from hapticlink.fmus.blocks import component
from hapticlink.orchestrator import open_scene

LINKAGE = open_scene.load("closed-loop-ideal").linkage
THREE = (31.0, 0.0, 2.5)
HANDS = (
    ConstantHand(wrench=(-1.0, 0.0, 3.0)),
    ConstantHand(wrench=THREE, damping=THREE),
    ProfileHand(table=((0.0, 1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0)), damping=THREE),
    ArmHand(target=((0.0, 0.1, 0.2, 0.3),), mass=(2.0, 3.0, 4.0), grip_damping=THREE),
    SpringHand(stiffness=THREE, damping=THREE),
    FingertipHand(target=((0.0, 0.1, 0.2, 0.3),), mass=0.02, pulp_damping=1.5),
)
EVERY = Controller(
    damping=THREE,
    stiffness=(4.0, 5.0, 6.0),
    teleoperation=Teleoperation(stiffness=THREE, damping=(7.0, 8.0, 0.0)),
    topology=Topology(stiffness=11.0, damping=0.0),
    passivity=PassivityLaw(energy=0.2, limit=1.5, noise=1e-3, reset_after=2.0),
)
CONTROLLERS = (
    EVERY,
    Controller(teleoperation=False, topology=False, stiffness=THREE),
    Controller(impedance=False, topology=True, passivity=True),
)


def _cases() -> Iterator[tuple[str, dict[str, Any]]]:
    yield from (("hand", {"hand": spec}) for spec in HANDS)
    for spec in CONTROLLERS:
        yield "controller", {"controller": spec, "linkage": LINKAGE, "directions": Directions()}


def content(of: Component, *started: str) -> dict[str, Any]:
    """All of a component but the start values of its parameters, and of others that are
    `started`."""
    functions = (of.initialize, of.step, of.output, of.substep)
    return {f.name: getattr(of, f.name) for f in fields(of)} | {
        **{n: [replace(v, start=0.0) for v in getattr(of, n)] for n in ("parameters", *started)},
        "look_ups": [vars(look_up).keys() for look_up in of.look_ups],
        "functions": [f and f.serialize() for f in functions],
        **dict.fromkeys(("initialize", "step", "output", "substep")),
    }


@pytest.mark.parametrize(("block", "settings"), [*_cases()])
def test_only_start_values_of_parameters_change(block: str, settings: dict[str, Any]) -> None:
    common, starts = without_start_values(block, settings)
    whole, of_common = component(block, settings), component(block, common)
    assert content(whole) == content(of_common)
    assert starts
    started = {v.name: starts.get(v.name, v.starts) for v in of_common.parameters}
    assert started == {v.name: v.starts for v in whole.parameters}
    assert starts.keys() <= started.keys()


@pytest.mark.parametrize(("block", "settings"), [*_cases()])
def test_other_values_have_the_same_settings(block: str, settings: dict[str, Any]) -> None:
    """Until a part is left out."""
    common, _ = without_start_values(block, settings)
    assert without_start_values(block, common)[0] == common


def test_every_start_setting_is_one_of_a_case() -> None:
    for block, rows in START_SETTINGS.items():
        found = [without_start_values(b, given)[1] for b, given in _cases() if b == block]
        assert {*rows.values()} == {name for starts in found for name in starts}


def test_a_part_that_is_left_out_stays_left_out() -> None:
    common, starts = without_start_values("hand", {"hand": HANDS[0]})
    assert common["hand"].damping is None
    assert starts == {"wrench": (-1.0, 0.0, 3.0)}
    assert without_start_values("haptic_device", {"device": 1}) == ({"device": 1}, {})
