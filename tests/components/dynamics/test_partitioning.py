"""Loops by coordinate partitioning, against multipliers and SciPy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Loop,
    Mechanism,
    OperationalPoint,
)
from tests.blocks import Running
from tests.components import appendix_a
from tests.mechanisms import TABLE_6_1, WRENCH, five_bar

FORMULATIONS = ("multipliers", "partitioning")
M, L, J, F = TABLE_6_1["m"], TABLE_6_1["l"], TABLE_6_1["I"], (0.5,) * 4


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


def moved(linkage, end, h=1 / 512, wrench=(0.0, 0.0, 0.0), **settings):
    """The block at `end`, and the largest closure error on the way."""
    block = Running(virtual_mechanism(linkage, Mechanism(**settings), step_s=h))
    block.set(F_hand=wrench)
    worst = 0.0
    for _ in range(round(end / h)):
        block.step(h)
        worst = max(worst, block.y["closure_error"])
    return block, worst


@pytest.fixture(scope="module")
def experiment():
    """(q, qd) after the 3 s of chapter 6 on the five-bar, by DOP853."""

    def f(_, y):
        return np.r_[y[4:], appendix_a.acceleration(y[:4], y[4:], np.array(WRENCH), M, L, J, F)[0]]

    start = Running(virtual_mechanism(five_bar(), Mechanism(), step_s=1 / 512)).state["q"]
    begin = np.r_[start, np.zeros(4)]
    return solve_ivp(f, (0, 3), begin, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def test_five_bar_against_scipy(experiment):
    settings = {"formulation": "partitioning", "integrator": "dormand-prince-8"}
    block, worst = moved(five_bar(), 3.0, wrench=WRENCH, **settings)
    np.testing.assert_allclose(block.x, experiment, atol=1e-9)
    assert worst < 1e-15


@pytest.mark.parametrize("cut", ["middle", "ground"])
def test_crank_rocker_through_its_turns(cut):
    """1 s at 12 rad/s: two turns; angles are counted on, not wrapped."""
    settings = {"integrator": "dormand-prince-8"}
    block, _ = moved(four_bar(cut), 1.0, **settings)
    other, worst = moved(four_bar(cut), 1.0, formulation="partitioning", **settings)
    assert abs(other.state["q"][0]) > 2 * np.pi
    np.testing.assert_allclose(other.x, block.x, atol=1e-10)
    assert worst < 1e-15


@pytest.mark.parametrize("integrator", ["semi-implicit-euler", "linearly-implicit"])
def test_every_kind_of_method_takes_independent_coordinates(integrator):
    """First and second order towards the same motion."""
    exact, _ = moved(four_bar(), 0.125, integrator="dormand-prince-8")
    order = {"semi-implicit-euler": 1, "linearly-implicit": 2}[integrator]
    errors = []
    for h in (1 / 512, 1 / 1024):
        settings = {"integrator": integrator, "formulation": "partitioning"}
        block, worst = moved(four_bar(), 0.125, h, **settings)
        assert worst < 1e-15
        errors.append(np.abs(block.x - exact.x).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_other_branch_from_the_start_pose(formulation):
    """The rocker below: the mirror image, in the mirrored field, moves as its mirror."""
    up = four_bar()
    down = replace(
        up,
        gravity=(0.0, 9.81),
        start={name: -value for name, value in up.start.items()},
        start_velocity={"crank": -12.0},
    )
    above, _ = moved(up, 0.25, formulation=formulation)
    below, _ = moved(down, 0.25, formulation=formulation)
    np.testing.assert_allclose(below.x, -above.x, atol=1e-9)


def test_outputs_do_not_depend_on_the_formulation():
    """The multipliers too: they are those of the pose, whoever moved it there."""
    first, second = (
        virtual_mechanism(five_bar(), Mechanism(formulation=f), step_s=1 / 512)
        for f in FORMULATIONS
    )
    assert first.outputs == second.outputs
    np.testing.assert_array_equal(Running(second).y["lambda"], Running(first).y["lambda"])


def slider_crank():
    """Crank .1, rod .3 m, the block guided along a line that misses the crank's pivot by .02 m."""
    return Linkage(
        body=(rod("crank", 0.1), rod("rod", 0.3), rod("block", 0.1)),
        joint=(
            Joint(name="crank", child="crank"),
            Joint(name="big_end", parent="crank", child="rod", at_parent=(0.1, 0.0)),
            Joint(name="guide", type="prismatic", child="block", at_parent=(0.0, 0.02), axis=0.1),
        ),
        loop=(Loop(bodies=("block", "rod"), at=((0.0, 0.0), (0.3, 0.0))),),
        operational_point=OperationalPoint(body="block"),
        start={"crank": 1.0, "big_end": -1.3, "guide": 0.35},
        start_velocity={"crank": 15.0},
    )


def test_slider_crank_through_its_dead_centres():
    settings = {"integrator": "dormand-prince-8"}
    block, _ = moved(slider_crank(), 1.0, **settings)
    other, worst = moved(slider_crank(), 1.0, formulation="partitioning", **settings)
    assert abs(other.state["q"][0]) > 2 * np.pi
    np.testing.assert_allclose(other.x, block.x, atol=1e-10)
    assert worst < 1e-15


def test_a_redundant_loop():
    """A second closure at the same pivot has no coordinate left to set."""
    linkage = four_bar()
    again = Loop(bodies=("rocker", "coupler"), at=((0.4, 0.0), (0.5, 0.0)))
    twice = replace(linkage, loop=(*linkage.loop, again))
    block, _ = moved(twice, 0.25, formulation="partitioning", integrator="dormand-prince-8")
    once, _ = moved(linkage, 0.25, integrator="dormand-prince-8")
    np.testing.assert_allclose(block.x, once.x, atol=1e-11)


@pytest.mark.parametrize(
    ("settings", "what"),
    [({"stabilization": "baumgarte"}, "Baumgarte terms"), ({"held": 1 / 30}, "local_model")],
)
def test_settings_without_use_are_refused(settings, what):
    frame = settings.pop("held", None)
    mechanism = Mechanism(formulation="partitioning", **settings)
    with pytest.raises(ValueError, match=f"partitioning.*{what}"):
        virtual_mechanism(five_bar(), mechanism, step_s=1 / 512, frame_s=frame)
