"""Linkages that tests share: the report's five-bar, and random ones."""

import math

import numpy as np
from hypothesis import strategies as st

from hapticlink.components.specs import Body, Joint, Linkage, Loop, OperationalPoint

TABLE_6_1 = {
    "l": (0.042, 0.042, 0.0184, 0.0564),
    "m": (1.0, 1.0, 0.5, 0.5),
    "I": (2.1e-4, 2.1e-4, 1.05e-4, 1.05e-4),
}
Q0 = (math.pi / 4, -math.pi / 2, -0.4 * math.pi, math.pi / 2)
WRENCH = (-0.5, 0.0, -0.0025)


def five_bar(l=TABLE_6_1["l"], m=TABLE_6_1["m"], I=TABLE_6_1["I"], f=(0.5,) * 4, start=Q0):  # noqa: E741
    """The report's closed-loop mechanism (Figure 3.1), f the centre-of-mass fractions."""
    body = tuple(
        Body(name=f"link{i + 1}", mass=m[i], inertia=I[i], center=(f[i] * l[i], 0.0))
        for i in range(4)
    )
    joint = (
        Joint(name="shoulder1", child="link1"),
        Joint(name="elbow1", parent="link1", child="link2", at_parent=(l[0], 0.0)),
        Joint(name="shoulder2", child="link3"),
        Joint(name="elbow2", parent="link3", child="link4", at_parent=(l[2], 0.0)),
    )
    return Linkage(
        body=body,
        joint=joint,
        loop=(Loop(bodies=("link2", "link4"), at=((l[1], 0.0), (l[3], 0.0))),),
        operational_point=OperationalPoint(body="link2", at=(f[1] * l[1], 0.0)),
        start=dict(zip((j.name for j in joint), start, strict=True)),
    )


def open_arm(linkage):
    """The same tree with its loops left open."""
    return Linkage(
        body=linkage.body,
        joint=linkage.joint,
        operational_point=linkage.operational_point,
        start=linkage.start,
    )


@st.composite
def linkages(draw, max_bodies=6, max_loops=3, prismatic=True):
    """(linkage, q, qd): a random tree of revolute and prismatic joints whose loops close at q."""
    number = draw(st.integers(1, max_bodies))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))

    def point():
        return tuple(float(v) for v in rng.uniform(-0.5, 0.5, 2))

    names = [f"b{i}" for i in range(number)]
    bodies, joints, frames, q = [], [], {"ground": (np.zeros(2), 0.0)}, []
    for i, name in enumerate(names):
        parent = ["ground", *names][rng.integers(0, i + 1)]
        kind = "prismatic" if prismatic and rng.random() < 0.25 else "revolute"
        a, b, axis = point(), point(), float(rng.uniform(-3, 3))
        value = float(rng.uniform(-0.3, 0.3) if kind == "prismatic" else rng.uniform(-3, 3))
        bodies.append(
            Body(
                name=name,
                mass=float(rng.uniform(0.2, 2)),
                inertia=float(rng.uniform(0.01, 0.1)),
                center=point(),
            )
        )
        joints.append(
            Joint(
                name=f"j{i}",
                type=kind,
                parent=parent,
                child=name,
                at_parent=a,
                at_child=b,
                axis=axis,
            )
        )
        origin, angle = frames[parent]
        pivot = origin + _turn(angle) @ a
        if kind == "prismatic":
            pivot = pivot + value * _turn(angle) @ (math.cos(axis), math.sin(axis))
        else:
            angle += value
        frames[name] = (pivot - _turn(angle) @ b, angle)
        q.append(value)
    loops = []
    # Fewer closures than coordinates leaves something that moves.
    for _ in range(draw(st.integers(0, min(max_loops, (number - 1) // 2)))):
        first, second = rng.choice(["ground", *names], 2, replace=False)
        a = point()
        origin, angle = frames[str(first)]
        world = origin + _turn(angle) @ a
        origin, angle = frames[str(second)]
        b = tuple(float(v) for v in _turn(angle).T @ (world - origin))
        loops.append(Loop(bodies=(str(first), str(second)), at=(a, b)))
    linkage = Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        loop=tuple(loops),
        operational_point=OperationalPoint(body=names[rng.integers(0, number)], at=point()),
        start={f"j{i}": v for i, v in enumerate(q)},
    )
    return linkage, np.array(q), rng.uniform(-2, 2, number)


def _turn(angle):
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
