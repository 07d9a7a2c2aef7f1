"""A verdict on two users is one on both of their controllers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import InHands
from hapticlink.analysis.stability.hands import HANDS
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import choose_evenly_spaced, simulate_scene
from hapticlink.analysis.stability.resting_scene import RestingScene, resting
from hapticlink.orchestrator.scene.overrides import write_options

OPTIONS: dict[str, Any] = {
    "haptics.rate": 128,
    "graphics.rate": 64,
    "hand.target": [[0.0, 0.0445477, 0.0148492, -0.785398]],
    "controller.teleoperation": {"stiffness": [50.0, 50.0, 0.2], "damping": [8.0, 8.0, 0.04]},
}
OWN_OF_LEFT = {
    "controllers.left.teleoperation": {"stiffness": [20.0, 20.0, 0.1], "damping": [4.0, 4.0, 0.02]}
}


@pytest.fixture(scope="module")
def place() -> Iterator[RestingScene]:
    with resting("two-users", OPTIONS | OWN_OF_LEFT) as found:
        yield found


def growth(held: InHands) -> float:
    (case,) = held.cases("0 s", {"firm grip": HANDS["firm grip"]}, DRIFT)
    return case.growth


def growth_with(options: dict[str, Any]) -> float:
    with resting("two-users", OPTIONS | OWN_OF_LEFT | options) as changed:
        return growth(InHands(changed))


def test_gains_are_scaled_and_inputs_delayed_in_both_controllers(place: RestingScene) -> None:
    connections = place.map.system.connections
    one, other = (
        [c.name for c in connections if c.target == t] for t in ("controller", "controller_left")
    )
    scaled = {
        f"{table}.teleoperation": {
            "stiffness": [2.0 * k for k in gains["stiffness"]],
            "damping": [2.0**0.5 * b for b in gains["damping"]],
        }
        for table, gains in (
            ("controller", OPTIONS["controller.teleoperation"]),
            ("controllers.left", OWN_OF_LEFT["controllers.left.teleoperation"]),
        )
    }
    late = growth(InHands(place, late=2))
    assert late == pytest.approx(
        growth_with({"delays": dict.fromkeys([*one, *other], 2 / 128)}), rel=1e-3
    )
    assert late != pytest.approx(growth_with({"delays": dict.fromkeys(one, 2 / 128)}), rel=1e-2)
    assert growth(InHands(place, {"drift": 2.0})) == pytest.approx(growth_with(scaled), rel=1e-3)


def test_gains_are_written_for_each_controller_that_has_its_own(place: RestingScene) -> None:
    keys = [key for key in place.gains.options({}) if key.endswith("teleoperation.stiffness")]
    assert keys == [
        "controller.teleoperation.stiffness",
        "controllers.left.teleoperation.stiffness",
    ]
    soft = write_options(place.gains.options({"drift": 0.25}))
    left = hl.scene("two-users", [*write_options(OPTIONS | OWN_OF_LEFT), *soft]).controllers["left"]
    assert left.teleoperation.stiffness == (5.0, 5.0, 0.025)  # type: ignore[union-attr]
    with resting("two-users", OPTIONS) as shared:  # left has what [controller] says
        assert not any("left" in key for key in shared.gains.options({}))


def test_the_wrench_of_the_other_hand_is_no_contact() -> None:
    scene = hl.scene("two-users", OPTIONS | {"duration": 0.1})
    assert scene.linkage
    poses = choose_evenly_spaced(simulate_scene(scene), scene.linkage, 2)
    assert [pose.name for pose in poses] == ["0 s", "0.0469 s"]
    assert not any(any(pose.press) for pose in poses)


def test_the_other_users_force_is_no_contact() -> None:
    """The left user pulls, and the walls are 2.6 mm away."""
    walls = [[-0.03, -0.045], [0.068, -0.045], [0.068, 0.036], [-0.03, 0.036]]
    room = {"contacts": {"enclosure": walls, "stiffness": 1000.0, "damping": 10.0}}
    pull = {"hands.left.target": [[0.0, 0.034707, -0.011319, 0.314]]}
    with resting("two-users", OPTIONS | room | pull) as found:
        assert abs(found.signal("virtual_mechanism.F_env")).max() > 0.01
        assert found.signal("virtual_mechanism.contact_gap") > 1e-3
        assert not found.contact.any()
