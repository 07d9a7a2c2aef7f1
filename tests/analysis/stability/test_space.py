"""Verdicts on a loop in space: a block on a slanted slide, felt through the ideal device."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import in_poses
from hapticlink.analysis.stability.hands import hands_in, standing
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import choose_evenly_spaced, simulate_scene
from hapticlink.components.port_space import PLANE, POINT
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import read_and_check

SCENE = """
title = "A block on a slanted slide, in the hand"
duration = 0.5
haptics.rate = 128
graphics.rate = 32

[linkage]
operational_point = { body = "block" }

[[linkage.body]]
name = "block"
mass = 0.5
inertia = 1e-3

[[linkage.joint]]
name = "slide"
type = "prismatic"
child = "block"
axis = [1.0, 2.0, 2.0]

[device]
extends = "ideal-3"

[controller.teleoperation]
stiffness = [200.0, 200.0, 200.0]
damping = [10.0, 10.0, 10.0]

[controller.topology]
stiffness = 400.0
damping = 40.0

[hand]
type = "spring"
stiffness = [300.0, 300.0, 300.0]
damping = [5.0, 5.0, 5.0]
"""
LATE = {"delays": {"controller.x_D": 0.015625, "controller.v_D": 0.015625}}


@pytest.fixture
def read():
    return open_scene.load(read_and_check.read_scene(SCENE, []))


@pytest.mark.parametrize(("options", "verdict"), [({}, "stable"), (LATE, "unstable")])
def test_the_verdict_in_a_hand_is_that_of_a_run(read, options, verdict):
    """The growth rate is that of the handle's speed from a second to the next."""
    scene, hand = open_scene.load(read, options), hands_in(POINT)["firm grip"]
    (pose,) = choose_evenly_spaced(simulate_scene(scene), scene.linkage, 1)
    ((case,), _) = in_poses(scene, [pose], {"firm grip": hand}, DRIFT)
    off = standing(hand, np.add(pose.point, (1e-6, 2e-6, -1e-6)))
    run = hl.run(scene, {"hand": off, "duration": 6.0, "stop_when": ""}, figures=False)
    speed = np.linalg.norm(run["haptic_device.v_true"], axis=1)
    seconds = [speed[k * 128 : (k + 1) * 128].max() for k in range(6)]
    assert case.verdict == verdict
    assert np.log(seconds[5] / seconds[2]) / 3 == pytest.approx(case.growth, abs=0.15)


def test_hands_in_space_have_no_moment():
    """What they are along lengths in the plane they are along all three."""
    for name, hand in hands_in(POINT).items():
        planar = hands_in(PLANE)[name]
        for gain in ("stiffness", "damping"):
            assert getattr(hand, gain) == (getattr(planar, gain)[0],) * 3


def test_the_damping_that_a_passive_port_needs_has_no_rotation(read):
    found = hl.passivity(read)
    assert found.turning == 0.0
    assert found.own == pytest.approx(0.0, abs=1e-6)
