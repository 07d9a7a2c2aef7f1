"""Joint limits against closed forms and Appendix A by hand: energies after an impact, loops."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.contact.joint_limits import damping_ratio
from hapticlink.components.specs.linkage import Limits
from hapticlink.orchestrator import open_scene
from studies.report import appendix_a
from tests.blocks import RATES, errors, order, running, state_after
from tests.components.contact import piecewise
from tests.mechanisms import five_bar, one_body, rod


def arm(limits, rate=2.0, **linkage):
    """A uniform rod of 1 m and 1 kg on a pivot that turns at 2 rad/s."""
    return one_body(rod("rod", 1.0), at=(1.0, 0.0), rate=rate, limits=limits, **linkage)


@pytest.mark.parametrize("restitution", [0.01, 0.1, math.exp(-2), 0.3, 0.7, 0.99, 1.0])
def test_the_damping_ratio_gives_the_restitution(restitution):
    """x'' + 2 z x' + x = 0 from x = 0, x' = -1 until x + 2 z x' = 0."""
    z = damping_ratio(restitution)
    y, events = piecewise.solve(
        lambda y, F: np.array([y[1], F[0]]),
        [lambda y: (y[0], y[1], 1.0, 2 * z)],
        np.array([1e-3, -1.0]),
        20 * (1 + z**2),
    )
    assert events == 2
    assert y[1] == pytest.approx(restitution, rel=1e-9)


@pytest.mark.parametrize("restitution", [0.05, 0.5, 0.8, 1.0])
def test_a_joint_turns_back_with_the_energy_of_its_restitution(restitution):
    limits = Limits(lower=-0.2, upper=0.3, stiffness=2000.0, restitution=restitution)
    block = running(arm(limits))
    before = block.y["energy"]
    assert state_after(block, 1000, 0.3)[1] == pytest.approx(-2.0 * restitution, rel=1e-4)
    assert block.y["energy"] == pytest.approx(restitution**2 * before, rel=2e-4)
    later = state_after(block, 1000, 0.6 / (2.0 * restitution))  # at the other end
    assert later[1] == pytest.approx(2.0 * restitution**2, rel=2e-4)


def test_a_damping_that_is_given_acts_as_that_of_its_restitution():
    """b = 2 z sqrt(k I), I = 1/3 kg.m2 of the rod about its pivot."""
    ends = {"lower": -0.2, "upper": 0.3, "stiffness": 2000.0}
    laws = {"restitution": 0.5}, {"damping": 2 * damping_ratio(0.5) * math.sqrt(2000.0 / 3)}
    turned, damped = (state_after(running(arm(Limits(**ends, **law))), 1000, 0.3) for law in laws)
    assert damped == pytest.approx(turned, rel=1e-9)


@pytest.mark.parametrize("integrator", ["heun", "rk4"])
def test_a_turn_at_a_limit_has_the_order_of_the_method(integrator):
    limits = Limits(upper=0.3, stiffness=2000.0, restitution=0.6)
    block, largest = running(arm(limits), integrator=integrator), []
    for rate in RATES:
        found = []
        for share in np.linspace(0, 1, 5)[:-1]:
            block.put(q=0.1 + 2.0 * share / rate, qd=2.0)
            found.append(state_after(block, rate, 0.25)[1] + 1.2)
        largest.append(np.abs(found).max())
    assert order(largest) > {"heun": 1.7, "rk4": 3.7}[integrator]


def test_a_joint_comes_to_rest_on_its_limit():
    """m g l/2 = k (c_lower - c) for a rod that leans on its lower limit, horizontal."""
    limits = Limits(lower=0.0, stiffness=500.0, restitution=0.3)
    block = running(arm(limits, rate=0.0, gravity=(0.0, -9.81)))
    q, qd = state_after(block, 500, 3.0)
    assert q == pytest.approx(-9.81 * 0.5 * math.cos(q) / 500.0, abs=1e-9)
    assert abs(qd) < 1e-9
    turned = 1.5 * 9.81 * math.cos(q)  # what the hand feels of it holds the rod
    assert block.y["F_env"] @ [-math.sin(q), math.cos(q), 1.0] == pytest.approx(
        turned / 3.0, rel=1e-6
    )


WRENCH = np.array([-3.0, 2.0, 0.0])
WAYS = {"elbow1": np.array([0.0, 1.0, 0.0, 0.0]), "cut": np.array([1.0, 1.0, -1.0, -1.0])}


def limited(joint, limits):
    """The five-bar with limits on a joint, or on its cut joint."""
    linkage = five_bar()
    if joint == "cut":
        return replace(linkage, loop=(replace(linkage.loop[0], limits=limits),))
    joints = [replace(j, limits=limits) if j.name == joint else j for j in linkage.joint]
    return replace(linkage, joint=tuple(joints))


def closed_inertia(q, way):
    """1/(c D^-1 (1 - W' (W D^-1 W')^-1 W D^-1) c') of Appendix A."""
    return 1 / (way @ appendix_a.joint_mobility(q) @ way)


def kinetic(y):
    return 0.5 * y[4:] @ appendix_a.D(y[:4]) @ y[4:]


@pytest.mark.parametrize("joint", ["elbow1", "cut"])
def test_limits_in_a_loop_against_appendix_a(joint):
    """On a joint of the tree, and on the cut joint that closes the loop."""
    way, free = WAYS[joint], running(five_bar())
    start = free.state["q"]
    free.set(F_hand=WRENCH)
    state_after(free, 1000, 0.08)
    limit, up = way @ free.state["q"], way @ free.state["qd"] > 0
    stiffness, restitution = 60.0, 0.5
    law = {"upper" if up else "lower": limit, "stiffness": stiffness, "restitution": restitution}
    linkage = limited(joint, Limits(**law))
    sign = -1 if up else 1
    z = damping_ratio(restitution)

    def side(y):
        b = 2 * z * math.sqrt(stiffness * closed_inertia(y[:4], way))
        return sign * (way @ y[:4] - limit), sign * (way @ y[4:]), stiffness, b

    def rhs(y, F):
        Q = appendix_a.J_h(y[:4]).T @ WRENCH + sign * way * F[0]
        return np.r_[y[4:], appendix_a.solution(y[:4], y[4:], Q)[0]]

    exact, events = piecewise.solve(rhs, [side], np.r_[start, np.zeros(4)], 0.16)
    assert events == 2
    coarse, fine = errors(lambda: running(linkage).set(F_hand=WRENCH), exact, 0.16, (1000, 2000))
    assert coarse < 1e-4
    assert coarse / fine > 12  # order 4


def test_an_impact_takes_from_a_loop_the_energy_that_its_restitution_says():
    """(1 - e^2) m c'^2/2 for an impact that is short."""
    e, way = 0.5, WAYS["elbow1"]
    q = running(five_bar()).state["q"]
    linkage = limited("elbow1", Limits(upper=q[1] + 1e-4, stiffness=1e6, restitution=e))
    block = running(replace(linkage, start_velocity={"elbow1": 3.0}))
    before = np.concatenate([block.state["q"], block.state["qd"]])
    after = state_after(block, 200_000, 4e-4)
    lost = 0.5 * (1 - e**2) * closed_inertia(q, way) * before[5] ** 2
    assert kinetic(before) - kinetic(after) == pytest.approx(lost, rel=2e-3)
    assert after[5] == pytest.approx(-e * before[5], rel=2e-3)


def test_a_slot_ends_at_its_limit():
    """The pin of `scotch-yoke` at .05 sin(crank) along its slot: with one degree of freedom left,
    e^2 of the energy."""
    e, linkage = 0.6, open_scene.load("scotch-yoke").linkage
    limits = Limits(upper=0.05 * math.sin(1.05), stiffness=1e6, restitution=e)
    linkage = replace(linkage, loop=(replace(linkage.loop[0], limits=limits),))
    block = running(linkage)
    before = block.y["energy"]
    state_after(block, 20_000, 0.02)
    assert block.state["qd"][0] < 0
    assert block.y["q"][0] < 1.05
    assert block.y["energy"] == pytest.approx(e**2 * before, rel=2e-3)
