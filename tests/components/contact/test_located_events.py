"""Contacts whose begin and end are located within a step: the integration method's order."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hapticlink.components.blocks import mechanism_steps
from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.contacts import Disc
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import RATES, errors, order, running, state_after
from tests.components.contact import piecewise
from tests.components.contact.test_contact import BAR, FLOOR, LENGTH, POINT, R, link4, loose, shaped

K, B, MASS, INERTIA = 15000.0, 300.0, 2.0, 0.03
LIGHT, LANDED = 60.0, 0.07  # damping of the bar's contacts, and when both have ended


def restitution(mass):
    """Rebound speed by impact speed of a mass on a spring-damper that lets go when its force is 0:
    exp(-2 z acos(z)/sqrt(1 - z^2)) (Schwager and Poeschel, Granular Matter 9, 2007, 465)."""
    z = B / (2 * math.sqrt(K * mass))
    return math.exp(-2 * z * math.acos(z) / math.sqrt(1 - z**2))


@pytest.mark.parametrize(
    ("method", "worst"),
    [("heun", 3e-3), ("linearly-implicit", 4e-4), ("rk4", 5e-7), ("dormand-prince-8", 1e-11)],
)
def test_speed_after_a_damped_impact_has_the_order_of_the_method(method, worst):
    """A ball at 1 m/s on a damped wall, which it meets at any part of a step."""
    ball, exact = running(loose(POINT), FLOOR, integrator=method), restitution(MASS)
    rates, largest = RATES[:2] if method == "dormand-prince-8" else RATES, []
    for rate in rates:
        found = []
        for share in np.linspace(0, 1, 8)[:-1]:
            ball.put(q=(0.0, R + 0.02 + share / rate, 0.3), qd=(0.0, -1.0, 0.0))
            found.append(state_after(ball, rate, 0.1)[4] - exact)
        largest.append(np.abs(found).max())
    assert order(largest, rates) > METHODS[method].order - 0.3
    assert largest[1] < worst


def bar(y, F):
    """A rod on a floor at its two ends: y = (x, y, theta) of its left end's frame and rates."""
    (_, _, theta, _, _, omega), c = y, LENGTH / 2
    arms = np.array([-c * math.cos(theta), c * math.cos(theta)])
    alpha = arms @ F / INERTIA
    lift = F.sum() / MASS - 9.81
    # of the left end: centre minus c (cos, sin)
    along = np.array([math.cos(theta), math.sin(theta)])
    across = np.array([-math.sin(theta), math.cos(theta)])
    a = np.array([0.0, lift]) - c * (alpha * across - omega**2 * along)
    return np.concatenate([y[3:], a, [alpha]])


def end(distance):
    def gap(y):
        reach = y[1] + distance * math.sin(y[2]) - R
        return reach, y[4] + distance * math.cos(y[2]) * y[5], K, LIGHT

    return gap


ENDS = [end(0.0), end(LENGTH)]


def landing(tilt, **settings):
    start, rate = (0.0, R + 0.02, tilt), (0.0, -1.0, 0.0)
    linkage = loose(BAR, start, rate, center=(LENGTH / 2, 0.0), gravity=(0.0, -9.81))
    return running(linkage, FLOOR | {"damping": LIGHT}, **settings)


def landed(tilt):
    start = np.array([0.0, R + 0.02, tilt, 0.0, -1.0, 0.0])
    return piecewise.solve(bar, ENDS, start, LANDED)


@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_a_bar_that_lands_on_both_ends(tilt):
    """At once, and one after the other."""
    exact, events = landed(tilt)
    assert events == 4
    found = errors(lambda: landing(tilt), exact, LANDED, of=slice(3, None))
    assert order(found) > 3.5
    assert found[1] < 1e-4


def test_more_events_in_a_step_than_are_located():
    """Both ends land within 0.4 ms of each other: two events a step are needed."""
    tilt = 4e-4 / LENGTH
    exact, _ = landed(tilt)
    for events, least, most in ((0, 1e-3, 0.1), (1, 2e-4, 0.1), (2, 0.0, 1e-4)):
        bar = partial(landing, tilt, events=events)
        (error,) = errors(bar, exact, LANDED, [1000], slice(3, None))
        assert least < error < most, events


SOFT, LOSSY = 8000.0, 40.0


def height(q, center):
    """Distance of a point below the axis of link 4; q may be complex."""
    elbow = L[2] * np.array([np.cos(q[2]), np.sin(q[2])])
    along = np.array([np.cos(q[2] + q[3]), np.sin(q[2] + q[3])])
    away = elbow - center
    return along[0] * away[1] - along[1] * away[0]


def gradient(q, center):
    return np.array([height(q + 1e-30j * e, center).imag / 1e-30 for e in np.eye(4)])


def test_a_linkage_with_a_loop_that_is_thrown_on_a_disc():
    """Against the report's Appendix A by hand."""
    linkage = shaped()
    bare = [replace(b, radius=None) for b in linkage.body[:3]]
    linkage = replace(linkage, body=(*bare, linkage.body[3]))
    q0 = running(linkage).state["q"]
    angle = q0[2] + q0[3]
    side = np.array([-math.sin(angle), math.cos(angle)])
    center = link4(q0, 0.5) - (0.013 + 0.002) * side
    wrench = np.array([0.0, -2.0, 0.0])

    def rhs(y, force):
        q, qd = y[:4], y[4:]
        Q = appendix_a.J_h(q).T @ wrench + gradient(q, center) * force[0]
        return np.concatenate([qd, appendix_a.solution(q, qd, Q)[0]])

    def gap(y):
        return height(y[:4], center) - 0.013, gradient(y[:4], center) @ y[4:], SOFT, LOSSY

    t_end = 0.2
    exact, events = piecewise.solve(rhs, [gap], np.r_[q0, np.zeros(4)], t_end)
    assert events >= 2
    contacts = {"disc": (Disc(center=tuple(center), radius=0.01),)}
    contacts |= {"stiffness": SOFT, "damping": LOSSY}
    found = errors(lambda: running(linkage, contacts).set(F_hand=wrench), exact, t_end)
    assert order(found) > 3.5


def test_a_scene_without_contacts_pays_nothing():
    steps = [running(loose(BAR), events=events).component.step for events in (0, 1)]
    assert steps[0].n_instructions() == steps[1].n_instructions()


def test_steps_of_many_operations_are_told_before_they_are_built(monkeypatch, caplog):
    monkeypatch.setattr(mechanism_steps, "MANY", 100)
    running(loose(POINT), FLOOR, integrator="heun", events=2)
    assert "1 bodies with 2 places" in caplog.text
    assert "`mechanism.integrator` = 'heun' and `mechanism.events` = 2 (5 steps" in caplog.text
    monkeypatch.setattr(mechanism_steps, "MOST", 100)
    with pytest.raises(ValueError, match=r"more than 100; fewer: `mechanism\.events` = 0"):
        running(loose(POINT), FLOOR, integrator="heun", events=3)
