"""Constrained directions at the operational point, in bounded time.

Null directions of Lambda^-1 are wrenches, and its entries have different units. With
S = diag(1, 1, L) all entries of the scaled mobility S Lambda^-1 S are in 1/kg; the eigenvectors of
its small eigenvalues are the constrained directions.
The report takes an SVD (B.14) at the graphics rate since SVDs have no guaranteed run time; a
fixed number of cyclic Jacobi rotations (Golub & Van Loan, Matrix Computations, section 8.5)
has one, and a 3 x 3 matrix is diagonal to rounding after five sweeps.

Small is relative to the largest eigenvalue, and to those of the same linkage with open loops: where
the loops lock the operational point in all directions, Lambda^-1 consists of rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Block
from hapticlink.components.dynamics.operational_space import OperationalSpace

SWEEPS = 5
TINY = 1e-300
LOCKED = 1e-10  # relative to the open linkage's mobility, below which Lambda^-1 is rounding


def scaling(length_scale: ca.SX) -> ca.SX:
    """S = diag(1, 1, L)."""
    return ca.diag(ca.vertcat(1, 1, length_scale))


def eigen(A: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Eigenvalues (3 x 1) and eigenvectors (columns, 3 x 3) of a symmetric 3 x 3 matrix."""
    A, V = ca.SX(A), ca.SX.eye(3)
    V = ca.densify(V)
    for _ in range(SWEEPS):
        for i, j in ((0, 1), (0, 2), (1, 2)):
            gap, twice = A[j, j] - A[i, i], 2 * A[i, j]
            sign = ca.if_else(gap < 0, -1, 1)
            tangent = sign * twice / (ca.fabs(gap) + ca.sqrt(gap**2 + twice**2) + TINY)
            c = 1 / ca.sqrt(1 + tangent**2)
            s = c * tangent
            G = ca.SX.eye(3)
            G[i, i], G[j, j], G[i, j], G[j, i] = c, c, s, -s
            A = G.T @ A @ G
            V = V @ G
    return ca.diag(A), V


def locked(open_mobility: ca.SX, length_scale: ca.SX) -> ca.SX:
    """The eigenvalue (1/kg) below which a direction is locked; open_mobility is J D^-1 J'."""
    S = scaling(length_scale)
    return LOCKED * ca.trace(S @ open_mobility @ S)


def largest(eigenvalues: ca.SX) -> ca.SX:
    return ca.fmax(ca.fmax(eigenvalues[0], eigenvalues[1]), eigenvalues[2])


def _ranks(eigenvalues: ca.SX) -> list[ca.SX]:
    """The rank of each eigenvalue in ascending order (0 is the smallest, ties by index)."""
    ranks = []
    for i in range(3):
        below = [
            eigenvalues[j] < eigenvalues[i] if j > i else eigenvalues[j] <= eigenvalues[i]
            for j in range(3)
            if j != i
        ]
        ranks.append(below[0] + below[1])
    return ranks


def count(
    eigenvalues: ca.SX,
    before: ca.SX,
    tolerance: ca.SX,
    hysteresis: ca.SX,
    least: ca.SX | float = TINY,
) -> ca.SX:
    """Number of constrained directions: those with an eigenvalue below `least` or below `tolerance`
    times the largest one; for the `before` smallest, which were constrained before, `tolerance` is
    multiplied by `hysteresis`."""
    most, number = largest(eigenvalues), ca.SX(0)
    for i, rank in enumerate(_ranks(eigenvalues)):
        share = tolerance * ca.if_else(rank < before, hysteresis, 1)
        number += eigenvalues[i] < ca.fmax(share * most, least)
    return number


def projector(eigenvalues: ca.SX, vectors: ca.SX, number: ca.SX) -> ca.SX:
    """P_c, the orthogonal projector (3 x 3, dimensionless) on the eigenvectors of the `number`
    smallest eigenvalues."""
    chosen = ca.vertcat(*(ca.if_else(r < number, 1, 0) for r in _ranks(eigenvalues)))
    return vectors @ ca.diag(chosen) @ vectors.T


@dataclass(frozen=True)
class ConstrainedDirections:
    """The state n_constrained at the start and after a step, and the outputs."""

    first: ca.SX
    after: ca.SX
    output: dict[str, ca.SX]


def constrained_directions(
    block: Block,
    space: OperationalSpace,
    q0: ca.SX,
    q1: ca.SX,
    J: ca.SX | None = None,
    prefix: str = "",
) -> ConstrainedDirections:
    """The constrained directions of a block with the state n_constrained that starts at q0 and
    steps from q to q1: at the operational point, or at a point with Jacobian J, whose names have
    the prefix."""
    p, before, q = block.p, block.x[f"{prefix}n_constrained"], space.model.q
    S = scaling(p["length_scale"])
    mobility = space.Lambda_inv if J is None else space.mobility(J)
    least = locked(space.open_mobility(space.terms.J_h if J is None else J), p["length_scale"])
    given = block.u.vector, p.vector
    scaled = ca.Function("scaled", [q, *given], [S @ mobility @ S, least], {"cse": True})
    tolerance, hysteresis = p["rank_tolerance"], p["hysteresis"]

    def number(q: ca.SX, before: ca.SX) -> ca.SX:
        mobility, least = scaled(q, *given)
        return count(eigen(mobility)[0], before, tolerance, hysteresis, least)

    output = {
        f"{prefix}P_c": projector(*eigen(scaled(q, *given)[0]), before),
        f"{prefix}n_constraints": before,
    }
    return ConstrainedDirections(number(q0, ca.SX(0)), number(q1, before), output)
