"""A four-bar keeps its energy wherever its loop is cut, and moves on either branch as its mirror
image."""

from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.specs.linkage import Loop
from tests.blocks import running
from tests.mechanisms import four_bar

TURNING = four_bar(rate=12.0)


def moved(linkage, end):
    """The block at `end`, the largest closure error on the way, and the change of the energy."""
    block = running(linkage, integrator="dormand-prince-8")
    largest, before = 0.0, block.y["energy"]
    for _ in range(round(end * 512)):
        block.step(1 / 512)
        largest = max(largest, block.outputs("closure_error")["closure_error"])
    return block, largest, block.y["energy"] - before


@pytest.mark.parametrize("cut", ["middle", "ground"])
def test_crank_rocker_through_its_turns(cut):
    """1 s at 12 rad/s: angles are counted on, not wrapped."""
    block, largest, gained = moved(four_bar(cut=cut, rate=12.0), 1.0)
    assert abs(block.state["q"][0]) > 2 * np.pi
    assert largest < 1e-14
    assert abs(gained) < 1e-9


def test_other_branch_from_the_start_pose():
    """The rocker below: the mirror image, in the mirrored field, moves as its mirror."""
    start = {name: -value for name, value in TURNING.start.items()}
    down = replace(TURNING, gravity=(0.0, 9.81), start=start, start_velocity={"crank": -12.0})
    above, below = moved(TURNING, 0.25)[0], moved(down, 0.25)[0]
    np.testing.assert_allclose(below.x, -above.x, atol=1e-9)


def test_a_redundant_loop():
    """A second closure at the same pivot changes nothing."""
    again = Loop(bodies=("rocker", "coupler"), at=((0.4, 0.0), (0.5, 0.0)))
    twice = moved(replace(TURNING, loop=(*TURNING.loop, again)), 0.25)[0]
    np.testing.assert_allclose(twice.x, moved(TURNING, 0.25)[0].x, atol=1e-11)
