"""Products with D and D^-1 of a tree in O(n): the articulated-body recursion.

Featherstone, Rigid Body Dynamics Algorithms (2008), sections 5.3 and 7.3. Spatial vectors,
(omega, v_x, v_y) in the plane and (omega, v) in space, are expressed in the world's axes at the
coordinate's own joint point; X transforms them from the parent's point, and X' transforms forces
back (so a revolute S in the plane is (1, 0, 0), and a mechanism far from the origin loses no
accuracy):

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
    """X with (v, omega) at an offset r (m) = X (omega, v) here."""
    d = r.numel()
    across = ca.vertcat(-r[1], r[0]) if d == 2 else -ca.skew(r)  # omega x r
    turns = ca.SX.eye(across.shape[1])
    both = ca.horzcat(across, ca.SX.eye(d)), ca.horzcat(turns, ca.SX(turns.shape[0], d))
    return ca.sparsify(ca.vertcat(*both))


def _shift(r: ca.SX) -> ca.SX:
    """X with (omega, v) at an offset r (m) = X (omega, v) here."""
    d, X = r.numel(), to_point(r)
    return ca.vertcat(X[d:, :], X[:d, :])


def symmetric(A: ca.SX) -> ca.SX:
    """A symmetric matrix from its lower triangle, so that the upper one is not computed."""
    return ca.tril2symm(ca.tril(A))


def _coordinates(model: LinkageModel, extra: Mapping[str, tuple[ca.SX, ca.SX]]) -> list[Coordinate]:
    """The coordinates from the ground outward; a body's inertia belongs to the last coordinate of
    its joint."""
    coordinates: list[Coordinate] = []
    tip: dict[str, tuple[int | None, ca.SX]] = {"ground": (None, ca.SX(model.d, 1))}
    for joint in model.outward:
        body = joint.child
        pivot, twists = model.twists(joint)
        size = twists[0].numel()
        parent, before = tip[joint.parent]
        X = to_point(model.centers[body] - pivot)
        mass = [model.p[f"{body}.mass"]] * model.d
        M = ca.diagcat(*mass, _in_world(model, body))
        own = symmetric(X.T @ M @ X)
        if body in extra:
            point, K = extra[body]
            X = to_point(point - pivot)
            own = own + symmetric(X.T @ K @ X)
        for k, S in enumerate(twists):
            last = k == len(twists) - 1
            shift = _shift(pivot - before) if k == 0 else ca.SX.eye(size)
            index = model.coordinate(joint.name) + k
            none = ca.SX(size, size)
            coordinates.append(Coordinate(index, parent, shift, S, own if last else none))
            parent = len(coordinates) - 1
        tip[joint.child] = parent, pivot
    return coordinates


def _in_world(model: LinkageModel, body: str) -> ca.SX:
    """The inertia of a body about its centre of mass in the world's axes: 1 x 1 in the plane, else
    3 x 3."""
    inertia, rotation = model.inertia(body), model.frames[body].rotation
    if inertia.numel() == 1:
        return inertia if model.d == 2 else inertia * ca.SX.eye(3)
    return symmetric(rotation @ inertia @ rotation.T)


class TreeInertia:
    """D + sum over bodies of J_b' K_b J_b, as an operator on n x r matrices.

    extra: for a body, a point (m, in the world) and the symmetric K_b for (v, omega) there.
    """

    def __init__(
        self, model: LinkageModel, extra: Mapping[str, tuple[ca.SX, ca.SX]] | None = None
    ) -> None:
        self.n = model.q.numel()
        self._tree = _coordinates(model, extra or {})
        articulated = [c.inertia for c in self._tree]
        self.k = added_inertia(model, model.W)
        # U/d by coordinate, and d in the order of q.
        size = self._size = self._tree[0].S.numel() if self._tree else 0
        self._gain: list[ca.SX] = [ca.SX(size, 1)] * self.n
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
        p = [ca.SX(self._size, b.shape[1])] * self.n
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
            before = ca.SX(self._size, u.shape[1]) if c.parent is None else c.X @ A[c.parent]
            a = u[c.index, :] - self._gain[i].T @ before
            A.append(before + c.S @ a)
            rows[c.index] = a
        return ca.vertcat(*rows)

    def apply(self, a: ca.SX) -> ca.SX:
        """D a."""
        r = a.shape[1]
        A: list[ca.SX] = []
        for c in self._tree:
            before = ca.SX(self._size, r) if c.parent is None else c.X @ A[c.parent]
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
