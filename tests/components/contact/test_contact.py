"""Contacts against closed forms: gaps, bounces, no pulling, and what the hand feels of them."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic_core import to_jsonable_python
from scipy.optimize import minimize_scalar

from hapticlink.components.contact.broad_phase import near, out_of_reach, reach
from hapticlink.components.dynamics.equivalent_wrench import equivalent_wrench
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.contacts import Contacts, ContactsOfAllPairs, Disc, Polygon
from hapticlink.components.specs.linkage import Body, Directions, GraphicsCopy
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import Running, once, running, virtual_environment
from tests.mechanisms import five_bar, one_body

R, LENGTH = 0.05, 0.4
NOISE = 1e-17 * np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, 0.5], [0.0, 0.5, -1.0]])
SQUARE = ((0.1, -0.3), (0.7, -0.1), (0.5, 0.5), (0.0, 0.3))


def loose(capsule, start=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), center=None, gravity=None):
    """A free capsule of 2 kg."""
    body = Body(name="bar", mass=2.0, inertia=0.03, center=center, radius=R, capsule=capsule)
    return one_body(body, start=start, rate=rate, gravity=gravity, type="free")


BAR, POINT = ((0.0, 0.0), (LENGTH, 0.0)), ((0.0, 0.0),)
DISC = {"disc": (Disc(center=(0.3, 0.2), radius=0.1),)}
POLYGON = {"polygon": (Polygon(corners=SQUARE),)}
WALLS = {"enclosure": SQUARE[::-1]}


@once
def among(contacts, capsule=BAR):
    """A capsule among these, which a test puts somewhere."""
    return running(loose(capsule), contacts)


def points(pose):
    x, y, theta = pose
    return lambda s: np.array([x, y]) + s * LENGTH * np.array([math.cos(theta), math.sin(theta)])


def to_segment(point, a, b):
    a, b = np.array(a), np.array(b)
    s = np.clip(np.dot(point - a, b - a) / np.dot(b - a, b - a), 0, 1)
    return np.linalg.norm(point - a - s * (b - a))


def plane_distances(point):
    """Signed distance to each edge of the square, positive outside."""
    for a, b in zip(SQUARE, SQUARE[1:] + SQUARE[:1], strict=True):
        d = np.subtract(b, a) / math.dist(a, b)
        yield d[1] * (point[0] - a[0]) - d[0] * (point[1] - a[1])


poses = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-math.pi, math.pi))


def nearest(distance):
    """Least value over the segment of a convex function: a point's distance to a convex set."""
    inside = minimize_scalar(distance, bounds=(0, 1), method="bounded", options={"xatol": 1e-9})
    return min(inside.fun, distance(0.0), distance(1.0))


@given(poses)
@example((0.25, 0.2, 0.0))  # through the centre
def test_gap_of_disc_and_capsule(pose):
    bar = among(DISC)
    bar.put(q=pose)
    at = points(pose)
    exact = nearest(lambda s: np.linalg.norm(at(s) - (0.3, 0.2))) - R - 0.1
    assert bar.y["contact_gap"] == pytest.approx(exact, abs=1e-8)


@given(poses)
def test_gap_of_polygon_and_capsule(pose):
    at = points(pose)
    edges = list(zip(SQUARE, SQUARE[1:] + SQUARE[:1], strict=True))

    def distance(s):
        if max(plane_distances(at(s))) < 0:
            return 0.0
        return min(to_segment(at(s), *edge) for edge in edges)

    exact = nearest(distance)
    bar = among(POLYGON)
    bar.put(q=pose)
    if exact > 1e-6:  # the capsule's axis stays outside
        assert bar.y["contact_gap"] == pytest.approx(exact - R, abs=1e-7)


@given(poses)
def test_gap_to_the_walls_of_an_enclosure(pose):
    at = points(pose)
    bar = among(WALLS)
    bar.put(q=pose)
    exact = min(-max(plane_distances(at(s))) for s in (0, 1)) - R
    assert bar.y["contact_gap"] == pytest.approx(exact, abs=1e-12)


FLOOR = {"enclosure": ((-5.0, 0.0), (5.0, 0.0), (5.0, 5.0), (-5.0, 5.0))}


def falling(**contacts):
    ball = loose(POINT, gravity=(0.0, -9.81), start=(0.0, R + 0.02, 0.3))
    return running(ball, FLOOR | contacts)


def test_an_undamped_bounce_has_the_depth_and_the_energy_of_a_spring():
    """m v^2/2 + m g d = k d^2/2 at the deepest point; all of it comes back."""
    ball, start = falling(damping=0.0), 2.0 * 9.81 * (R + 0.02)
    gaps = []
    for _ in range(1750):
        ball.step(1e-4)
        gaps.append(ball.y["contact_gap"])
        assert ball.y["energy"] == pytest.approx(start, rel=1e-4)
    weight, k = 2.0 * 9.81, 15000.0
    depth = (weight + math.sqrt(weight**2 + 2 * k * weight * 0.02)) / k
    assert -min(gaps) == pytest.approx(depth, rel=1e-3)
    assert max(gaps[1000:]) == pytest.approx(0.02, rel=1e-2)


def test_a_damped_bounce_never_gains_energy_and_comes_to_rest_on_its_spring():
    ball, before = falling(), math.inf
    for _ in range(6000):
        ball.step(2e-4)
        energy = ball.y["energy"]
        assert energy <= before + 1e-6
        before = energy
    assert ball.y["contact_gap"] == pytest.approx(-2.0 * 9.81 / 15000.0, rel=1e-3)
    assert ball.y["F_env"] == pytest.approx([0, 2.0 * 9.81, 0], abs=1e-2)


@given(st.floats(-0.3, 0.05), st.floats(-2, 2))
def test_contacts_push_and_never_pull(height, speed):
    ball = among(FLOOR, POINT)
    ball.put(q=(0.0, R + height, 0.0), qd=(0.0, speed, 0.0))
    height = (R + height) - R  # as rounded
    exact = max(0.0, -15000 * height - 300 * speed) if height < 0 else 0.0
    np.testing.assert_allclose(ball.y["qdd"], (0, exact / 2.0, 0), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("omega", [-1.0, 0.02, 1.0])
def test_damping_takes_the_velocity_of_the_touching_point(omega):
    """The end of a bar 1 mm deep in a disc, while the bar turns about its centre of mass at its
    other end: k depth - b omega l, and no pull."""
    disc = Disc(center=(LENGTH, -(R + 0.1 - 1e-3)), radius=0.1)
    F = max(0.0, 15000.0 * 1e-3 - 300.0 * omega * LENGTH)
    qdd = running(loose(BAR, rate=(0.0, 0.0, omega)), {"disc": (disc,)}).y["qdd"]
    np.testing.assert_allclose(qdd, (0.0, F / 2.0, LENGTH * F / 0.03), rtol=1e-9, atol=1e-9)


def shaped():
    """The report's five-bar with capsules of 3 mm."""
    linkage = five_bar()
    bodies = (
        replace(body, radius=0.003, capsule=((0.0, 0.0), (length, 0.0)))
        for body, length in zip(linkage.body, L, strict=True)
    )
    return replace(linkage, body=tuple(bodies))


def link4(q, s):
    """World position of the share s of link 4."""
    elbow = L[2] * np.array([math.cos(q[2]), math.sin(q[2])])
    return elbow + s * L[3] * np.array([math.cos(q[2] + q[3]), math.sin(q[2] + q[3])])


def test_the_hand_feels_what_all_contacts_do_at_the_operational_point():
    """A disc under the middle of link 4: Lambda^-1 F_env is the acceleration that it causes."""
    q = running(shaped()).state["q"]
    along = link4(q, 1.0) - link4(q, 0.0)
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    disc = Disc(center=tuple(link4(q, 0.4) - 0.0125 * normal), radius=0.01)
    five = running(shaped(), {"disc": (disc,)}).put(q=q)
    force = 15000 * 0.0005 * normal
    assert five.y["contact_gap"] == pytest.approx(-0.0005, abs=1e-12)

    e = 1e-6
    J_contact = np.array(
        [(link4(q + e * d, 0.4) - link4(q - e * d, 0.4)) / (2 * e) for d in np.eye(4)]
    ).T
    kept, J_h = appendix_a.joint_mobility(q), appendix_a.J_h(q)
    caused = J_h @ kept @ J_contact.T @ force
    Lambda_inv = J_h @ kept @ J_h.T
    F_env = five.y["F_env"]
    np.testing.assert_allclose(Lambda_inv @ F_env, caused, rtol=1e-7)
    free = five.y["a_bias"]
    np.testing.assert_allclose(J_h @ five.y["qdd"], free + caused, rtol=1e-7)
    # Least norm in the scaled metric: nothing along the constrained direction.
    S = np.diag([1, 1, np.mean(L)])
    constrained = np.linalg.eigh(S @ Lambda_inv @ S)[1][:, 0]
    assert constrained @ np.linalg.solve(S, F_env) == pytest.approx(0, abs=1e-9)


def test_geometry_found_by_the_graphics_block_gives_the_same_forces_at_its_pose():
    obstacles = {
        "enclosure": ((-0.02, -0.05), (0.0505, -0.05), (0.0505, 0.05), (-0.02, 0.05)),
        "disc": (Disc(center=(0.03, -0.0125), radius=0.01),),
        "polygon": (Polygon(corners=((0.01, 0.035), (0.03, 0.02), (0.03, 0.05))),),
    }
    obstacles["margin"] = 0.1
    here, held = (running(shaped(), obstacles | {"detection": d}) for d in ("haptics", "graphics"))
    contacts = Contacts(**obstacles)
    copy = Running(virtual_environment(shaped(), GraphicsCopy(), Directions(), contacts))
    for side in (here, held):
        side.put(q=copy.state["q"])
    held.set(contacts=copy.y["contacts"])
    assert here.y["contact_gap"] < 0
    assert np.linalg.norm(here.y["F_env"]) > 1
    for name in ("F_env", "qdd", "contact_gap"):
        np.testing.assert_allclose(held.y[name], here.y[name], rtol=1e-12, atol=1e-12)


def test_what_no_link_can_reach_is_left_out():
    linkage = shaped()
    contacts = Contacts(
        disc=(Disc(center=(0.03, 0.0), radius=0.01), Disc(center=(0.09, 0.0), radius=0.02))
    )
    assert reach(linkage, "link4") == ((0.0, 0.0), pytest.approx(L[2] + L[3] + 0.003))
    assert {(p.body, p.obstacle) for p in out_of_reach(linkage, contacts)} == {
        ("link1", "disc2"),
        ("link3", "disc2"),
    }
    assert len(near(linkage, contacts)) == 8 - 2


def test_contacts_on_a_locked_hand_are_not_felt():
    """Lambda^-1 = 0 but for rounding, of an open linkage of 1/kg: no wrench moves what is locked,
    and none is the least."""
    args = [ca.SX.sym(name, *shape) for name, shape in (("L", (3, 3)), ("a", (3, 1)))]
    wrench = equivalent_wrench(PLANE, args[0], ca.SX.eye(3), args[1], ca.SX(0.1))
    f = ca.Function("wrench", args, [wrench])
    assert not np.array(f(NOISE, (1e-16, -1e-16, 3e-16))).any()
    moving = np.array(f(np.diag([0.5, 0, 0]) + NOISE, (1.0, 1e-16, 0.0))).ravel()
    np.testing.assert_allclose(moving, [2.0, 0, 0], atol=1e-12)


def test_blocks_with_all_pairs_are_fmus_of_their_own():
    """The settings are what the cache of FMUs tells them apart by."""
    few = Contacts(stiffness=2e4)
    assert to_jsonable_python(few) != to_jsonable_python(ContactsOfAllPairs(**vars(few)))
