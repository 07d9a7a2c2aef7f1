"""Bodies that touch each other: free objects and links, against closed forms and SciPy."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from hapticlink.components.specs.bodies import uniform
from hapticlink.components.specs.contacts import Contacts, Polygon, pairs
from hapticlink.components.specs.linkage import (
    Body,
    Directions,
    GraphicsCopy,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
)
from tests import blocks
from tests.blocks import RATES, Running, errors, order, state_after, virtual_environment
from tests.components.contact import piecewise
from tests.mechanisms import one_body

K, B, G = 15000.0, 60.0, 9.81
BOX = ((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05))
FLOOR = {"enclosure": ((-9.0, 0.0), (9.0, 0.0), (9.0, 9.0), (-9.0, 9.0))}


def free(*bodies, start=None, **linkage):
    """Bodies on free joints of their names; the hand holds the first."""
    return Linkage(
        body=bodies,
        joint=tuple(Joint(name=b.name, type="free", child=b.name) for b in bodies),
        operational_point=OperationalPoint(body=bodies[0].name),
        start=start or {},
        **linkage,
    )


def block(linkage, contacts=None, **settings):
    return blocks.running(linkage, {"stiffness": K, "damping": B} | (contacts or {}), **settings)


def disc(name, mass, radius=0.05):
    return Body(name=name, mass=mass, radius=radius)


def test_two_discs_collide_with_the_restitution_of_their_reduced_mass():
    """Head-on at 1 m/s: v after by exp(-2 z acos(z)/sqrt(1 - z^2)), z = b/(2 sqrt(k mu))."""
    m1, m2 = 1.0, 3.0
    mu = m1 * m2 / (m1 + m2)
    z = B / (2 * math.sqrt(K * mu))
    e = math.exp(-2 * z * math.acos(z) / math.sqrt(1 - z**2))
    center = m1 / (m1 + m2)
    exact = np.array([center - e * m2 / (m1 + m2), center + e * m1 / (m1 + m2)])
    found = []
    for rate in RATES:
        both = block(free(disc("a", m1), disc("b", m2)))
        both.put(q=(0, 0, 0, 0.1 + 0.0123, 0, 0), qd=(1, 0, 0, 0, 0, 0))
        before = both.y["energy"]
        v = state_after(both, rate, 0.1)[6:]
        found.append(np.abs(v[[0, 3]] - exact).max())
        assert m1 * v[0] + m2 * v[3] == pytest.approx(m1, abs=1e-14)
        assert before - both.y["energy"] == pytest.approx((1 - e**2) * mu / 2, rel=1e-2)
    assert order(found) > 3.7
    assert found[1] < 1e-5


@pytest.mark.parametrize("detection", ["haptics", "graphics"])
def test_oblique_impacts_with_friction_conserve_momentum_and_angular_momentum(detection):
    """A disc, a capsule and a rounded polygon off their centres of mass, which all spin."""
    bar = Body(name="bar", mass=0.7, radius=0.02, capsule=((-0.1, 0.0), (0.08, 0.03)))
    box = Body(name="box", mass=1.3, radius=0.01, corners=BOX)
    linkage = free(disc("disc", 0.5), bar, box)
    contacts = {"friction": 0.4, "detection": detection, "margin": 0.5}
    three = block(linkage, contacts)
    start = {
        "q": (0, 0, 0, 0.13, 0.02, 1.2, 0.21, -0.01, 0.3),
        "qd": (1.5, 0.1, 9, -0.4, 0.2, -5, -1.2, 0.1, 2),
    }
    three.put(**start)
    mass = np.array([b.mass for b in linkage.body])
    inertia = np.array([b.inertia for b in linkage.body])
    centers = np.array([b.center or (0, 0) for b in linkage.body])

    def rates():
        """Of momentum and of angular momentum about the world's origin."""
        q, qd, qdd = (three.y[name].reshape(3, 3) for name in ("q", "qd", "qdd"))
        c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
        arms = np.c_[c * centers[:, 0] - s * centers[:, 1], s * centers[:, 0] + c * centers[:, 1]]
        turned = np.c_[-arms[:, 1], arms[:, 0]]
        x, a = q[:, :2] + arms, qdd[:, :2] + qdd[:, 2:] * turned - qd[:, 2:] ** 2 * arms
        return np.r_[mass @ a, mass @ (x[:, 0] * a[:, 1] - x[:, 1] * a[:, 0]) + inertia @ qdd[:, 2]]

    if detection == "graphics":
        copy = Running(
            virtual_environment(linkage, GraphicsCopy(), None, Contacts(**contacts), mobility=False)
        )
        copy.put(q=start["q"])
        three.set(contacts=copy.y["contacts"])
    energy, largest = three.y["energy"], 0.0
    for _ in range(150):
        three.step(5e-4)
        largest = max(largest, np.abs(three.y["qdd"]).max())
        np.testing.assert_allclose(rates(), 0, atol=1e-14 * largest + 1e-12)
    assert largest > 1e3
    assert three.y["energy"] < 0.9 * energy


def pendulum(body, joint, at):
    bar = Body(name=body, mass=1.0, inertia=0.02, center=(0.2, 0.0), radius=0.02, capsule=RODS)
    return bar, Joint(name=joint, child=body, at_parent=at)


RODS = ((0.0, 0.0), (0.4, 0.0))
SWING = 0.02 + 0.2**2  # kg.m2 about the pivot


def beside_a_puck(point, **linkage):
    """The pendulum, held at a point, and a free disc."""
    bar, pivot = pendulum("bar", "pivot", (0.0, 0.0))
    joints = (pivot, Joint(name="puck", type="free", child="puck"))
    return Linkage(body=(bar, disc("puck", 0.3)), joint=joints, operational_point=point, **linkage)


def test_a_link_that_pushes_a_disc():
    """A driven pendulum pushes a free disc along and off its end; the disc's rate is by hand."""
    linkage = beside_a_puck(OperationalPoint(body="bar"))
    torque, reach, t_end = 0.6, 0.07, 0.3

    def geometry(y):
        along = np.array([math.cos(y[0]), math.sin(y[0])])
        s = min(max(along @ y[1:3], 0.0), 0.4)
        away = s * along - y[1:3]
        distance = np.linalg.norm(away)
        n = away / distance  # towards the bar
        at = s * along - 0.02 * n
        turned = np.array([-at[1], at[0]])
        return distance - reach, n, turned

    def gap(y):
        g, n, turned = geometry(y)
        return g, n @ (turned * y[3] - y[4:6]), K, B

    def rhs(y, F):
        _, n, turned = geometry(y)
        return np.r_[y[3:], (torque + n @ turned * F[0]) / SWING, -n * F[0] / 0.3]

    y0 = np.array([0.0, 0.3, reach + 0.005, 0.0, 0.0, 0.0])
    exact, events = piecewise.solve(rhs, [gap], y0, t_end)
    assert events >= 3

    def start():
        both = block(linkage).put(q=(0, 0.3, reach + 0.005, 0.7))
        return both.set(F_hand=(0, 0, torque))

    without_turn = [0, 1, 2, 4, 5, 6]
    found = errors(start, np.insert(exact, [3, 6], np.nan), t_end, of=without_turn)
    assert order(found) > 3.4
    assert found[2] < 1e-5


def test_two_links_of_a_mechanism_that_touch_each_other():
    """Two pendulums that swing against each other on their flanks, by `bodies` = "all"."""
    first, pivot = pendulum("left", "pivot", (0.0, 0.0))
    second, other = pendulum("right", "other", (0.1, 0.0))
    linkage = Linkage(
        body=(first, second),
        joint=(pivot, other),
        operational_point=OperationalPoint(body="left"),
        gravity=(0.0, -G),
        start={"pivot": -2.0, "other": -1.4},
    )

    def rhs(y, F):
        accel = np.array([-G * 0.2 * math.cos(y[0]), -G * 0.2 * math.cos(y[1])])
        for i, (_, levers) in enumerate(touches(y)):
            accel += levers * F[i]
        return np.r_[y[2:], accel / SWING]

    def touches(y):
        """Each end of either rod against the other rod: gap and levers (F = force that parts)."""
        pivots = np.array([[0.0, 0.0], [0.1, 0.0]])
        along = np.array([[math.cos(a), math.sin(a)] for a in y[:2]])
        for i, j in ((0, 1), (1, 0)):
            for share in (0.0, 0.4):
                end = pivots[i] + share * along[i]
                s = min(max((end - pivots[j]) @ along[j], 0.0), 0.4)
                away = end - pivots[j] - s * along[j]
                n = away / np.linalg.norm(away)
                lever = np.zeros(2)
                on = end - pivots[i]
                lever[i] = on[0] * n[1] - on[1] * n[0]
                on = s * along[j]
                lever[j] = -(on[0] * n[1] - on[1] * n[0])
                yield np.linalg.norm(away) - 0.04, lever

    def side(i):
        def gap(y):
            g, levers = list(touches(y))[i]
            return g, levers @ y[2:4], K, B

        return gap

    t_end = 0.5
    y0 = np.array([-2.0, -1.4, 0.0, 0.0])
    exact, events = piecewise.solve(rhs, [side(i) for i in range(4)], y0, t_end)
    assert events >= 2
    found = errors(lambda: block(linkage, {"bodies": "all"}, events=2), exact, t_end)
    assert order(found) > 3
    assert found[1] < 1e-4


def table(half):
    """Its top at height 0."""
    return Polygon(corners=((-half, -0.2), (half, -0.2), (half, 0.0), (-half, 0.0)))


@pytest.mark.parametrize("floor", [None, 0.06, 0.3])
def test_a_block_rests_on_two_springs(floor):
    """Depth m g/(2 k), on the corners of the block or of what it stands on: walls, or a table of
    this half width."""
    box = Body(name="box", mass=2.0, corners=BOX)
    linkage = free(box, gravity=(0.0, -G), start={"box": (0.0, 0.05, 0.0)})
    resting = block(linkage, {"polygon": (table(floor),)} if floor else FLOOR)
    state_after(resting, 500, 2.0)
    assert resting.y["contact_gap"] == pytest.approx(-2.0 * G / (2 * K), abs=1e-9)
    np.testing.assert_allclose(resting.state["q"], (0, 0.05 - G / K, 0), atol=1e-9)


def test_a_pushed_block_slides_on_another_with_friction():
    """A force F at its height of support: a = F/m - mu g, on a block that stays where it is."""
    box, F, mu = Body(name="box", mass=2.0, corners=BOX), 9.0, 0.3
    linkage = free(box, gravity=(0.0, -G), start={"box": (0.0, 0.05 - G / K, 0.0)})
    pushed = block(linkage, {"polygon": (table(5.0),), "friction": mu}).set(F_hand=(F, 0, 0))
    before = state_after(pushed, 1000, 0.5)
    change = state_after(pushed, 1000, 0.5) - before
    assert change[3] == pytest.approx(0.5 * (F / 2.0 - mu * G), rel=1e-6)


def test_a_free_body_leaves_the_mobility_of_the_hand_as_it_is():
    alone = one_body(pendulum("bar", "pivot", (0.0, 0.0))[0], at=(0.4, 0.0))
    beside = beside_a_puck(alone.operational_point, start={"puck": (1.0, 1.0, 0.0)})
    own, both = (
        Running(virtual_environment(linkage, GraphicsCopy(), Directions())).y
        for linkage in (alone, beside)
    )
    for name in ("Lambda_inv", "P_c", "n_constraints"):
        np.testing.assert_array_equal(own[name], both[name])


def test_which_bodies_touch_each_other():
    """Of two links on one joint, a third that a loop joins to the second, and a free disc."""
    links = tuple(Body(name=n, mass=1.0, inertia=0.1, radius=0.1) for n in "abc")
    joints = (Joint(name="1", child="a"), Joint(name="2", parent="a", child="b"))
    linkage = Linkage(
        body=(*links, disc("d", 1.0)),
        joint=(*joints, Joint(name="3", child="c"), Joint(name="4", type="free", child="d")),
        loop=(Loop(bodies=("b", "c"), at=((0.1, 0.0), (0.1, 0.0))),),
        operational_point=OperationalPoint(body="a"),
    )
    found = {
        which: {p.body + p.obstacle for p in pairs(linkage, Contacts(bodies=which))}
        for which in ("free", "all", "none")
    }
    assert found == {"free": {"ad", "bd", "cd"}, "all": {"ac", "ad", "bd", "cd"}, "none": set()}


def test_inertia_of_uniform_shapes():
    """Closed forms, and a rounded polygon and a capsule as polygons of many corners."""
    assert uniform(((1.0, 2.0),), 0.3) == ((1.0, 2.0), pytest.approx(0.3**2 / 2, rel=1e-15))
    assert uniform(BOX, 0.0)[1] == pytest.approx((0.2**2 + 0.1**2) / 12, rel=1e-14)
    angle = np.linspace(0, 2 * math.pi, 3000, endpoint=False)
    for corners in (((0.1, 0.2), (1.0, 0.5), (0.3, 1.2)), ((0.0, 0.0), (1.0, 0.5))):
        around = np.concatenate([np.c_[np.cos(angle), np.sin(angle)] * 0.2 + c for c in corners])
        hull = tuple(map(tuple, around[ConvexHull(around).vertices]))
        center, inertia = uniform(hull, 0.0)
        found = uniform(corners, 0.2)
        np.testing.assert_allclose(found[0], center, rtol=1e-6)
        assert found[1] == pytest.approx(inertia, rel=1e-5)
