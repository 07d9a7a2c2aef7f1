"""Verdicts on a loop in space: a block on a slanted slide, felt through the ideal device."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import InHands, in_poses
from hapticlink.analysis.stability.hands import hands_in, standing
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import (
    at_pose,
    by_joint,
    choose_evenly_spaced,
    simulate_scene,
)
from hapticlink.analysis.stability.shared_work import SharedWork
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


def test_a_redundant_loop_is_judged_in_every_pose_as_in_that_alone():
    """What the slopes of one pose know of its closures is no matter of the next one's: of a copy
    these would be slopes along the closures of the pose before."""
    options = {"haptics.rate": 128, "graphics.rate": 32, "linkage.gravity": [0.0, 0.0, 0.0]}
    scene = open_scene.load("closed-loop-bricard", options)
    poses = choose_evenly_spaced(simulate_scene(scene), scene.linkage, 2)
    hands = {"light touch": hands_in(POINT)["light touch"]}
    together, without = in_poses(scene, poses, hands, DRIFT, work=SharedWork())
    alone = [in_poses(scene, [pose], hands, DRIFT)[0][0] for pose in poses[1:]]
    assert not without
    for case, own in zip(together[1:], alone, strict=True):
        assert case.growth == pytest.approx(own.growth, abs=1e-6)
    assert np.ptp([case.growth for case in together]) > 0.1


CELLS = [
    (0, "light touch", 1.0, 16, 32), (0, "firm grip", 4.0, 16, 0),
    (0, "stiff arm, firm grip", 1.0, 32, 8), (0, "arm in posture, firm grip", 16.0, 32, 16),
    (1, "arm at rest, soft grip", 4.0, 16, 16), (1, "light touch", 1.0, 32, 8),
    (1, "arm at rest, firm grip", 1.0, 32, 0), (2, "firm grip", 4.0, 16, 12),
    (2, "arm at rest, firm grip", 16.0, 16, 16), (2, "arm in posture, firm grip", 16.0, 64, 8),
]  # fmt: skip
"""Moment (s) of Bricard's run, hand, multiple of the coupling's stiffness, rate of the graphics
(Hz), and delay of what is measured (ticks of 512 Hz)."""


@pytest.mark.parametrize(("moment", "name", "scale", "rate", "delay"), CELLS)
def test_verdicts_on_bricards_mechanism_are_those_of_runs(moment, name, scale, rate, delay):
    """Next to the equilibrium in a hand that stands still, the handle's speed of the first second
    comes down to a tenth within 20 s, or grows tenfold within 6 s."""
    delays = dict.fromkeys(("controller.x_D", "controller.v_D"), delay / 512)
    coupling = {"controller.teleoperation.stiffness": [100.0 * scale] * 3}
    options = {**coupling, "graphics.rate": rate, "delays": delays if delay else {}}
    scene, hand = open_scene.load("closed-loop-bricard", options), hands_in(POINT)[name]
    visited = simulate_scene(open_scene.load("closed-loop-bricard"))
    pose = choose_evenly_spaced(visited, scene.linkage, 3)[moment]
    with at_pose(scene, pose) as (place, _):
        (case,) = InHands(place).cases(pose.name, {name: hand}, DRIFT)
        q, x, F = map(place.signal, ("virtual_mechanism.q", "haptic_device.x_true", "hand.F"))
    off = standing(hand, x + F / np.array(hand.stiffness) + (1e-6, 2e-6, -1e-6))
    started = {"linkage.start": by_joint(scene.linkage, q), "hand": off, "stop_when": ""}
    stable = case.verdict == "stable"
    run = hl.run(scene, {**started, "duration": 20.0 if stable else 6.0}, figures=False)
    speed = np.linalg.norm(run["haptic_device.v_true"], axis=1)
    early, late = speed[:512].max(), speed[-512:].max()
    assert late < 0.1 * early if stable else late > 10 * early
