"""Where the constant wrench of a scene leads, against the scene's own run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import Case, in_poses
from hapticlink.analysis.stability.hands import OWN_FREE, hands_in, linearise_hand
from hapticlink.analysis.stability.modes import DRIFT, modes
from hapticlink.analysis.stability.poses import LED, Pose, at_pose, find_rest_pose

WRENCH = (-0.3, 0.2, 0.0)
TWO_LINKS = {
    "operational_point": {"body": "link2", "at": [0.0231, 0.0]},
    "body": [
        {"name": "link1", "mass": 1.7299, "inertia": 3.46e-4, "center": [0.0217, 0.0]},
        {"name": "link2", "mass": 0.7758, "inertia": 1.552e-4, "center": [0.0231, 0.0]},
    ],
    "joint": [
        {"name": "first", "child": "link1", "damping": 0.00563},
        {"name": "second", "parent": "link1", "child": "link2", "at_parent": [0.0434, 0.0]},
    ],
    "start": {"first": 1.14, "second": -1.577},
}
PIN = {
    "name": "pin", "type": "slot", "bodies": ["link2", "ground"],
    "at": [[0.0462, 0.0], [0.0, 0.01988]], "axis": 0.0,
}  # fmt: skip
BESIDE: dict[str, Any] = {
    "linkage": {**TWO_LINKS, "loop": [PIN]},
    "device.extends": "pantograph-mk-ii",
    "controller.bias": "full",
    "controller.topology": False,
    "controller.teleoperation.stiffness": [28.69, 28.69, 0.6621],
    "controller.teleoperation.damping": [10.579, 10.579, 0.2466],
    "hold": "second-order",
    "haptics.rate": 1000,
    "graphics.rate": 50,
    "delays": {"virtual_mechanism.x": 0.003, "virtual_mechanism.v": 0.003},
    "hand": {"type": "constant", "wrench": list(WRENCH), "damping": [4.0, 4.0, 0.004]},
}
"""Without topology controller the handle rests beside the operational point, here 30 mm off."""


@pytest.fixture(scope="module")
def led() -> tuple[Pose, dict[str, Case]]:
    read = hl.scene("closed-loop-ideal", BESIDE)
    assert read.linkage is not None
    assert read.hand is not None
    pose = find_rest_pose(read, read.linkage)
    hands = {"firm grip": hands_in(read.space)["firm grip"], OWN_FREE: linearise_hand(read.hand)}
    cases, without = in_poses(read, [pose], hands, DRIFT)
    assert not without
    return pose, {case.hand: case for case in cases}


def test_of_equilibria_side_by_side_that_one_is_judged_in_which_the_scenes_own_run_rests(
    led: tuple[Pose, dict[str, Case]],
) -> None:
    pose, cases = led
    long = {"duration": 90.0, "stop_when": "", "packaging": "native"}
    run = hl.run("closed-loop-ideal", BESIDE | long, figures=False)
    x = run["haptic_device.x_true"]
    assert pose.handle == pytest.approx(x[-1], abs=2e-5)
    assert np.linalg.norm(np.subtract(pose.handle, pose.point)[:2]) > 0.01
    moved = np.abs(np.diff(x[::1000], axis=0)).max(axis=1)[50:85]
    assert moved[0] > 10 * moved[-1] > 1e-9  # over a decade, and far above rounding
    decay = np.polyfit(np.arange(len(moved)), np.log(moved), 1)[0]
    assert cases[OWN_FREE].growth == pytest.approx(decay, rel=0.01)


def test_a_run_that_begins_there_with_its_handle_beside_the_point_stays(
    led: tuple[Pose, dict[str, Case]],
) -> None:
    pose, _ = led
    handle = [0.0, *(pose.handle or ())]
    beside = {"connection": [{"from": {"table": [handle]}, "to": "haptic_device.x_start"}]}
    start = BESIDE | {"linkage.start": pose.joints, "duration": 1.0, "stop_when": ""}

    def leaves(options: dict[str, Any]) -> float:
        x = hl.run("closed-loop-ideal", start | options, figures=False)["haptic_device.x_true"]
        return float(np.abs(x - handle[1:]).max())

    assert leaves(beside) < 1e-8
    assert leaves({}) > 0.01


def test_there_the_hand_gives_the_wrench_of_the_scene_and_some_direction_is_free(
    led: tuple[Pose, dict[str, Case]],
) -> None:
    _, cases = led
    for case in cases.values():
        assert case.at is not None
        assert case.at.press == pytest.approx(WRENCH, abs=1e-6)
        assert case.neutral


def test_a_run_that_keeps_moving_is_told_and_judged_at_the_equilibrium_under_its_wrench() -> None:
    found = hl.stability("closed-loop-ideal")
    told = next(line for line in found.lines() if line.startswith(f"{LED}: "))
    assert "its run with 5 N.s/m of damping still moves at up to 3.2 rad/s" in told
    (pose,) = (pose for pose in found.poses if pose.name == LED)
    wrench = hl.scene("closed-loop-ideal").hand.wrench  # type: ignore[union-attr]
    for case in found.cases:
        if case.pose == LED:
            assert case.at is not None
            assert case.at.press == pytest.approx(wrench, abs=1e-9)
            assert case.at.point == pytest.approx(pose.point, abs=1e-9)
    run = hl.run(
        "closed-loop-ideal", {"duration": 10.0, "hand.damping": [5.0, 5.0, 0.005]}, figures=False
    )
    rates = run["virtual_mechanism.qd"][-512:]
    assert np.abs(rates).max() == pytest.approx(3.2, abs=0.05)
    free = next(case for case in found.cases if case.pose == LED and case.free)
    assert free.growth == pytest.approx(_growth_of_run(pose, wrench), rel=0.01)


def _growth_of_run(pose: Pose, wrench: tuple[float, ...]) -> float:
    """The growth rate (1/s) of a run that begins in a pose, with a push at first."""
    pushed = [[0.0, wrench[0] + 1e-6, *wrench[1:]], [0.05, *wrench]]
    hand = {"type": "profile", "table": pushed, "interpolation": "hold"}
    options = {**pose.started, "hand": hand, "duration": 80.0, "stop_when": ""}
    x = hl.run("closed-loop-ideal", options, figures=False)["haptic_device.x_true"]
    moved = np.abs(np.diff(x[::32], axis=0)).max(axis=1)[320:]
    highest = moved.reshape(-1, 160).max(axis=1)  # over 10 s, three periods and a half
    return float(np.polyfit(10.0 * np.arange(len(highest)), np.log(highest), 1)[0])


STRETCHED: dict[str, Any] = {
    "haptics.rate": 1000,
    "graphics.rate": "1000/11",
    "hold": "foh",
    "controller.teleoperation.stiffness": [56.67, 56.67, 0.4245],
    "controller.teleoperation.damping": [6.455, 6.455, 0.0559],
    "controller.topology": False,
    "controller.bias": "full",
    "linkage.gravity": [0.0, -0.84],
    "linkage.body.link4.mass": 2.1613,
    "hand": {"type": "constant", "wrench": [0.152, 0.128, 0.0]},
}
"""Of this five-bar one arm is almost stretched where the wrench leads it, and the handle creeps."""


def test_a_run_that_hardly_moves_is_not_said_to_move_still() -> None:
    """1e-6 N against 5 N.s/m of damping: 2e-7 m/s, in a scene with topology controller."""
    read = hl.scene("closed-loop-ideal", {"hand": {"type": "constant", "wrench": [1e-6, 0.0, 0.0]}})
    assert read.linkage is not None
    pose = find_rest_pose(read, read.linkage)
    assert "with 5 N.s/m of damping moves below 0.001 rad/s or m/s after 10 s" in pose.found


def test_a_run_whose_handle_creeps_on_is_not_said_to_rest_and_no_grip_grows_there() -> None:
    read = hl.scene("closed-loop-ideal", STRETCHED)
    assert read.linkage is not None
    pose = find_rest_pose(read, read.linkage)
    assert "still moves" in pose.found
    run = hl.run(
        "closed-loop-ideal",
        STRETCHED | {"duration": 60.0, "stop_when": "", "hand.damping": [5.0, 5.0, 0.005]},
        figures=False,
    )
    assert np.abs(run["virtual_mechanism.qd"][-300:]).max() < 1e-3  # at rest, the handle is not:
    assert np.linalg.norm(np.ptp(run["haptic_device.x_true"][-10000:, :2], axis=0)) > 0.01
    with at_pose(read, pose) as (place, _):
        found = modes(place.period({}).linear, place.map.period)
        rest = place.equilibrium
        moving = place.map.moving
        largest = []
        for way in (1e-7, -1e-7):
            z = rest.copy()
            z[moving] += way * np.random.default_rng(4).normal(size=len(moving))
            sizes = []
            for _ in range(round(20.0 / place.map.period)):
                z = place.map.image(z)
                sizes.append(np.abs(z - rest)[moving].max())
            largest.append(max(sizes[len(sizes) // 2 :]) / max(sizes[: len(sizes) // 2]))
    assert max(mode.growth for mode in found if not mode.neutral) < 0.01
    assert max(largest) < 2.0


def test_equilibria_side_by_side_are_told_where_nothing_resists_and_only_there() -> None:
    def tells(options: dict[str, Any]) -> bool:
        found = hl.stability("closed-loop-ideal", {**options, "graphics.rate": 64}, poses=1)
        return any("side by side" in line for line in found.lines())

    target = [[0.0, 0.0445, 0.0148, -0.788]]
    spring = {"type": "spring", "stiffness": [100.0, 100.0, 0.3], "target": target}
    assert tells({"hand": spring, "controller.topology": False})
    assert not tells({"hand": spring})
