"""The point in the hand, as it changes: against the closed form of two links, against mechanisms
that have the other point from the start, and by the energy that the wrench brings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.components.dynamics import grasp
from hapticlink.components.specs.bodies import Body
from hapticlink.components.specs.linkage import (
    Directions,
    GraphicsCopy,
    Joint,
    Linkage,
    Mechanism,
    OperationalPoint,
)
from hapticlink.orchestrator import open_scene
from tests.blocks import Running, virtual_environment, virtual_mechanism

H = 1 / 512
M, INERTIA, C, L = (0.6, 0.4), (3e-3, 2e-3), 0.1, 0.25
POINTS = {
    "inner": OperationalPoint(body="upper", at=(0.15, 0.02)),
    "outer": OperationalPoint(body="lower", at=(0.2, 0.0)),
}
ARM = Linkage(
    body=tuple(
        Body(name=name, mass=m, inertia=i, center=(C, 0.0))
        for name, m, i in zip(("upper", "lower"), M, INERTIA, strict=True)
    ),
    joint=(
        Joint(name="shoulder", child="upper"),
        Joint(name="elbow", parent="upper", child="lower", at_parent=(L, 0.0)),
    ),
    operational_point="inner",
    points=POINTS,
    start={"shoulder": 0.3, "elbow": 0.7},
)
WRENCH = np.array([0.5, 0.2, 0.01])


def five_bar(held):
    linkage = open_scene.load("closed-loop-ideal").linkage
    points = {
        "middle": linkage.operational_point,
        "other": OperationalPoint(body="link4", at=(0.02, 0.003)),
    }
    return replace(linkage, operational_point=held, points=points)


def alone(linkage, name):
    """The linkage with that point and no other."""
    return replace(linkage, operational_point=linkage.points[name], points={})


def choose(running, number):
    """Sets the parameter of the point that is asked for."""
    names = [n for v in running.component.parameters for n in v.names]
    running.p[names.index(grasp.POINT)] = number


def two_links(t, state, changes_at):
    """The equations of motion of two links (any textbook's, without gravity), under the wrench on
    the first link until a time and then on the second."""
    q1, q2, w1, w2 = state
    a = INERTIA[0] + INERTIA[1] + M[0] * C**2 + M[1] * (L**2 + C**2)
    b, d = M[1] * L * C, INERTIA[1] + M[1] * C**2
    D = np.array([[a + 2 * b * np.cos(q2), d + b * np.cos(q2)], [d + b * np.cos(q2), d]])
    s = b * np.sin(q2)
    coriolis = np.array([-s * w2 * (2 * w1 + w2), s * w1**2])

    def lever(angle, at):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([-s * at[0] - c * at[1], c * at[0] - s * at[1]])

    if t < changes_at:
        Q = np.array([lever(q1, POINTS["inner"].at) @ WRENCH[:2] + WRENCH[2], 0.0])
    else:
        elbow, tip = lever(q1, (L, 0.0)), lever(q1 + q2, POINTS["outer"].at)
        Q = np.array([(elbow + tip) @ WRENCH[:2], tip @ WRENCH[:2]]) + WRENCH[2]
    return [w1, w2, *np.linalg.solve(D, Q - coriolis)]


@pytest.mark.parametrize("integrator", ["rk4", "passive-midpoint"])
def test_from_a_change_on_the_wrench_acts_on_the_other_link(integrator):
    linkage, substeps = ARM, {"rk4": 1, "passive-midpoint": 20}[integrator]
    mechanism = Mechanism(integrator=integrator, substeps=substeps)
    running = Running(virtual_mechanism(linkage, mechanism, step_s=H))
    running.set(F_hand=WRENCH)
    before = work = 0.0
    for k in range(256):
        choose(running, 1 if k < 128 else 2)
        path = running.y["path"]
        running.step(H)
        work += WRENCH @ (running.y["path"] - path)
        before = running.y["energy"]
        assert abs(before - work) < 1e-7  # at the change, too
    state, changes_at = [0.3, 0.7, 0.0, 0.0], 128 * H
    for span in ((0.0, changes_at), (changes_at, 2 * changes_at)):
        middle = np.mean(span)  # the right side is smooth within a span
        found = solve_ivp(
            lambda t, y, m=middle: two_links(m, y, changes_at), span, state, rtol=1e-11, atol=1e-12
        )
        state = found.y[:, -1]
    tolerance = {"rk4": 1e-8, "passive-midpoint": 1e-6}[integrator]
    moved = [*running.state["q"], *running.state["qd"]]
    np.testing.assert_allclose(moved, state, atol=tolerance)


@pytest.mark.parametrize(
    ("linkage", "names"), [(ARM, ("inner", "outer")), (five_bar("middle"), ("middle", "other"))]
)
def test_a_changed_point_is_that_of_a_mechanism_that_has_it_from_the_start(linkage, names):
    parts = Mechanism(directions=True), Directions()
    changed = Running(virtual_mechanism(linkage, *parts, step_s=H))
    first, second = (Running(virtual_mechanism(alone(linkage, n), *parts, step_s=H)) for n in names)
    force = {"F_hand": WRENCH, "F_drift": np.array([0.1, -0.2, 0.003])}
    for peer, number in ((first, 1), (second, 2)):
        choose(changed, number)
        peer.put(**{n: changed.state[n] for n in ("q", "qd")})
        changed.set(**force)
        peer.set(**force)
        for _ in range(60):
            changed.step(H)
            peer.step(H)
            same = changed.y | {"x": changed.y["x"] - changed.y["x_offset"]}
            for name, value in peer.y.items():
                # The motion bit for bit; in other outputs CasADi cancels terms in one graph alone.
                size = 0.0 if name in ("q", "qd") else 1e-13 * np.abs(value).max()
                np.testing.assert_allclose(same[name], value, rtol=0, atol=size, err_msg=name)
            assert changed.y["held_point"] == number


def coupled():
    """A five-bar with a device and a graphics copy, pushed for a while."""
    block = virtual_mechanism(
        five_bar("middle"), Mechanism(), step_s=H, coupled=True, followed=True
    )
    running = Running(block).set(F_hand=WRENCH / 10, x_handle=np.zeros(3))
    for _ in range(50):
        running.step(H)
    return running


def test_a_hand_that_lets_go_acts_on_nothing_until_the_copy_is_ready_and_begins_relaxed():
    running = coupled()
    before, energy = running.y, running.y["energy"]
    choose(running, 2)
    for _ in range(20):
        running.step(H)
        y = running.y
        assert (y["held_point"], y["asked_point"]) == (0, 2)
        for name in ("x", "path"):
            np.testing.assert_array_equal(y[name], before[name])
        assert not y["v"].any()
        assert abs(y["energy"] - energy) < 1e-12
    handle = np.array([0.031, -0.02, 0.4])
    running.set(ready_point=2, x_handle=handle, F_hand=np.zeros(3))
    x_2 = np.array(
        Running(virtual_mechanism(alone(five_bar("middle"), "other"), Mechanism(), step_s=H))
        .put(q=running.state["q"], qd=running.state["qd"])
        .y["x"]
    )
    np.testing.assert_array_equal(running.y["x"], before["x"])
    running.step(H)
    y = running.y
    np.testing.assert_allclose(y["x_offset"], handle - x_2, atol=1e-15)
    moved = y["x"] - y["x_offset"] - x_2
    np.testing.assert_allclose(y["x"] - handle, moved, atol=1e-15)
    np.testing.assert_allclose(y["path"] - before["path"], moved, atol=1e-15)
    assert np.abs(moved).max() > 1e-6


def test_without_a_copy_a_coupled_hand_lets_go_for_a_step():
    block = virtual_mechanism(five_bar("middle"), Mechanism(), step_s=H, coupled=True)
    running, held = Running(block), []
    choose(running, 2)
    for _ in range(3):
        running.step(H)
        held.append(running.y["held_point"])
    assert held == [0, 2, 2]


def test_no_point_is_held_where_none_is_asked_for():
    running = Running(virtual_mechanism(ARM, Mechanism(), step_s=H)).set(F_hand=WRENCH)
    choose(running, 0)
    for _ in range(10):
        running.step(H)
    assert not running.state["qd"].any()


def test_the_copy_counts_directions_at_another_point_without_hysteresis():
    """A point on the first link moves on a circle: two directions are constrained there, and none
    of those of the second link's point."""
    copy, parts = GraphicsCopy(), Directions(rank_tolerance=1e-3, hysteresis=1e6)
    running = Running(virtual_environment(ARM, copy, parts, frame_s=1 / 30))
    counts = []
    for asked in (1, 2, 1):
        running.set(asked_point=asked, q_ref=[0.3, 0.7])
        running.step(1 / 30)
        counts.append((running.y["ready_point"], running.y["n_constraints"]))
    assert counts == [(1, 2), (2, 1), (1, 2)]
