"""The mechanisms of the comparison with other codes, as records of a scene."""

from __future__ import annotations

import math

from scipy.optimize import brentq
from scipy.special import ellipkinc

from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop, OperationalPoint
from hapticlink.orchestrator import open_scene

GRAVITY = 9.81


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
