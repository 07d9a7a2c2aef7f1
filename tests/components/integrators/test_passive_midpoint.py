"""The passive midpoint method: no step gains more energy than its inputs put in, whatever the
linkage, the step size and the forces; and its order, against SciPy."""

from dataclasses import replace
from types import MappingProxyType

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticlink.components.integrators import METHODS
from hapticlink.components.integrators.base import Integrator
from hapticlink.components.integrators.passive_midpoint import PassiveMidpoint
from hapticlink.components.specs.drives import ConstantDrive, ProfileDrive
from hapticlink.components.specs.linkage import Body, Spring
from hapticlink.orchestrator.open_scene import load
from tests import blocks
from tests.blocks import Running, advance
from tests.mechanisms import five_bar, linkages, one_body, terms


def running(linkage, **settings):
    return blocks.running(
        linkage, **({"integrator": "passive-midpoint", "step_s": None} | settings)
    )


def gains(block, rng, steps, size=1.0, longest=0.2):
    """E_{k+1} - E_k - F_k . (x_{k+1} - x_k) of each step, and the energies in play."""
    found, names = [], ("x", "energy")
    before = block.outputs(*names)
    for _ in range(steps):
        F = size * rng.normal(size=3) * 10 ** rng.uniform(-3, 2)
        block.set(F_hand=F)
        block.step(longest * 10 ** rng.uniform(-3, 0))
        after = block.outputs(*names)
        work = F @ (after["x"] - before["x"])
        found.append((after["energy"] - before["energy"] - work, abs(before["energy"]) + abs(work)))
        before = after
    return np.array(found).T


@st.composite
def with_forces(draw):
    """A random linkage with gravity, springs with and without a length, friction and limits."""
    linkage, _, qd = draw(linkages(max_bodies=6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))

    def some(scale):
        return float(scale * 10 ** rng.uniform(-1, 3)) if rng.random() < 0.5 else None

    names = [body.name for body in linkage.body]
    joints = tuple(
        replace(j, stiffness=some(1.0), damping=some(0.01), friction=some(0.1))
        for j in linkage.joint
    )
    springs = tuple(
        Spring(
            bodies=("ground", str(rng.choice(names))),
            at=(tuple(rng.uniform(-1, 1, 2)), (0.1, 0.0)),
            stiffness=float(10 ** rng.uniform(0, 6)),
            damping=some(0.1),
            length=0.3 if rng.random() < 0.5 else None,
        )
        for _ in range(rng.integers(0, 3))
    )
    free = {j.name: v for j, v in zip(joints, 5 * qd, strict=True)} if not linkage.loop else {}
    weight = tuple(rng.uniform(-10, 10, 2)) if rng.random() < 0.7 else None
    return replace(linkage, joint=joints, spring=springs, gravity=weight, start_velocity=free), rng


@settings(max_examples=15)
@given(with_forces())
def test_no_step_makes_energy(made):
    linkage, rng = made
    block = running(linkage)
    gained, scale = gains(block, rng, 60)
    assert np.isfinite(block.x).all()
    assert (gained <= 1e-11 * (scale + scale.max() * 1e-3)).all()


@pytest.mark.parametrize("scene", ["obstacles", "enclosure", "push-disc", "two-hands"])
def test_neither_do_contacts_limits_and_further_hands(scene):
    """Contacts of the shipped scenes at the rates of a graphics loop, with a wrench that varies."""
    read = load(scene)
    contacts = read.contacts and vars(read.contacts)
    block, rng = running(read.linkage, contacts=contacts), np.random.default_rng(3)
    gained, scale = gains(block, rng, 300, np.array([0.3, 0.3, 0.01]), longest=0.1)
    assert (gained <= 1e-11 * (scale + scale.max() * 1e-3)).all()
    assert block.y.get("closure_error", 0.0) < 1e-3


@pytest.mark.parametrize(
    "drive", [ConstantDrive(effort=2.0), ProfileDrive(table=[[0.0, 2.0], [1.0, 2.0]])]
)
def test_a_drive_may_put_energy_in(drive):
    """A constant torque on an axle: its work, and no more."""
    block = running(one_body(Body(name="disc", mass=1.0, inertia=0.5), drive=drive))
    advance(block, 1.0, 20)
    assert block.y["energy"] == pytest.approx(0.5 * 0.5 * 4.0**2, rel=1e-12)  # w = 2 t/.5, t = 1


def accelerations(linkage):
    """qdd of D qdd + C qd = Q + W' lambda, W qdd + w = 0 by NumPy, with Q = -2 q - 0.002 qd."""
    at = terms(linkage, "D", "C_qd", "W", "w")

    def rate(_, x):
        q, qd = np.split(x, 2)
        D, C_qd, W, w = at(q, qd)
        m = len(W)
        system = np.block([[D, W.T], [W, np.zeros((m, m))]])
        Q = -0.02 * q - 2e-4 * qd
        return np.concatenate(
            [qd, np.linalg.solve(system, [*(Q - C_qd.ravel()), *-w.ravel()])[: len(q)]]
        )

    return rate


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("varying", [False, True])
def test_order_two(closed, varying):
    """Five-bar with joint springs and dampers, loops closed or cut; steps of one size or of two."""
    linkage = five_bar()
    linkage = replace(
        linkage,
        loop=linkage.loop if closed else (),
        joint=tuple(replace(j, stiffness=0.02, damping=2e-4) for j in linkage.joint),
        start_velocity={"shoulder1": 4.0, "shoulder2": -2.0},
    )
    component = running(linkage).component
    start = Running(component).x[:8]
    exact = solve_ivp(accelerations(linkage), (0, 0.5), start, "DOP853", rtol=1e-11, atol=1e-13)

    def error(steps):
        block = Running(component)
        for k in range(steps):
            block.step(0.5 / steps * ((0.5, 1.5)[k % 2] if varying else 1))
        assert block.state["stops"] == 0
        return np.linalg.norm(block.x[:8] - exact.y[:, -1])

    coarse, fine = error(200), error(400)
    assert fine < 2e-2
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.25)


def test_a_stiff_spring_keeps_its_energy():
    """A spring of 1e8 N.m/rad at 30 Hz, where an explicit step of it has no stable size: the
    linearly implicit midpoint conserves a linear spring's energy to rounding."""
    disc = Body(name="disc", mass=1.0, inertia=1.0)
    block = running(one_body(disc, start=0.1, stiffness=1e8))
    for h in np.random.default_rng(1).uniform(0.01, 0.05, 300):
        block.step(h)
    assert block.y["energy"] == pytest.approx(0.5e6, rel=1e-9)


class Counting(Integrator):
    """A method of its own that takes the steps of passive midpoint and counts them."""

    order = 2
    counters = MappingProxyType({"steps": "steps that were taken"})

    def step(self, ode, x, u, p, t, h):
        raise NotImplementedError

    def mechanism_step(self, mechanism):
        after = PassiveMidpoint().mechanism_step(mechanism)
        return ca.vertcat(after[:-1], 1)


def test_any_method_may_use_the_terms_of_a_mechanism_and_count(monkeypatch):
    monkeypatch.setitem(METHODS, "counting", Counting())
    linkage = replace(five_bar(), start_velocity={"shoulder1": 4.0, "shoulder2": -2.0})
    own, counting = running(linkage), running(linkage, integrator="counting")
    for block in (own, counting):
        advance(block, 0.2, 100)
    assert counting.y["steps"] == counting.state["steps"] == 20
    assert np.abs(own.state["qd"]).max() > 1
    np.testing.assert_array_equal(counting.x[:8], own.x[:8])
