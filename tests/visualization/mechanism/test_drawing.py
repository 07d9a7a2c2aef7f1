"""The drawing of a mechanism shows it where the run has it."""

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Polygon
from numpy.typing import NDArray

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.visualization.mechanism import drawing
from hapticlink.visualization.mechanism.picture import Part, directions
from tests.shared_fixtures import run_once, status


def test_the_operational_point_is_drawn_where_it_is() -> None:
    run = hl.run("six-bar", {"duration": 0.3})
    axes = run.figures()["mechanism"].axes[0]
    marks = {line.get_label(): line for line in axes.lines}
    x = run.haptics["virtual_mechanism.x"] * 1e3
    found = marks["operational point"].get_xydata()
    np.testing.assert_allclose(found, x[:1, :2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(marks["path of operational point x_S"].get_xydata(), x[:, :2])


def test_a_body_of_three_joints_is_a_triangle_of_them() -> None:
    """Corners apart by the distances of the scene's coupler."""
    scene = hl.scene("six-bar")
    assert scene.linkage is not None
    start = [scene.linkage.start.get(joint.name, 0.0) for joint in scene.linkage.joint]
    (axes,) = drawing.figure(scene, start).axes
    (coupler,) = (p for p in axes.patches if isinstance(p, Polygon))
    corners = coupler.get_xy()[:-1]
    places = [j.at_parent for j in scene.linkage.joint if j.parent == "coupler"]
    places += [at for loop in scene.linkage.loop
               for b, at in zip(loop.bodies, loop.at, strict=True) if b == "coupler"]  # fmt: skip
    places += [j.at_child or (0.0, 0.0) for j in scene.linkage.joint if j.child == "coupler"]

    def sides(points: object) -> np.ndarray:
        p = np.asarray(points, float)
        return np.sort(np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1))

    assert len(corners) == len(places) == 3
    np.testing.assert_allclose(sides(corners), sides(places) * 1e3, rtol=1e-9)


def test_a_cut_joint_beneath_the_operational_point_has_its_name_beside_it() -> None:
    scene = hl.scene("pantograph")
    assert scene.linkage is not None
    start = [scene.linkage.start.get(joint.name, 0.0) for joint in scene.linkage.joint]
    (axes,) = drawing.figure(scene, start).axes
    (point,) = (line for line in axes.lines if line.get_label() == "operational point")
    (name,) = (text for text in axes.texts if text.get_text() == "tracer")
    np.testing.assert_allclose(name.xy, point.get_xydata()[0], atol=1e-6)
    assert np.abs(name.xyann).min() > 5


@pytest.mark.parametrize(
    ("scene", "files"),
    [
        (
            "closed-loop-ideal",
            {
                *("blocks.png", "start.png", "workspace.png", "device.png", "simulation.png"),
                *("inside-controller.png", "inside-haptic-device.png"),
                *("inside-virtual-mechanism.png", "inside-virtual-environment.png"),
            },
        ),
        ("trammel", {"blocks.png", "start.png", "inside-virtual-mechanism.png"}),
    ],
)
def test_info_draws_and_names_what_it_drew(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: str, files: set[str]
) -> None:
    assert status("info", scene, "--draw", "--out", tmp_path) == 0
    assert {p.name for p in tmp_path.iterdir()} == files
    assert all(str(tmp_path / name) in capsys.readouterr().out for name in sorted(files)[:1])


def test_what_is_printed_of_a_run_has_the_numbers_of_its_tables() -> None:
    run = run_once("closed-loop-ideal", {"duration": 0.2})
    told = str(run)
    apart = run.haptics["virtual_mechanism.x"] - run.haptics["haptic_device.x_true"]
    largest = np.hypot(apart[:, 0], apart[:, 1]).max() * 1e3
    assert f"handle at most {largest:.3g} mm from the operational point" in told
    drift = np.hypot(*run.haptics["controller.F_drift"].T[:2]).max()
    assert f"F_drift {drift:.3g} N" in told
    closure = run.haptics["virtual_mechanism.closure_error"].max()
    assert f"loops close within {closure:.2g} m" in told


@pytest.mark.parametrize(
    ("scene", "reaches"), [("closed-loop-ideal", True), ("remote-centre", False)]
)
def test_what_the_device_cannot_reach_is_shaded(scene: str, reaches: bool) -> None:
    """The whole picture of the one is within 0.1 m of the device's middle; the posts of the other
    stand beyond the reach of an arm, 0.95 (proximal + distal) + crank/2."""
    found = open_scene.load(scene)
    assert found.linkage is not None
    start = [found.linkage.start.get(j.name, 0.0) for j in found.linkage.joint]
    (axes,) = drawing.figure(found, start).axes  # type: ignore[arg-type]
    labels = axes.get_legend_handles_labels()[1]
    assert ("outside the device's workspace" not in labels) == reaches


def test_constrained_directions_are_those_of_the_projector() -> None:
    """Against the singular vectors of the projector's range, also where it has rank 2 out of the
    plane."""
    part = Part("", "directions", ("P_c",), (9,), directions(), sparse=True)

    def shown(projector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(part.value({"P_c": projector.ravel().tolist()})).reshape(-1, 2)

    line = np.array([math.cos(0.3), math.sin(0.3), 0.0])
    (found,) = shown(np.outer(line, line))
    assert abs(np.dot(found, line[:2])) == pytest.approx(1.0)
    assert len(shown(np.diag([0.0, 0.0, 1.0]))) == 0
    both = shown(np.diag([1.0, 1.0, 0.0]))
    assert np.allclose(both @ both.T, np.eye(2))
    basis, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 2)))
    _, sizes, axes = np.linalg.svd(basis[:2].T)
    found = shown(basis @ basis.T)
    assert np.hypot(*found.T) == pytest.approx(sizes)
    assert np.abs(np.sum(found * axes, axis=1)) == pytest.approx(sizes)
