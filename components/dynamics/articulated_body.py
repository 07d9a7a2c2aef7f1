"""Products with D and D^-1 of a tree in O(n): the articulated-body recursion.

Featherstone, Rigid Body Dynamics Algorithms (2008), sections 5.3 and 7.3, in the plane. Spatial
vectors (omega, v_x, v_y) are expressed in the world's axes at the coordinate's own joint point; X
transforms them from the parent's point, and X' transforms forces back (so a revolute S is
(1, 0, 0), and a mechanism far from the origin loses no accuracy):

    leaf to root   U_i = I_i S_i,  d_i = S_i' U_i,  I_parent += X_i' (I_i - U_i U_i'/d_i) X_i
    inward b       u_i = b_i - S_i' p_i,  p_parent += X_i' (p_i + U_i u_i/d_i)
    outward u      a_i = u_i - U_i' X_i A_parent/d_i,  A_i = X_i A_parent + S_i a_i
    D a            A_i = X_i A_parent + S_i a_i, then leaf to root  f_parent += X_i' f_i,
                   f_i += I_i A_i,  b_i = S_i' f_i

    D^-1 = outward diag(d)^-1 inward, and outward is the transpose of inward

The same D as (2.10): a serial chain of n links costs O(n), where D itself has n^2 entries.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from hapticlink.components.dynamics.light_bodies import added_inertia
from hapticlink.components.linkage.model import LinkageModel

FLOOR = 1e-40  # share of added_inertia in D, so that D^-1 exists for massless coordinates


@dataclass(frozen=True)
class Coordinate:
    """A coordinate: its index in q, its parent coordinate, its twist and inertia."""

    index: int
    parent: int | None
    X: ca.SX
    S: ca.SX
    inertia: ca.SX


def to_point(r: ca.SX) -> ca.SX:
    """X with (v_x, v_y, omega) at an offset r (m) = X (omega, v_x, v_y) here."""
    return ca.vertcat(ca.horzcat(-r[1], 1, 0), ca.horzcat(r[0], 0, 1), ca.horzcat(1, 0, 0))


def _shift(r: ca.SX) -> ca.SX:
    """X with (omega, v_x, v_y) at an offset r (m) = X (omega, v_x, v_y) here."""
    return ca.sparsify(to_point(r))[[2, 0, 1], :]


def symmetric(A: ca.SX) -> ca.SX:
    """A symmetric matrix from its lower triangle, so that the upper one is not computed."""
    return ca.tril2symm(ca.tril(A))


def _coordinates(model: LinkageModel, extra: Mapping[str, tuple[ca.SX, ca.SX]]) -> list[Coordinate]:
    """The coordinates from the ground outward; a body's inertia belongs to the last coordinate of
    its joint."""
    coordinates: list[Coordinate] = []
    tip: dict[str, tuple[int | None, ca.SX]] = {"ground": (None, ca.SX(2, 1))}
    bodies = {b.name: b for b in model.linkage.body}
    for joint in model.outward:
        body = bodies[joint.child]
        m, inertia = model.p[f"{body.name}.mass"], model.p[f"{body.name}.inertia"]
        pivot, twists = model.twists(joint)
        parent, before = tip[joint.parent]
        X = ca.sparsify(to_point(model.centers[body.name] - pivot))
        own = symmetric(X.T @ ca.diag(ca.vertcat(m, m, inertia)) @ X)
        if body.name in extra:
            point, K = extra[body.name]
            X = ca.sparsify(to_point(point - pivot))
            own = own + symmetric(X.T @ K @ X)
        for k, S in enumerate(twists):
            last = k == len(twists) - 1
            shift = _shift(pivot - before) if k == 0 else ca.SX.eye(3)
            index = model.coordinate(joint.name) + k
            coordinates.append(Coordinate(index, parent, shift, S, own if last else ca.SX(3, 3)))
            parent = len(coordinates) - 1
        tip[joint.child] = parent, pivot
    return coordinates


class TreeInertia:
    """D + sum over bodies of J_b' K_b J_b, as an operator on n x r matrices.

    extra: for a body, a point (m, in the world) and the symmetric K_b for (v_x, v_y, omega) there.
    """

    def __init__(
        self, model: LinkageModel, extra: Mapping[str, tuple[ca.SX, ca.SX]] | None = None
    ) -> None:
        self.n = model.q.numel()
        self._tree = _coordinates(model, extra or {})
        articulated = [c.inertia for c in self._tree]
        self.k = added_inertia(model, model.W)
        # U/d by coordinate, and d in the order of q.
        self._gain: list[ca.SX] = [ca.SX(3, 1)] * self.n
        d: list[ca.SX] = [ca.SX(0)] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            U = articulated[i] @ c.S + FLOOR * self.k[c.index] * c.S
            d[c.index] = ca.dot(c.S, U)
            self._gain[i] = U / d[c.index]
            if c.parent is not None:
                passed = _across(c.S, symmetric(articulated[i] - self._gain[i] @ U.T))
                passed = _across(c.S, passed.T)
                articulated[c.parent] += symmetric(c.X.T @ passed @ c.X)
        self.d = ca.vertcat(*d)

    def solve(self, b: ca.SX) -> ca.SX:
        """a with D a = b."""
        u = self.inward(b)
        return self.outward(ca.diag(1 / self.d) @ u)

    def inward(self, b: ca.SX) -> ca.SX:
        """Remaining effort at each coordinate if those outward of it move freely, n x r."""
        p = [ca.SX(3, b.shape[1])] * self.n
        rows = [ca.SX(1, b.shape[1])] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            u = b[c.index, :] - c.S.T @ p[i]
            rows[c.index] = u
            if c.parent is not None:
                passed = p[i] + self._gain[i] @ u
                if c.S.nnz() == 1:  # S' passed = b: a joint transmits its own effort
                    passed = _across(c.S, passed) + c.S @ b[c.index, :]
                p[c.parent] = p[c.parent] + c.X.T @ passed
        return ca.vertcat(*rows)

    def outward(self, u: ca.SX) -> ca.SX:
        """Accelerations from those of each coordinate relative to an inertially fixed parent, n x
        r."""
        A: list[ca.SX] = []
        rows = [ca.SX(1, u.shape[1])] * self.n
        for i, c in enumerate(self._tree):
            before = ca.SX(3, u.shape[1]) if c.parent is None else c.X @ A[c.parent]
            a = u[c.index, :] - self._gain[i].T @ before
            A.append(before + c.S @ a)
            rows[c.index] = a
        return ca.vertcat(*rows)

    def apply(self, a: ca.SX) -> ca.SX:
        """D a."""
        r = a.shape[1]
        A: list[ca.SX] = []
        for c in self._tree:
            before = ca.SX(3, r) if c.parent is None else c.X @ A[c.parent]
            A.append(before + c.S @ a[c.index, :])
        f = [c.inertia @ A[i] for i, c in enumerate(self._tree)]
        rows = [ca.SX(1, r)] * self.n
        for i in reversed(range(self.n)):
            c = self._tree[i]
            rows[c.index] = c.S.T @ f[i]
            if c.parent is not None:
                f[c.parent] = f[c.parent] + c.X.T @ f[i]
        return ca.vertcat(*rows)


def _across(S: ca.SX, forces: ca.SX) -> ca.SX:
    """Removes the entry of forces along S, which is zero, if S is a unit vector."""
    if S.nnz() == 1:
        forces = ca.SX(forces)
        forces[S.row()[0], :] = 0
    return ca.sparsify(forces)
