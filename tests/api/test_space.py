"""Runs of a linkage in space, pushed by a hand; what is of the plane is refused."""

from functools import partial

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.forces import wrenches
from hapticlink.orchestrator.base.errors import InputFault
from tests.spatial_linkages import BALL_AND_SLIDER

SCENE = f"""
title = "A bar on a ball, and a slider across"
duration = 0.5
haptics.rate = 64
{BALL_AND_SLIDER}
[linkage.start_velocity]
ball = [1.0, -2.0, 3.0]

[hand]
type = "spring"
stiffness = [50.0, 100.0, 150.0]
damping = [2.0, 4.0, 4.0]
target = [[0.0, 0.1, 0.2, 0.25]]
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("space") / "bar.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def pushed(scene):
    return hl.run(scene, {"haptics.rate": 1000})


def test_the_work_of_the_hand_is_the_energy_that_the_mechanism_gets(pushed):
    """A force that is held over a step works along the chord of it."""
    F, x = pushed["hand.F"], pushed["virtual_mechanism.x"]
    work = np.cumsum((F[:-1] * np.diff(x, axis=0)).sum(axis=1))
    energy = pushed["virtual_mechanism.energy"]
    assert np.ptp(energy) > 0.5
    assert energy[1:] - energy[0] == pytest.approx(work, abs=1e-7)
    assert np.linalg.norm(x, axis=1) == pytest.approx(0.3, abs=1e-15)


def test_forces_in_space_have_no_moment(pushed):
    (_, _, force, moment), *others = wrenches(pushed)
    assert not others
    assert (moment == 0).all()
    assert force == pytest.approx(np.linalg.norm(pushed["hand.F"], axis=1), rel=1e-15)
    assert {*pushed.figures()} == {"mechanism", "trajectories", "forces"}


def test_an_equilibrium_in_space_is_judged_in_its_own_hand(tmp_path):
    """m s'' = -(a' K a) s - (a' B a) s' along the unit vector a of a slider, with F held for T:
    a' K a T/2 is taken off the damping."""
    path = tmp_path / "block.toml"
    path.write_text(SCENE)
    a, K, B = np.array([1, 2, 2]) / 3, np.array([50, 100, 150]), np.array([2, 4, 4])
    ball = {"linkage.joint.ball.type": "revolute", "linkage.joint.ball.stiffness": 1.0}
    ball |= {"linkage.joint.ball.damping": 0.1, "linkage.start_velocity": {}}
    slider = {"linkage.operational_point.body": "block", "linkage.gravity": [0.0, 0.0, 0.0]}
    judged = hl.equilibrium_stability(path, {**ball, **slider, "haptics.rate": 1000})
    decay = (a @ (B * a) - a @ (K * a) / 1000 / 2) / 2 / 2
    assert judged.verdict == "stable"
    assert judged.growth == pytest.approx(-decay, rel=0.02)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (partial(hl.stability, grid=2), "places on a grid are of the plane: leave out --grid"),
        (hl.tune, "a \\[linkage\\], \\[device\\], \\[controller\\] and \\[hand\\] are needed"),
    ],
)
def test_what_is_of_the_plane_is_refused(scene, made, message):
    with pytest.raises(InputFault, match=message):
        made(scene)


def test_a_run_in_space_is_not_replayed(pushed):
    with pytest.raises(InputFault, match="its linkage is in space, and pages and replays draw the"):
        hl.view(pushed)
