"""A pose in which the number of constrained directions depends on what was before, against runs
that begin there with each number."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import Case, in_poses
from hapticlink.analysis.stability.hands import HANDS
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import FEWER, MORE, Pose
from studies.said.growth import growth_of

GRIP, PERIOD = "firm grip", 16 / 800
LINKS = ((0.0442, 0.9485), (0.0488, 0.6939), (0.0412, 1.0901))
TRIPLE: dict[str, Any] = {
    "operational_point": {"body": "link3", "at": [0.0206, 0.0]},
    "body": [
        {"name": f"link{i}", "mass": m, "inertia": 2e-4 * m, "center": [a / 2, 0.0]}
        for i, (a, m) in enumerate(LINKS, 1)
    ],
    "joint": [
        {"name": "joint1", "child": "link1", "damping": 0.004},
        {"name": "joint2", "parent": "link1", "child": "link2", "at_parent": [0.0442, 0.0]},
        {"name": "joint3", "parent": "link2", "child": "link3", "at_parent": [0.0488, 0.0]},
    ],
}
SCENE: dict[str, Any] = {
    "haptics.rate": 800,
    "graphics.rate": 50,
    "device.extends": "stage",
    "controller.teleoperation.stiffness": [20.0, 20.0, 0.6],
    "controller.teleoperation.damping": [7.5, 7.5, 0.26],
    "controller.topology": True,
    "controller.bias": "full",
    "linkage": TRIPLE | {"gravity": [0.0, -2.97]},
    "hand": {"type": "constant", "wrench": [0.0, 0.0, 0.0]},
}
NEARLY_STRETCHED, STRETCHED = (-1.1595, 0.2456, 0.4625), (-1.1595, 0.2, 0.4625)


def at(q: tuple[float, ...]) -> Pose:
    turned = np.cumsum(q)
    lengths = np.array([0.0442, 0.0488, 0.0206])
    x, y = float(lengths @ np.cos(turned)), float(lengths @ np.sin(turned))
    joints: dict[str, float | list[float]] = {f"joint{i}": x for i, x in enumerate(q, 1)}
    return Pose(0.0, joints, (x, y, float(turned[-1])), (2.45, 1.09, 0.0))


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    read = hl.scene("closed-loop-ideal", SCENE)
    found, without = in_poses(read, [at(NEARLY_STRETCHED)], {GRIP: HANDS[GRIP]}, DRIFT)
    assert not without
    return {case.pose: case for case in found}


def run_from(case: Case) -> Any:
    """A run that begins there, its hand 1e-7 m beside."""
    pose = case.at
    assert pose is not None
    options: dict[str, Any] = SCENE | pose.held | pose.started
    (target,) = options["hand"]["target"]
    options["hand"] |= {"target": [np.add(target, [0.0, 1e-7, 0.0, 0.0]).tolist()]}
    handle = {"table": [[0.0, *(pose.handle or ())]]}
    options["connection"] = [{"from": handle, "to": "haptic_device.x_start"}]
    return hl.run("closed-loop-ideal", options | {"duration": 16.0, "stop_when": ""}, figures=False)


def test_either_number_is_judged_and_has_the_growth_rate_of_its_run(
    cases: dict[str, Case],
) -> None:
    names = {"0 s": 0, f"0 s, {MORE}": 1}
    assert cases.keys() == names.keys()
    for name, number in names.items():
        run, told = run_from(cases[name]), cases[name].growth
        assert (run["virtual_environment.n_constraints"] == number).all()
        assert growth_of(run, PERIOD, told).rate == pytest.approx(told, rel=1e-3)
    few, many = cases.values()
    assert few.growth > many.growth / 2  # which is another motion


@pytest.mark.parametrize(
    ("start", "changes", "fast"),
    [
        (STRETCHED, {}, {"0 s": True, f"0 s, {FEWER}": False}),
        (STRETCHED, {"directions.hysteresis": 1.0}, {"0 s": False}),
        (NEARLY_STRETCHED, {}, {"0 s": False, f"0 s, {MORE}": True}),
        (NEARLY_STRETCHED, {"directions.rank_tolerance": 0.2}, {"0 s": True}),
        (NEARLY_STRETCHED, {"controller.topology": False}, {"0 s": False}),
    ],
)
def test_what_the_number_was_before_counts_within_the_hysteresis_alone(
    start: tuple[float, ...], changes: dict[str, Any], fast: dict[str, bool]
) -> None:
    """A search that begins where the linkage is stretched keeps a direction that is none by then.
    Without topology controller nothing depends on the number."""
    read = hl.scene("closed-loop-ideal", SCENE | changes)
    pose = replace(at(NEARLY_STRETCHED), joints=at(start).joints)
    found, _ = in_poses(read, [pose], {GRIP: HANDS[GRIP]}, DRIFT)
    assert {case.pose: case.growth < -1.0 for case in found} == fast
