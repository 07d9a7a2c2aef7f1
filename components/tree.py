"""Products with D and D^-1 of a tree in linear work: the articulated-body recursion.

Featherstone, Rigid Body Dynamics Algorithms (2008), sections 5.3 and 7.3, in the plane and with
every spatial vector (omega, v_x, v_y) taken at the world's origin, so that no transform stands
between a body and its parent:

    leaf to root   U_i = I_i S_i,  d_i = S_i' U_i,  I_parent += I_i - U_i U_i'/d_i
    D^-1 b         u_i = b_i - S_i' p_i,  p_parent += p_i + U_i u_i/d_i, then root to leaf
                   a_i = (u_i - U_i' A_parent)/d_i,  A_i = A_parent + S_i a_i
    D a            A_i = A_parent + S_i a_i, then leaf to root  f_parent += f_i = I_i A_i,
                   b_i = S_i' f_i

The same D as (2.10): a serial chain of n links costs O(n), where D itself has n^2 entries.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from hapticlink.components.linkage import LinkageModel


@dataclass(frozen=True)
class Coordinate:
    """One column of motion: its index in q, the one it stands on, its twist and inertia."""

    index: int
    parent: int | None
    S: ca.SX
    inertia: ca.SX


def to_point(r: ca.SX) -> ca.SX:
    """X with (v_x, v_y, omega) at the point r = X (omega, v_x, v_y) at the origin."""
    return ca.vertcat(ca.horzcat(-r[1], 1, 0), ca.horzcat(r[0], 0, 1), ca.horzcat(1, 0, 0))


def _coordinates(model: LinkageModel, extra: Mapping[str, ca.SX]) -> list[Coordinate]:
    """From the ground outward; a body's inertia stands on the last coordinate of its joint."""
    found: list[Coordinate] = []
    tip: dict[str, int | None] = {"ground": None}
    bodies = {b.name: b for b in model.linkage.body}
    for joint in model.outward:
        body = bodies[joint.child]
        m, inertia = model.p[f"{body.name}.mass"], model.p[f"{body.name}.inertia"]
        X = to_point(model.centers[body.name])
        own = X.T @ ca.diag(ca.vertcat(m, m, inertia)) @ X + extra.get(body.name, ca.SX(3, 3))
        twists = model.twists(joint)
        parent = tip[joint.parent]
        for k, S in enumerate(twists):
            last = k == len(twists) - 1
            index = model.coordinate(joint.name) + k
            found.append(Coordinate(index, parent, S, own if last else ca.SX(3, 3)))
            parent = len(found) - 1
        tip[joint.child] = parent
    return found


class TreeInertia:
    """D + sum over bodies of J_b' extra_b J_b, as an operator on n x r columns.

    extra: by body, a symmetric 3 x 3 on (omega, v_x, v_y) at the origin.
    """

    def __init__(self, model: LinkageModel, extra: Mapping[str, ca.SX] | None = None) -> None:
        self.n = model.q.numel()
        self._tree = _coordinates(model, extra or {})
        articulated = [c.inertia for c in self._tree]
        self._U: list[ca.SX] = [ca.SX(3, 1)] * self.n
        self._d_inv: list[ca.SX] = [ca.SX(0)] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            U = articulated[i] @ c.S
            d_inv = 1 / ca.dot(c.S, U)
            self._U[i], self._d_inv[i] = U, d_inv
            if c.parent is not None:
                rest = articulated[i] - (U * d_inv) @ U.T
                articulated[c.parent] = articulated[c.parent] + rest

    def solve(self, b: ca.SX) -> ca.SX:
        """a with D a = b."""
        r = b.shape[1]
        p = [ca.SX(3, r)] * self.n
        u = [ca.SX(1, r)] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            u[i] = (b[c.index, :] - c.S.T @ p[i]) * self._d_inv[i]
            if c.parent is not None:
                p[c.parent] = p[c.parent] + p[i] + self._U[i] @ u[i]
        A: list[ca.SX] = []
        rows = [ca.SX(1, r)] * self.n
        for i, c in enumerate(self._tree):
            before = ca.SX(3, r) if c.parent is None else A[c.parent]
            a = u[i] - (self._U[i].T @ before) * self._d_inv[i]
            A.append(before + c.S @ a)
            rows[c.index] = a
        return ca.vertcat(*rows)

    def apply(self, a: ca.SX) -> ca.SX:
        """D a."""
        r = a.shape[1]
        A: list[ca.SX] = []
        for c in self._tree:
            before = ca.SX(3, r) if c.parent is None else A[c.parent]
            A.append(before + c.S @ a[c.index, :])
        f = [c.inertia @ A[i] for i, c in enumerate(self._tree)]
        rows = [ca.SX(1, r)] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            rows[c.index] = c.S.T @ f[i]
            if c.parent is not None:
                f[c.parent] = f[c.parent] + f[i]
        return ca.vertcat(*rows)
