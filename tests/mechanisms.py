"""Linkages that tests share: one body, a four-bar, the report's five-bar, and random ones."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
from hypothesis import strategies as st

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop, OperationalPoint
from studies.report import appendix_a

TABLE_6_1 = {"l": appendix_a.L, "m": appendix_a.M, "I": appendix_a.J}
Q0, WRENCH = appendix_a.Q0, appendix_a.WRENCH
MOBILITY = np.array(
    [
        [0.3415204956524712, -0.1971892092835345, 4.867264929294315],
        [-0.1971892092835345, 0.5132939799057613, 10.63410376500779],
        [4.867264929294315, 10.63410376500779, 521.8803563146321],
    ]
)
"""Lambda^-1 of the report's five-bar at rest, Table 6.1, by Pinocchio."""


def standing_rod():
    """The [linkage] of a rod on its end, with friction b in its pivot, and the rate (1/s) at which
    it falls: J s^2 + b s - m g c = 0."""
    m, c, J, b = 0.8, 0.04, 1e-3 + 0.8 * 0.04**2, 0.002
    rod = {
        "gravity": [0.0, -9.81],
        "operational_point": {"body": "rod", "at": [0.05, 0.0]},
        "start": {"pivot": math.pi / 2},
        "body": [{"name": "rod", "mass": m, "inertia": 1e-3, "center": [c, 0.0]}],
        "joint": [{"name": "pivot", "child": "rod", "damping": b}],
    }
    return rod, max(np.roots([J, b, -m * 9.81 * c]).real)


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
    return replace(linkage, loop=())


def one_body(body, at=None, start=None, rate=None, gravity=None, spring=(), **joint):
    """A body on a joint called `joint`, held by the hand at a point of it."""
    return Linkage(
        body=(body,),
        joint=(Joint(name="joint", child=body.name, **joint),),
        operational_point=OperationalPoint(body=body.name, at=at),
        gravity=gravity,
        spring=spring,
        start={} if start is None else {"joint": start},
        start_velocity={} if rate is None else {"joint": rate},
    )


def rod(name, length, mass=1.0):
    """A uniform rod from the origin of its frame along x."""
    return Body(name=name, mass=mass, inertia=mass * length**2 / 12, center=(length / 2, 0.0))


def four_bar(masses=(1.0, 1.0, 1.0), cut="middle", rate=None):
    """Crank .2, coupler .5, rocker .4, ground .5 m, of uniform rods under gravity; `rate` is the
    crank's. The cut joint is between coupler and rocker, or at the rocker's pivot on the ground."""
    lengths = {"crank": 0.2, "coupler": 0.5, "rocker": 0.4}
    crank = Joint(name="crank", child="crank")
    elbow = Joint(name="elbow", parent="crank", child="coupler", at_parent=(0.2, 0.0))
    if cut == "middle":
        last = Joint(name="rocker", child="rocker", at_parent=(0.5, 0.0))
        loop = Loop(bodies=("coupler", "rocker"), at=((0.5, 0.0), (0.4, 0.0)))
    else:
        last = Joint(name="rocker", parent="coupler", child="rocker", at_parent=(0.5, 0.0))
        loop = Loop(bodies=("rocker", "ground"), at=((0.4, 0.0), (0.5, 0.0)))
    return Linkage(
        body=tuple(rod(*of, mass) for of, mass in zip(lengths.items(), masses, strict=True)),
        joint=(crank, elbow, last),
        loop=(loop,),
        gravity=(0.0, -9.81),
        operational_point=OperationalPoint(body="coupler", at=(0.25, 0.0)),
        start={"crank": 1.0, "elbow": -0.6, "rocker": 1.5 if cut == "middle" else -2.0},
        start_velocity={} if rate is None else {"crank": rate},
    )


def evaluated(linkage, expressions, *sizes):
    """(q, qd, *more, of=linkage) -> the values of `expressions(model, *symbols)`, of the symbolic
    model of a linkage and further symbols of these sizes; `of` is a linkage of the same structure
    whose parameters are taken."""
    p, n = Signals("p", parameters(linkage)), len(linkage.coordinate_units)
    q, qd, more = ca.SX.sym("q", n), ca.SX.sym("qd", n), [ca.SX.sym("u", *s) for s in sizes]
    found = expressions(LinkageModel(linkage, p, q, qd), *more)
    f = ca.Function("f", [q, qd, *more, p.vector], list(found))

    def values(q, qd, *more, of=linkage):
        starts = [s for v in parameters(of) for s in v.starts]
        return [np.array(a) for a in f.call([ca.DM(v) for v in (q, qd, *more, starts)])]

    return values


def terms(linkage, *names):
    """NumPy-valued terms of a linkage at (q, qd), with its own parameter values."""
    return evaluated(linkage, lambda model: [getattr(model, name) for name in names])


@st.composite
def linkages(draw, max_bodies=8, max_loops=3):
    """(linkage, q, qd): a random tree of revolute and prismatic joints whose loops close at q.

    Each loop has two bodies of its own, hung between two that are there already and closed where
    their columns of W stand across each other. Columns of later loops have no entry in the rows of
    earlier ones: W is block triangular and of full rank.
    """
    loops = min(draw(st.sampled_from([0, 1, 1, 2, 2, 3, 3])), max_loops, (max_bodies - 1) // 2)
    singles = draw(st.integers(1, max_bodies - 2 * loops))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    tree = _Growing(rng)
    tree.hang("ground")
    for pair in rng.permutation([False] * (singles - 1) + [True] * loops):
        if pair:
            tree.close(*rng.choice(list(tree.frames), 2, replace=False))
        else:
            tree.hang(rng.choice(list(tree.frames)))
    names = [body.name for body in tree.bodies]
    linkage = Linkage(
        body=tuple(tree.bodies),
        joint=tuple(tree.joints),
        loop=tuple(tree.loops),
        operational_point=OperationalPoint(body=str(rng.choice(names)), at=tree.point()),
        start={joint.name: value for joint, value in zip(tree.joints, tree.q, strict=True)},
    )
    return linkage, np.array(tree.q), rng.uniform(-2, 2, len(names))


class _Growing:
    """Bodies and joints added at random, with the frames (origin, angle) that they have at q."""

    def __init__(self, rng):
        self.rng, self.frames = rng, {"ground": (np.zeros(2), 0.0)}
        self.bodies, self.joints, self.loops, self.q = [], [], [], []

    def point(self):
        return tuple(float(v) for v in self.rng.uniform(-0.5, 0.5, 2))

    def hang(self, parent, slides=True):
        """A body on `parent`: its name, and what moves a point x of it: dx/dq."""
        rng, name = self.rng, f"b{len(self.q)}"
        kind = "prismatic" if slides and rng.random() < 0.25 else "revolute"
        a, b, axis = self.point(), self.point(), float(rng.uniform(-3, 3))
        value = float(rng.uniform(-0.3, 0.3) if kind == "prismatic" else rng.uniform(-3, 3))
        mass, inertia = float(rng.uniform(0.2, 2)), float(rng.uniform(0.01, 0.1))
        self.bodies.append(Body(name=name, mass=mass, inertia=inertia, center=self.point()))
        self.joints.append(
            Joint(
                name=f"j{len(self.q)}",
                type=kind,
                parent=str(parent),
                child=name,
                at_parent=a,
                at_child=b,
                axis=axis,
            )
        )
        self.q.append(value)
        origin, angle = self.frames[parent]
        pivot = origin + _turn(angle) @ a
        along = _turn(angle) @ (math.cos(axis), math.sin(axis))
        if kind == "prismatic":
            pivot = pivot + value * along
        else:
            angle += value
        self.frames[name] = (pivot - _turn(angle) @ b, angle)
        if kind == "prismatic":
            return name, lambda x: along
        return name, lambda x: _turn(math.pi / 2) @ (x - pivot)

    def close(self, first, second):
        """Two bodies between `first` and `second`: both in a row, or one on each."""
        one, moved_by_one = self.hang(first)
        in_a_row = self.rng.random() < 0.5
        other, moved_by_other = self.hang(
            one if in_a_row else second, slides=self.joints[-1].type == "revolute"
        )
        pair = (other, str(second)) if in_a_row else (one, other)
        while True:
            at = self.point()
            x = self.frames[pair[0]][0] + _turn(self.frames[pair[0]][1]) @ at
            W = np.column_stack([moved_by_one(x), moved_by_other(x)])
            if np.linalg.cond(W) < 10:
                break
        origin, angle = self.frames[pair[1]]
        there = tuple(float(v) for v in _turn(angle).T @ (x - origin))
        self.loops.append(Loop(bodies=pair, at=(at, there)))


def _turn(angle):
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
