"""Directions that the joints resist at the hand, in bounded time.

Null directions of Lambda^-1 are wrenches, and its entries mix units. With S = diag(1, 1, L)
the scaled mobility S Lambda^-1 S is in 1/kg throughout; its small eigenvalues are resisted.
The report takes an SVD (B.14) at the graphics rate since SVDs have no guaranteed run time; a
fixed number of cyclic Jacobi rotations (Golub & Van Loan, Matrix Computations, section 8.5)
has one, and a 3 x 3 matrix is diagonal to rounding after five sweeps.

Small is against the largest of them, and against the same linkage's with its loops open: where
the loops lock the hand in all directions, what is left of Lambda^-1 is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Block
from hapticlink.components.dynamics.operational_space import OperationalSpace

SWEEPS = 5
TINY = 1e-300
LOCKED = 1e-10  # share of the open linkage's mobility that is rounding


def scaling(length_scale: ca.SX) -> ca.SX:
    """S = diag(1, 1, L)."""
    return ca.diag(ca.vertcat(1, 1, length_scale))


def eigen(A: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(eigenvalues 3 x 1, eigenvectors in columns 3 x 3) of a symmetric 3 x 3 matrix."""
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
    """The eigenvalue below which a direction is locked, 1/kg; open_mobility: J D^-1 J'."""
    S = scaling(length_scale)
    return LOCKED * ca.trace(S @ open_mobility @ S)


def largest(eigenvalues: ca.SX) -> ca.SX:
    return ca.fmax(ca.fmax(eigenvalues[0], eigenvalues[1]), eigenvalues[2])


def _ranks(eigenvalues: ca.SX) -> list[ca.SX]:
    """Places in ascending order (0 the smallest, ties by index)."""
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
    """Number of constrained directions: below `least`, or with a share of the largest below
    `tolerance`, times `hysteresis` for the `before` smallest, which were resisted before."""
    most, number = largest(eigenvalues), ca.SX(0)
    for i, rank in enumerate(_ranks(eigenvalues)):
        share = tolerance * ca.if_else(rank < before, hysteresis, 1)
        number += eigenvalues[i] < ca.fmax(share * most, least)
    return number


def projector(eigenvalues: ca.SX, vectors: ca.SX, number: ca.SX) -> ca.SX:
    """P_c, orthogonal projector (3 x 3, dimensionless) on the `number` smallest directions."""
    chosen = ca.vertcat(*(ca.if_else(r < number, 1, 0) for r in _ranks(eigenvalues)))
    return vectors @ ca.diag(chosen) @ vectors.T


@dataclass(frozen=True)
class ResistedDirections:
    """n_resisted at the start and after a step, and the outputs."""

    first: ca.SX
    after: ca.SX
    output: dict[str, ca.SX]


def resisted_directions(
    block: Block, space: OperationalSpace, q0: ca.SX, q1: ca.SX
) -> ResistedDirections:
    """For a block with state n_resisted that starts at q0 and steps from q to q1."""
    p, before, q = block.p, block.x["n_resisted"], space.model.q
    S = scaling(p["length_scale"])
    least = locked(space.open_mobility, p["length_scale"])
    scaled = ca.Function(
        "scaled", [q, block.u.vector, p.vector], [S @ space.Lambda_inv @ S, least], {"cse": True}
    )
    tolerance, hysteresis = p["rank_tolerance"], p["hysteresis"]

    def number(at: ca.SX, before: ca.SX) -> ca.SX:
        mobility, least = scaled(at, block.u.vector, p.vector)
        return count(eigen(mobility)[0], before, tolerance, hysteresis, least)

    now, vectors = eigen(scaled(q, block.u.vector, p.vector)[0])
    return ResistedDirections(
        first=number(q0, ca.SX(0)),
        after=number(q1, before),
        output={
            "P_c": projector(now, vectors, before),
            "n_constraints": before,
        },
    )
