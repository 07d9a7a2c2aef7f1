"""The mechanisms of the comparison with other codes, as records of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipkinc

from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop, OperationalPoint
from hapticlink.orchestrator import open_scene

GRAVITY = 9.81
Matrix = np.ndarray


def five_bar() -> Linkage:
    """The report's closed-loop mechanism: Figure 3.1, Table 6.1."""
    linkage = open_scene.load("five-bar").linkage
    assert linkage
    return linkage


def _rod(name: str) -> Body:
    return Body(name=name, mass=1.0, inertia=1 / 12, center=(0.5, 0.0))


def n_four_bar(N: int) -> Linkage:
    """IFToMM benchmark A02: N + 1 rockers and N couplers, uniform rods of 1 m and 1 kg; the tip
    B0 of the first rocker starts above its pivot at 1 m/s. Singular twice a turn."""
    bodies, joints, loops = [], [], []
    start: dict[str, float] = {}
    speed: dict[str, float] = {}
    for i in range(N + 1):
        bodies.append(_rod(f"rocker{i}"))
        joints.append(Joint(name=f"pivot{i}", child=f"rocker{i}", at_parent=(float(i), 0.0)))
        start[f"pivot{i}"], speed[f"pivot{i}"] = math.pi / 2, -1.0
    for i in range(N):
        rocker, coupler = f"rocker{i}", f"coupler{i}"
        bodies.append(_rod(coupler))
        joints.append(Joint(name=f"tip{i}", parent=rocker, child=coupler, at_parent=(1.0, 0.0)))
        start[f"tip{i}"], speed[f"tip{i}"] = -math.pi / 2, 1.0
        loops.append(Loop(bodies=(coupler, f"rocker{i + 1}"), at=((1.0, 0.0), (1.0, 0.0))))
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        loop=tuple(loops),
        gravity=(0.0, -GRAVITY),
        operational_point=OperationalPoint(body="rocker0", at=(1.0, 0.0)),
        start=start,
        start_velocity=speed,
    )


def n_four_bar_tip(N: int, t: float) -> tuple[float, float]:
    """B0 at t (s) on the parallelogram branch, exact: phidot^2 = 1 + 2 a (1 - cos phi) with phi
    from the top and a = g ((N+1)/2 + N) / ((N+1)/3 + N), so t = 2 F(phi/2 | -4a)."""
    a = GRAVITY * ((N + 1) / 2 + N) / ((N + 1) / 3 + N)
    turn = 2 * ellipkinc(math.pi, -4 * a)
    most = 2 * math.pi * (t / turn + 1) + 1
    phi = brentq(lambda p: 2 * ellipkinc(p / 2, -4 * a) - t, 0, most, xtol=1e-14)
    return math.sin(phi), math.cos(phi)


def chain(links: int) -> Linkage:
    """A serial pendulum of so many rods of 1 m in all, joints relative."""
    length = 1 / links
    names = ["ground", *(f"link{i}" for i in range(links))]
    return Linkage(
        body=tuple(
            Body(name=n, mass=length, inertia=length**3 / 12, center=(length / 2, 0.0))
            for n in names[1:]
        ),
        joint=tuple(
            Joint(
                name=f"joint{i}",
                parent=names[i],
                child=names[i + 1],
                at_parent=(length, 0.0) if i else None,
            )
            for i in range(links)
        ),
        gravity=(0.0, -GRAVITY),
        operational_point=OperationalPoint(body=names[-1], at=(length, 0.0)),
        start={f"joint{i}": 0.1 for i in range(links)},
    )


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def bricard() -> Linkage:
    """IFToMM benchmark A04: five square rods of 1 m, .1 m thick, on edges of a cube; P3 is the end
    of the second."""
    edges = [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    axes = [Y, Z, X, Y, Z]
    bodies, joints = [], []
    for i, (edge, axis) in enumerate(zip(edges, axes, strict=True)):
        tensor = np.diag([0.01 / 6 if along else 1.01 / 12 for along in edge])
        bodies.append(body(f"rod{i}", 1.0, tensor, np.array(edge) / 2))
        before: dict[str, Any] = {}
        if i:
            before = {"parent": f"rod{i - 1}", "at_parent": edges[i - 1]}
        joints.append(Joint(name=f"joint{i}", child=f"rod{i}", axis=axis, **before))
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        loop=(Loop(bodies=("rod4", "ground"), at=(edges[4], Z), axes=(X, X)),),
        operational_point=OperationalPoint(body="rod1", at=edges[1]),
        gravity=(0.0, -9.81, 0.0),
    )


ALPHA, BETA, BENNETT_START = 0.9, 0.5, 1.1
"""Twists of Bennett's links, and its first angle where the joint coordinates are 0 (rad)."""


def bennett() -> Linkage:
    """Four revolute joints with opposite links equal: a, alpha and b, beta with
    a sin(beta) = b sin(alpha). It is closed at q, by the joints of the tree."""
    a = 0.3
    b = a * math.sin(BETA) / math.sin(ALPHA)
    links = [(a, ALPHA), (b, BETA), (a, ALPHA), (b, BETA)]
    return closed(dh_loop(links, bennett_angles(ALPHA, BETA, BENNETT_START)))


def bennett_motion(theta: float) -> tuple[Matrix, Matrix, Matrix]:
    """The joint coordinates of `bennett` at its first angle, their derivative and the second one.
    With d = sin^2(theta/2) + k^2 cos^2(theta/2) the second angle has the slope -k/d."""
    k = math.sin((BETA + ALPHA) / 2) / math.sin((BETA - ALPHA) / 2)
    c, s = math.cos(theta / 2), math.sin(theta / 2)
    d = s**2 + k**2 * c**2
    start = 2 * math.atan2(k * math.cos(BENNETT_START / 2), math.sin(BENNETT_START / 2))
    turned, other = theta - BENNETT_START, 2 * math.atan2(k * c, s) - start
    bend = k * s * c * (1 - k**2) / d**2
    return (
        np.array([turned, other, -turned]),
        np.array([1.0, -k / d, -1.0]),
        np.array([0.0, bend, 0.0]),
    )


def falling(linkage: Linkage) -> Linkage:
    """The linkage under gravity along -y."""
    return replace(linkage, gravity=(0.0, -GRAVITY, 0.0))


def bennett_angles(alpha: float, beta: float, theta: float = 1.1) -> list[float]:
    """Bennett's condition tan(theta_1/2) tan(theta_2/2) = sin((beta + alpha)/2)/sin((beta -
    alpha)/2), opposite angles adding to a full turn."""
    k = math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)
    other = 2 * math.atan(k / math.tan(theta / 2))
    return [theta, other, 2 * math.pi - theta, 2 * math.pi - other]


def plate(name: str, end: Sequence[float], mass: float = 0.3) -> Body:
    """A thin rod from the origin of its frame to `end`, a hundredth as thick."""
    r = np.array(end)
    tensor = mass / 12 * (r @ r * 1.0001 * np.eye(3) - np.outer(r, r))
    return body(name, mass, tensor, r / 2)


def body(name: str, mass: float, tensor: Matrix, center: Matrix) -> Body:
    """A body with an inertia tensor about its centre of mass."""
    entries = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    inertia: Any = tuple(float(v) for v in entries)
    at: Any = tuple(float(v) for v in center)
    return Body(name=name, mass=mass, inertia=inertia, center=at)


def dh_loop(
    links: Sequence[tuple[float, float]], angles: Sequence[float]
) -> tuple[list[Matrix], list[Matrix]]:
    """Points and axes of a closed chain of revolute joints by Denavit and Hartenberg's lengths and
    twists (a, alpha), at joint angles."""
    frame, points, axes = np.eye(4), [], []
    for (a, alpha), theta in zip(links, angles, strict=True):
        points.append(frame[:3, 3])
        axes.append(frame[:3, 2])
        c, s = math.cos(theta), math.sin(theta)
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
        c, s = math.cos(alpha), math.sin(alpha)
        along = np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])
        frame = frame @ turn @ along
    np.testing.assert_allclose(frame, np.eye(4), atol=1e-12)
    return points, axes


def closed(loop: tuple[list[Matrix], list[Matrix]]) -> Linkage:
    """The linkage of a closed chain, its last joint cut, with rods between the joints."""
    points, axes = loop
    n = len(points)
    bodies, joints = [], []
    spans: list[Any] = [tuple((points[(i + 1) % n] - points[i]).tolist()) for i in range(n)]
    for i in range(n - 1):
        bodies.append(plate(f"rod{i}", spans[i]))
        before: dict[str, Any] = {}
        if i:
            before = {"parent": f"rod{i - 1}", "at_parent": spans[i - 1]}
        axis: Any = tuple(axes[i].tolist())
        joints.append(Joint(name=f"joint{i}", child=f"rod{i}", axis=axis, **before))
    last: Any = tuple(axes[n - 1].tolist())
    end: Any = tuple(points[n - 1].tolist())
    cut = Loop(bodies=(f"rod{n - 2}", "ground"), at=(spans[n - 2], end), axes=(last, last))
    point = OperationalPoint(body="rod1", at=spans[1])
    return Linkage(body=tuple(bodies), joint=tuple(joints), loop=(cut,), operational_point=point)
