"""A four-bar keeps its energy wherever its loop is cut, and moves on either branch as its mirror
image."""

from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Loop,
    Mechanism,
    OperationalPoint,
)
from tests.blocks import Running, virtual_mechanism


def rod(name, length):
    return Body(name=name, mass=1.0, inertia=length**2 / 12, center=(length / 2, 0.0))


def four_bar(cut="middle"):
    """Crank .2, coupler .5, rocker .4, ground .5 m, under gravity; the crank turns all the way.
    The cut joint is between coupler and rocker, or at the rocker's pivot on the ground."""
    crank = Joint(name="crank", child="crank")
    elbow = Joint(name="elbow", parent="crank", child="coupler", at_parent=(0.2, 0.0))
    if cut == "middle":
        last = Joint(name="rocker", child="rocker", at_parent=(0.5, 0.0))
        loop = Loop(bodies=("coupler", "rocker"), at=((0.5, 0.0), (0.4, 0.0)))
        start = {"crank": 1.0, "elbow": -0.6, "rocker": 1.5}
    else:
        last = Joint(name="rocker", parent="coupler", child="rocker", at_parent=(0.5, 0.0))
        loop = Loop(bodies=("rocker", "ground"), at=((0.4, 0.0), (0.5, 0.0)))
        start = {"crank": 1.0, "elbow": -0.6, "rocker": -2.0}
    return Linkage(
        body=(rod("crank", 0.2), rod("coupler", 0.5), rod("rocker", 0.4)),
        joint=(crank, elbow, last),
        loop=(loop,),
        gravity=(0.0, -9.81),
        operational_point=OperationalPoint(body="coupler", at=(0.25, 0.0)),
        start=start,
        start_velocity={"crank": 12.0},
    )


def moved(linkage, end):
    """The block at `end`, the largest closure error on the way, and the change of the energy."""
    mechanism, h = Mechanism(integrator="dormand-prince-8"), 1 / 512
    block = Running(virtual_mechanism(linkage, mechanism, step_s=h))
    worst, before = 0.0, block.y["energy"]
    for _ in range(round(end / h)):
        block.step(h)
        worst = max(worst, block.y["closure_error"])
    return block, worst, block.y["energy"] - before


@pytest.mark.parametrize("cut", ["middle", "ground"])
def test_crank_rocker_through_its_turns(cut):
    """1 s at 12 rad/s: angles are counted on, not wrapped."""
    block, worst, gained = moved(four_bar(cut), 1.0)
    assert abs(block.state["q"][0]) > 2 * np.pi
    assert worst < 1e-14
    assert abs(gained) < 1e-9


def test_other_branch_from_the_start_pose():
    """The rocker below: the mirror image, in the mirrored field, moves as its mirror."""
    up = four_bar()
    down = replace(
        up,
        gravity=(0.0, 9.81),
        start={name: -value for name, value in up.start.items()},
        start_velocity={"crank": -12.0},
    )
    above, below = moved(up, 0.25)[0], moved(down, 0.25)[0]
    np.testing.assert_allclose(below.x, -above.x, atol=1e-9)


def test_a_redundant_loop():
    """A second closure at the same pivot changes nothing."""
    linkage = four_bar()
    again = Loop(bodies=("rocker", "coupler"), at=((0.4, 0.0), (0.5, 0.0)))
    twice = moved(replace(linkage, loop=(*linkage.loop, again)), 0.25)[0]
    once = moved(linkage, 0.25)[0]
    np.testing.assert_allclose(twice.x, once.x, atol=1e-11)
