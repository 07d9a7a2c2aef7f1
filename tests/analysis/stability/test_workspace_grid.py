"""The poses of a grid against closed forms of an arm of two links: which places it reaches, and at
which of them a sampled hand makes it shake."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import hapticlink as hl
from hapticlink.analysis.stability.poses import simulate_scene, visited_poses
from hapticlink.analysis.stability.workspace_grid import grid_poses
from hapticlink.components.device.workspace import margin

Matrix = NDArray[np.float64]
T = 1 / 512
LENGTH, MASS = 0.1, 0.018
"""Of each of two uniform links (m, kg), so light that the arm shakes where it is stretched."""
ARM = f"""
title = "a light arm of two links"
duration = 0.1
haptics.rate = 512
[linkage]
operational_point = {{ body = "link2", at = [{LENGTH}, 0.0] }}
start = {{ shoulder = 0.3, elbow = -0.5 }}
[[linkage.joint]]
name = "shoulder"
child = "link1"
[[linkage.joint]]
name = "elbow"
parent = "link1"
child = "link2"
at_parent = [{LENGTH}, 0.0]
[hand]
type = "constant"
wrench = [0.0, 0.0, 0.0]
""" + "".join(
    f"""
[[linkage.body]]
name = "link{i}"
mass = {MASS}
inertia = {MASS * LENGTH**2 / 12}
center = [{LENGTH / 2}, 0.0]
"""
    for i in (1, 2)
)


def growth(q: Matrix, stiffness: float) -> float:
    """That (1/s) of q'' = -D^-1 J'(K J q + B J q') with the wrench held over T: exact steps."""
    c, half, own = np.cos(q[1]), LENGTH / 2, MASS * LENGTH**2 / 12
    far = own + MASS * half**2
    both = far + MASS * LENGTH * half * c
    D = np.array([[own + MASS * half**2 + both + MASS * LENGTH * (LENGTH + half * c), both],
                  [both, far]])  # fmt: skip
    first, second = q[0], q[0] + q[1]
    along = LENGTH * np.array([[-np.sin(first), -np.sin(second)], [np.cos(first), np.cos(second)]])
    J = np.vstack([along @ [[1, 0], [1, 1]], [1, 1]])
    G = np.linalg.solve(D, J.T)
    K = G @ np.diag([stiffness, stiffness, stiffness / 300]) @ J
    B = G @ np.diag([5.0, 5.0, 0.01]) @ J
    eye = np.eye(2)
    step = np.block([[eye - T**2 / 2 * K, T * eye - T**2 / 2 * B], [-T * K, eye - T * B]])
    return float(np.log(np.abs(np.linalg.eigvals(step)).max()) / T)


def test_a_light_arm_shakes_at_the_places_where_its_closed_form_does(tmp_path: Path) -> None:
    """In both spring hands: stretched the arm is lighter than they can be sampled for, bent not."""
    path = tmp_path / "arm.toml"
    path.write_text(ARM)
    found = hl.stability(path, poses=1, grid=4)
    assert found.verdict == "unstable"
    poses = {pose.name: pose for pose in found.poses[1:]}
    assert len(poses) >= 6
    said = set()
    for case in found.cases:
        stiffness = {"light touch": 100.0, "firm grip": 1000.0}.get(case.hand)
        if stiffness and case.pose in poses:
            joints = poses[case.pose].joints
            q = np.array([joints["shoulder"], joints["elbow"]], float)
            assert case.growth == pytest.approx(growth(q, stiffness), rel=1e-4, abs=1e-3)
            assert case.verdict == ("unstable" if case.growth > 0.0 else "stable")
            said.add((case.hand, case.verdict))
    assert len(said) == 4
    assert found.worst.pose in {*poses, found.poses[0].name}


def test_a_grid_has_the_places_that_linkage_and_device_reach() -> None:
    """Links 1 and 2 of Table 6.1 reach 21 to 63 mm; with the elbow on the side on which it is in
    the run (law of cosines)."""
    scene = hl.scene("serial")
    run = simulate_scene(scene, {"duration": 1.0})
    points, joints = visited_poses(run)
    assert (joints[:, 1] < 0.0).all()
    low, high = (end(points[:, :2], axis=0) for end in (np.min, np.max))
    low, high = low - 0.021, high + 0.021
    assert scene.linkage is not None
    assert scene.device is not None
    count = 5
    poses = grid_poses(run, scene, scene.linkage, count)
    expected = set()
    for i, j in np.ndindex(count, count):
        x, y = low + (high - low) * (np.array([i, j]) + 0.5) / count
        r = float(np.hypot(x, y))
        assert min(abs(r - 0.021), abs(r - 0.063)) > 1e-5  # none is at the boundary
        if 0.021 < r < 0.063:
            elbow = -np.arccos((r**2 - 0.042**2 - 0.021**2) / (2 * 0.042 * 0.021))
            ahead = np.arctan2(0.021 * np.sin(elbow), 0.042 + 0.021 * np.cos(elbow))
            q = np.array([np.arctan2(y, x) - ahead, elbow])
            if margin(scene.device, np.array([[x, y, q.sum()]]))[0] >= 0.0:
                expected.add((round(x, 9), round(y, 9), *np.round(q, 7)))
    found = {
        (*np.round(p.point[:2], 9), *np.round([p.joints["shoulder1"], p.joints["elbow1"]], 7))
        for p in poses
    }
    assert found == expected
    assert len(expected) >= 8


def test_where_the_point_moves_on_a_curve_the_poses_are_on_it() -> None:
    """The slider of a slider-crank: each cell with a part of its way has the nearest pose."""
    scene = hl.scene("slider-crank")
    run = simulate_scene(scene, {"duration": 1.0})
    assert scene.linkage is not None
    poses = grid_poses(run, scene, scene.linkage, 4)
    assert len(poses) >= 2
    for pose in poses:
        assert pose.point[1] == pytest.approx(0.0, abs=1e-9)
    assert len({pose.name for pose in poses}) == len(poses)


def test_a_grid_is_a_whole_number_of_places() -> None:
    with pytest.raises(hl.InputFault, match="grid = -1"):
        hl.stability("closed-loop-ideal", grid=-1)
