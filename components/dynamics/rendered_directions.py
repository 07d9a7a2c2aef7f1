"""The directions of a port in which a device moves and gives force: all of them, or, in the plane,
fewer where it has fewer motors.

E, (k, 3), selects them, y = E x. With Lambda^-1 the mobility at the operational point, split into
E's directions and theta, the acceleration of the point in the k directions is R (Lambda^-1 F +
a_bias),

    held     R = E                                   all directions
    free     R = E                                   a point: the angle belongs to nobody
    fixed    R = E - Lambda^-1_yt/Lambda^-1_tt t'    the device holds the angle, t' theta = 0

so that the mobility felt is R Lambda^-1 E': with the angle fixed that of the point whose body does
not turn, L_yy - L_yt L_tt^-1 L_ty. What the hand does in the other directions the device's bearings
take: it reaches neither device nor mechanism.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.device import Handle

if TYPE_CHECKING:  # what is printed of a run needs no equations
    import casadi as ca

THETA = 2
"""The entry of a pose that is an angle."""
LEAST = 1e-12
"""Lambda^-1_tt (1/(kg.m2)) up to which a body cannot turn."""


@dataclass(frozen=True)
class RenderedDirections:
    """E by its rows, whether the device holds the angle, and the space of the port."""

    rows: tuple[tuple[float, ...], ...]
    is_angle_fixed: bool = False
    space: PortSpace = PLANE

    @property
    def size(self) -> int:
        """k."""
        return len(self.rows)

    @property
    def whole(self) -> bool:
        """Whether all directions of the port are rendered."""
        return self.size == self.space.size

    @property
    def lengths(self) -> int:
        """The number of those that are lengths, which are the first."""
        return self.size - self.has_moments

    @property
    def has_moments(self) -> bool:
        """Whether moments are rendered."""
        return any(
            entry and turns
            for r in self.rows
            for entry, turns in zip(r, self.space.turns, strict=True)
        )

    @property
    def compared(self) -> NDArray[np.float64]:
        """The projector (3, 3) on what handle and point have in common: what is rendered, and an
        angle that the device holds."""
        E = np.array(self.rows)
        common: NDArray[np.float64] = E.T @ E
        if self.is_angle_fixed:
            common[THETA, THETA] = 1.0
        return common

    @cached_property
    def E(self) -> ca.DM:
        import casadi as ca

        return ca.DM(self.rows)

    def pick(self, vector: Any) -> Any:
        """E x, (k,), of a pose, a twist or a wrench (3,)."""
        return vector if self.whole else self.E @ vector

    def put(self, vector: Any) -> Any:
        """E' y, (3,), with 0 in the directions that are not rendered."""
        return vector if self.whole else self.E.T @ vector

    def mask(self, vector: Any) -> Any:
        """E' E x: without what is not rendered."""
        return self.put(self.pick(vector))

    def coupled(self, wrench: Any) -> Any:
        """Of the virtual coupling's wrench (3,) what acts on the mechanism: without that of an
        angle or a direction that belongs to nobody; an angle that is fixed pulls."""
        return wrench if self.is_angle_fixed else self.mask(wrench)

    def pose(self, y: Any, other: Any) -> Any:
        """The pose (3,) with E x = y, and the rest that of another one."""
        return y if self.whole else self.put(y) + (other - self.mask(other))

    def put_matrix(self, matrix: Any) -> Any:
        """E' A E, (3, 3), of A (k, k)."""
        return matrix if self.whole else self.E.T @ matrix @ self.E

    def pick_matrix(self, matrix: Any) -> Any:
        """E A E', (k, k), of A (3, 3)."""
        return matrix if self.whole else self.E @ matrix @ self.E.T

    def pick_diagonal(self, diagonal: Any) -> Any:
        """That of E diag(d) E', (k,), of stiffnesses or masses d (3,)."""
        import casadi as ca

        return diagonal if self.whole else ca.diag(self.pick_matrix(ca.diag(diagonal)))

    def reduction(self, Lambda_inv: ca.SX) -> Any:
        """R, (k, 3)."""
        import casadi as ca

        if self.whole:
            return ca.SX.eye(self.size)
        if not self.is_angle_fixed:
            return ca.SX(self.E)
        turn = Lambda_inv[THETA, THETA]
        turns = turn > LEAST
        per_turn = ca.if_else(turns, 1 / ca.if_else(turns, turn, 1), 0)
        R = ca.densify(ca.SX(self.E))
        R[:, THETA] = -(self.E @ Lambda_inv[:, THETA]) * per_turn
        return R

    def felt_mobility(self, Lambda_inv: NDArray[np.float64]) -> NDArray[np.float64]:
        """In numbers, (3, 3): the mobility with the angle held that the device holds."""
        if not self.is_angle_fixed or Lambda_inv[THETA, THETA] <= LEAST:
            return Lambda_inv
        across = Lambda_inv[:, THETA]
        held: NDArray[np.float64] = Lambda_inv - np.outer(across, across) / across[THETA]
        return held

    def acceleration(self, Lambda_inv: ca.SX, a: ca.SX) -> Any:
        """R a, (k,), of an acceleration (3,) of the free operational point."""
        return a if self.whole else self.reduction(Lambda_inv) @ a

    def mobility(self, Lambda_inv: ca.SX) -> Any:
        """R Lambda^-1 R', which is R Lambda^-1 E', (k, k)."""
        if self.whole:
            return Lambda_inv
        R = self.reduction(Lambda_inv)
        return R @ Lambda_inv @ R.T


def _whole(space: PortSpace) -> RenderedDirections:
    return RenderedDirections(tuple(map(tuple, np.eye(space.size).tolist())), space=space)


WHOLE = _whole(PLANE)


def rendered_directions(handle: Handle | None, space: PortSpace = PLANE) -> RenderedDirections:
    """Those of a device's handle; None stands for a handle that is held."""
    if handle is None or handle.angle == "held":
        return _whole(space)
    if handle.along is not None:
        length = math.hypot(*handle.along)
        x, y = (entry / length for entry in handle.along)
        rows: tuple[tuple[float, ...], ...] = ((x, y, 0.0),)
    else:
        rows = WHOLE.rows[:THETA]
    return RenderedDirections(rows, handle.angle == "fixed")
