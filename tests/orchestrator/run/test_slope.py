"""The hold `slope` between two FMUs: the velocity that a target gets is the rate of its pose."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build_fmu import build
from hapticlink.orchestrator.base.errors import SceneFault
from tests.orchestrator.foreign_scenes import fmu_table, wire_table

RATE = 7.3
"""Of the angle, rad/s; the other coordinate is sin(3 t)."""
SCENE = (
    'title = "A slow motion, seen by a fast controller"\nduration = 2.0\nhaptics.rate = 512\n'
    'holds = { "slow.x" = "foh", "slow.v" = "slope" }\n'
    + fmu_table("slow", "slow", "rate = 32\n")
    + fmu_table("fast", "fast")
    + wire_table("slow.x", "fast.x")
    + wire_table("slow.v", "fast.v")
)
POSE, TWIST = ("m", "rad"), ("m/s", "rad/s")


def slow() -> Component:
    """A pose whose angle turns round and is wrapped, and a velocity that is not used."""
    outputs = [
        Variable("x", (2,), POSE, kind="angle"),
        Variable("v", (2,), TWIST, derivative_of="x"),
    ]
    block = Block(outputs=outputs)
    angle, wrong = RATE * block.t, ca.SX([99.0, 99.0])
    pose = ca.vertcat(ca.sin(3 * block.t), ca.atan2(ca.sin(angle), ca.cos(angle)))
    output = {"x": pose, "v": wrong}
    return block.component("slow", "moves", "continuous", initial={}, step={}, output=output)


def fast() -> Component:
    inputs = [Variable("x", (2,), POSE), Variable("v", (2,), TWIST)]
    block = Block(
        inputs=inputs, outputs=[Variable("pose", (2,), POSE), Variable("rate", (2,), TWIST)]
    )
    output = {"pose": block.u["x"], "rate": block.u["v"]}
    return block.component("fast", "sees it", "sampled", initial={}, step={}, output=output)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("slope")
    for component in (slow(), fast()):
        build(component, made)
    return made


def ran(folder: Path, text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, pose and velocity that `fast` gets."""
    (folder / "scene.toml").write_text(text)
    results = hl.run(hl.scene(str(folder / "scene.toml")))
    assert results.run["fault"] is None
    return results.haptics["time"], results["fast.pose"], results["fast.rate"]


def test_the_held_velocity_is_the_rate_of_the_held_pose_over_the_seam(folder):
    time, pose, rate = ran(folder, SCENE)
    frame = np.floor(time * 32 + 1e-9)  # the newest sample at each instant
    for n in range(2, 60):
        (k,) = np.nonzero(frame == n)
        moved = np.diff(pose[k], axis=0) * 512
        np.testing.assert_allclose(moved, rate[k][1:], rtol=1e-9, atol=1e-9)
        a, b = np.sin(3 * np.array([n - 1, n]) / 32)
        expected = np.tile([(b - a) * 32, RATE], (len(k), 1))
        np.testing.assert_allclose(rate[k], expected, rtol=1e-9, atol=1e-9)


def test_a_late_pose_and_its_rate_agree_too(folder):
    """Both with the same latency and losses."""
    late = "{ min = 0.003, max = 0.05, loss = 0.2, seed = 4 }"
    _, pose, rate = ran(folder, f'delays = {{ "slow.x" = {late}, "slow.v" = {late} }}\n' + SCENE)
    same = (np.abs(np.diff(rate, axis=0)) < 1e-12).all(axis=1)
    moved = np.diff(pose, axis=0)[same] * 512
    np.testing.assert_allclose(moved, rate[1:][same], rtol=1e-9, atol=1e-9)
    assert 800 < same.sum() < 1010


def test_a_slope_needs_the_pose(folder):
    (folder / "scene.toml").write_text(SCENE.replace('"slow.x" = "foh"', '"slow.x" = "slope"'))
    with pytest.raises(SceneFault, match="anything of which x is the derivative"):
        hl.run(hl.scene(str(folder / "scene.toml")))
