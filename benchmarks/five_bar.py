"""A five-bar, written down three times: by Lagrange multipliers, in independent coordinates that
are chosen numerically, and in independent coordinates by closed forms.

Both shoulders are at the origin; q = (shoulder1, elbow1, shoulder2, elbow2) in rad, elbows relative
to the link before. The operational point is the middle of link 2. Nothing of the components is
used: these are also references for their tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from hapticlink.components.specs.linkage import Body, Joint, Linkage, Loop, OperationalPoint

PAIRS = tuple(combinations(range(4), 2))
"""Choices of the two dependent coordinates."""
NEWTON = 3  # iterations for the dependent coordinates of a stage, from those of the one before


def unit(angle: ca.SX) -> ca.SX:
    return ca.vertcat(ca.cos(angle), ca.sin(angle))


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return a[0] * b[1] - a[1] * b[0]


@dataclass(frozen=True)
class FiveBar:
    """lengths (m), masses (kg) and inertias (kg.m2, about the middle) of links 1 and 2, from the
    first shoulder, and 3 and 4, from the second; wrench (N, N, N.m) on the operational point."""

    lengths: tuple[float, float, float, float]
    masses: tuple[float, float, float, float]
    inertias: tuple[float, float, float, float]
    wrench: tuple[float, float, float]

    def linkage(self, q: np.ndarray, qd: np.ndarray) -> Linkage:
        """The same as a record of a scene."""
        names = ("link1", "link2", "link3", "link4")
        joints = ("shoulder1", "elbow1", "shoulder2", "elbow2")
        parents = ("ground", "link1", "ground", "link3")
        at = ((0.0, 0.0), (self.lengths[0], 0.0), (0.0, 0.0), (self.lengths[2], 0.0))
        return Linkage(
            body=tuple(
                Body(name=name, mass=m, inertia=i, center=(0.5 * length, 0.0))
                for name, length, m, i in zip(
                    names, self.lengths, self.masses, self.inertias, strict=True
                )
            ),
            joint=tuple(
                Joint(name=j, parent=p, child=c, at_parent=a)
                for j, p, c, a in zip(joints, parents, names, at, strict=True)
            ),
            loop=(
                Loop(
                    bodies=("link2", "link4"),
                    at=((self.lengths[1], 0.0), (self.lengths[3], 0.0)),
                ),
            ),
            operational_point=OperationalPoint(body="link2", at=(0.5 * self.lengths[1], 0.0)),
            start=dict(zip(joints, q.tolist(), strict=True)),
            start_velocity=dict(zip(joints, qd.tolist(), strict=True)),
        )

    def _energy(self, centres: list[ca.SX], angles: list[ca.SX], q: ca.SX, qd: ca.SX) -> ca.SX:
        """Kinetic energy; `angles` are anything whose rates are those of the links."""
        speeds = [ca.jtimes(c, q, qd) for c in centres]
        turns = [ca.jtimes(a, q, qd) for a in angles]
        parts = (
            m * ca.sumsqr(v) + i * w**2
            for m, i, v, w in zip(self.masses, self.inertias, speeds, turns, strict=True)
        )
        return 0.5 * sum(parts, start=ca.SX(0))

    @cached_property
    def tree(self) -> ca.Function:
        """(q, qd) -> D, B - Q, W, w, h: D qdd + B = Q - W' lambda, W qdd + w = 0 (B.1, B.2)."""
        q, qd = ca.SX.sym("q", 4), ca.SX.sym("qd", 4)
        l1, l2, l3, l4 = self.lengths
        angles = [q[0], q[0] + q[1], q[2], q[2] + q[3]]
        a, c = l1 * unit(angles[0]), l3 * unit(angles[2])
        middles = [a / 2, a + l2 / 2 * unit(angles[1]), c / 2, c + l4 / 2 * unit(angles[3])]
        T = self._energy(middles, angles, q, qd)
        momentum = ca.gradient(T, qd)
        D = ca.jacobian(momentum, qd)
        pose = ca.vertcat(middles[1], angles[1])
        force = ca.jacobian(pose, q).T @ ca.DM(self.wrench)
        bias = ca.jtimes(momentum, q, qd) - ca.gradient(T, q) - force
        h = a + l2 * unit(angles[1]) - c - l4 * unit(angles[3])
        W = ca.jacobian(h, q)
        return ca.Function("tree", [q, qd], [D, bias, W, ca.jtimes(W @ qd, q, qd), h])

    def multipliers(self, x: np.ndarray) -> np.ndarray:
        """Rate of (q, qd) by (B.6) without stabilisation."""
        D, bias, W, w, _ = (np.array(v) for v in self.tree(x[:4], x[4:]))
        matrix = np.block([[D, W.T], [W, np.zeros((2, 2))]])
        return np.concatenate([x[4:], np.linalg.solve(matrix, -np.vstack([bias, w]))[:4, 0]])

    def reference(self, x: np.ndarray, times: np.ndarray, tolerance: float) -> np.ndarray:
        """(q, qd) at `times`, of `multipliers` by Dormand and Prince's method of order 8."""
        solved = solve_ivp(
            lambda _, y: self.multipliers(y), (0.0, times[-1]), x, "DOP853", times,
            rtol=tolerance, atol=tolerance,
        )  # fmt: skip
        return solved.y.T if solved.success else np.full((len(times), 8), np.nan)

    def partitioned(self, pair: tuple[int, int]) -> ca.Function:
        """(q, qd, h) -> (q, qd) after a step of RK4 in the coordinates other than `pair`, which are
        solved for at every stage (Wehage, Haug, J. Mechanical Design 104 (1982), 247)."""
        free = [i for i in range(4) if i not in pair]
        q0, qd0, step = ca.SX.sym("q", 4), ca.SX.sym("qd", 4), ca.SX.sym("h")

        def closed(guess: ca.SX, v: ca.SX, vd: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
            q = ca.SX(guess)
            q[free] = v
            for _ in range(NEWTON):
                *_, W, _, h = self.tree(q, ca.SX.zeros(4))
                q[list(pair)] -= ca.solve(W[:, list(pair)], h)
            *_, W, _, _ = self.tree(q, ca.SX.zeros(4))
            R = ca.SX.zeros(4, 2)
            R[free, :] = ca.SX.eye(2)
            R[list(pair), :] = -ca.solve(W[:, list(pair)], W[:, free])
            return q, R @ vd, R

        def rate(guess: ca.SX, v: ca.SX, vd: ca.SX) -> tuple[ca.SX, ca.SX]:
            q, qd, R = closed(guess, v, vd)
            D, bias, W, w, _ = self.tree(q, qd)
            g = ca.SX.zeros(4)
            g[list(pair)] = -ca.solve(W[:, list(pair)], w)
            return q, ca.solve(R.T @ D @ R, -R.T @ (bias + D @ g))

        v, vd = runge_kutta(rate, q0, q0[free], qd0[free], step)
        q, qd, _ = closed(q0, v, vd)
        return ca.Function("partitioned", [q0, qd0, step], [q, qd], {"cse": True})

    def repartitioned(self) -> ca.Function:
        """`partitioned` with the pair whose columns of W have the largest determinant, chosen anew
        at each step."""
        q, qd, h = ca.MX.sym("q", 4), ca.MX.sym("qd", 4), ca.MX.sym("h")
        at = ca.SX.sym("q", 4)
        W = self.tree(at, ca.SX.zeros(4))[2]
        best, largest = ca.SX(0), ca.SX(0)
        for k, pair in enumerate(PAIRS):
            size = ca.fabs(ca.det(W[:, list(pair)]))
            best, largest = ca.if_else(size > largest, k, best), ca.fmax(size, largest)
        steps = [self.partitioned(pair) for pair in PAIRS]
        chosen = ca.Function.conditional("chosen", steps[:-1], steps[-1])
        which = ca.Function("which", [at], [best])(q)
        return ca.Function("repartitioned", [q, qd, h], chosen.call([which, q, qd, h]))

    def embedded(self, branch: float) -> ca.Function:
        """(q, qd, h) -> (q, qd) after a step of RK4 in the shoulders, with the elbows as closed
        forms of them: the joint of links 2 and 4 is where two circles meet, on the side `branch`
        (1 or -1). NaN where they do not."""
        s, sd = ca.SX.sym("s", 2), ca.SX.sym("sd", 2)
        l1, l2, l3, l4 = self.lengths
        a, c = l1 * unit(s[0]), l3 * unit(s[1])
        apart = ca.sumsqr(c - a)
        along = (apart + l2**2 - l4**2) / (2 * apart)
        across = branch * ca.sqrt(l2**2 / apart - along**2)
        p = a + along * (c - a) + across * ca.vertcat(a[1] - c[1], c[0] - a[0])
        link2, link4 = p - a, p - c
        angles = [s[0], ca.atan2(link2[1], link2[0]), s[1], ca.atan2(link4[1], link4[0])]
        middles = [a / 2, (a + p) / 2, c / 2, (c + p) / 2]
        T = self._energy(middles, angles, s, sd)
        momentum = ca.gradient(T, sd)
        force = ca.jacobian(ca.vertcat(middles[1], angles[1]), s).T @ ca.DM(self.wrench)
        bias = ca.jtimes(momentum, s, sd) - ca.gradient(T, s) - force
        sdd = ca.Function(
            "sdd", [s, sd], [-ca.solve(ca.jacobian(momentum, sd), bias)], {"cse": True}
        )
        q = ca.vertcat(s[0], angles[1] - s[0], s[1], angles[3] - s[1])
        whole = ca.Function("whole", [s, sd], [q, ca.jtimes(q, s, sd)])
        q0, qd0, step = ca.SX.sym("q", 4), ca.SX.sym("qd", 4), ca.SX.sym("h")
        after = runge_kutta(lambda g, v, vd: (g, sdd(v, vd)), q0, q0[[0, 2]], qd0[[0, 2]], step)
        return ca.Function("embedded", [q0, qd0, step], whole.call([*after]), {"cse": True})

    def side(self, q: np.ndarray) -> float:
        """The branch of `embedded`: on which side of the line of the elbows links 2 and 4 meet."""
        l1, l2, l3, _ = self.lengths
        a = l1 * np.array([np.cos(q[0]), np.sin(q[0])])
        c = l3 * np.array([np.cos(q[2]), np.sin(q[2])])
        p = a + l2 * np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
        line, to = c - a, p - a
        return float(np.sign(line[0] * to[1] - line[1] * to[0]))

    def straightness(self, q: np.ndarray) -> np.ndarray:
        """|sin| of the angle between links 2 and 4, (k,), of q (k, 4): 0 where the shoulders do not
        determine the elbows."""
        return np.abs(np.sin(q[:, 0] + q[:, 1] - q[:, 2] - q[:, 3]))


def runge_kutta(
    rate: Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]],
    guess: ca.SX,
    v: ca.SX,
    vd: ca.SX,
    h: ca.SX,
) -> tuple[ca.SX, ca.SX]:
    """(v, vd) after a step of the classical method; rate(guess, v, vd) gives the next guess of all
    coordinates, and vdd."""
    guess, a1 = rate(guess, v, vd)
    vd2 = vd + h / 2 * a1
    guess, a2 = rate(guess, v + h / 2 * vd, vd2)
    vd3 = vd + h / 2 * a2
    guess, a3 = rate(guess, v + h / 2 * vd2, vd3)
    vd4 = vd + h * a3
    guess, a4 = rate(guess, v + h * vd3, vd4)
    return v + h / 6 * (vd + 2 * vd2 + 2 * vd3 + vd4), vd + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
