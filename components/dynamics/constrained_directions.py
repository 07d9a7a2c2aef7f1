"""Constrained directions at the operational point, in bounded time.

Null directions of Lambda^-1 are wrenches, and its entries have different units. With
S = diag(1, 1, L) all entries of the scaled mobility S Lambda^-1 S are in 1/kg; the eigenvectors of
its small eigenvalues are the constrained directions.
The report takes an SVD (B.14) at the graphics rate since SVDs have no guaranteed run time; a
fixed number of cyclic Jacobi rotations (Golub & Van Loan, Matrix Computations, section 8.5)
has one, and a 3 x 3 matrix (the plane's) is diagonal to rounding after five sweeps.

Small is relative to the largest eigenvalue, and to those of the same linkage with open loops: where
the loops lock the operational point in all directions, Lambda^-1 consists of rounding errors.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import casadi as ca

from hapticlink.components.component import Block
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.rendered_directions import WHOLE, RenderedDirections
from hapticlink.components.port_space import PortSpace

SWEEPS = 5
TINY = 1e-300
LOCKED = 1e-10  # relative to the open linkage's mobility, below which Lambda^-1 is rounding


def scaling(space: PortSpace, length_scale: ca.SX) -> ca.SX:
    """S, diag(1, 1, L) in the plane."""
    return ca.diag(ca.vertcat(*space.scaling(length_scale)))


def eigen(A: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Eigenvalues (n x 1) and eigenvectors (columns, n x n) of a symmetric n x n matrix."""
    A, n = ca.SX(A), A.shape[0]
    V = ca.densify(ca.SX.eye(n))
    for _ in range(SWEEPS):
        for i, j in combinations(range(n), 2):
            gap, twice = A[j, j] - A[i, i], 2 * A[i, j]
            sign = ca.if_else(gap < 0, -1, 1)
            tangent = sign * twice / (ca.fabs(gap) + ca.sqrt(gap**2 + twice**2) + TINY)
            c = 1 / ca.sqrt(1 + tangent**2)
            s = c * tangent
            G = ca.SX.eye(n)
            G[i, i], G[j, j], G[i, j], G[j, i] = c, c, s, -s
            A = G.T @ A @ G
            V = V @ G
    return ca.diag(A), V


def locking_threshold(open_mobility: ca.SX) -> ca.SX:
    """The eigenvalue (1/kg) below which a direction is locked, from S J D^-1 J' S of the linkage
    with open loops."""
    return LOCKED * ca.trace(open_mobility)


def largest(eigenvalues: ca.SX) -> ca.SX:
    return reduce(ca.fmax, ca.vertsplit(eigenvalues))


def _ranks(eigenvalues: ca.SX) -> list[ca.SX]:
    """The rank of each eigenvalue in ascending order (0 is the smallest, ties by index)."""
    ranks, n = [], eigenvalues.numel()
    for i in range(n):
        below = [
            eigenvalues[j] < eigenvalues[i] if j > i else eigenvalues[j] <= eigenvalues[i]
            for j in range(n)
            if j != i
        ]
        ranks.append(reduce(operator.add, below) if below else ca.SX(0))
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


def is_among_smallest(eigenvalues: ca.SX, number: ca.SX) -> ca.SX:
    """1 for each of the `number` smallest eigenvalues, 0 for the others (n x 1)."""
    return ca.vertcat(*(ca.if_else(r < number, 1, 0) for r in _ranks(eigenvalues)))


def projector(eigenvalues: ca.SX, vectors: ca.SX, number: ca.SX) -> ca.SX:
    """P_c, the orthogonal projector (n x n, dimensionless) on the eigenvectors of the `number`
    smallest eigenvalues."""
    return vectors @ ca.diag(is_among_smallest(eigenvalues, number)) @ vectors.T


@dataclass(frozen=True)
class Points:
    """The number of the operational point at the start and over a step, and whether it changes: the
    directions at another point are counted without hysteresis."""

    first: ca.SX
    after: ca.SX
    changes: ca.SX


@dataclass(frozen=True)
class ConstrainedDirections:
    """The state n_constrained at the start and after a step, and the outputs; `scaled_by`, the rows
    S R with which the scaled mobility is S R Lambda^-1 R' S, and of that the eigenvalues and
    eigenvectors, of which P_c has the `number` smallest."""

    first: ca.SX
    after: ca.SX
    output: dict[str, ca.SX]
    rendered: RenderedDirections
    scaled_by: ca.SX
    values: ca.SX
    vectors: ca.SX
    number: ca.SX


def constrained_directions(
    block: Block,
    space: OperationalSpace,
    q0: ca.SX,
    q1: ca.SX,
    J: ca.SX | None = None,
    prefix: str = "",
    points: Points | None = None,
    rendered: RenderedDirections = WHOLE,
) -> ConstrainedDirections:
    """The constrained directions of a block with the state n_constrained that starts at q0 and
    steps from q to q1: at the operational point, or at a point with Jacobian J, whose names have
    the prefix. points: of an operational point that changes.
    rendered: those of the device at the point, among which directions are constrained."""
    p, before, q = block.p, block.x[f"{prefix}n_constrained"], space.model.q
    own = [] if space.model.point is None else [space.model.point]
    S = rendered.pick_matrix(scaling(space.model.linkage.space, p["length_scale"]))
    whole = space.Lambda_inv if J is None else space.mobility(J)
    mobility = rendered.mobility(whole)
    opened = rendered.mobility(space.open_mobility(space.terms.J_h if J is None else J))
    given, both = (
        (block.u.vector, p.vector, *own),
        [S @ mobility @ S, locking_threshold(S @ opened @ S)],
    )
    scaled = ca.Function("scaled", [q, *given], both, {"cse": True})
    tolerance, hysteresis = p["rank_tolerance"], p["hysteresis"]

    def number(q: ca.SX, before: ca.SX, *point: ca.SX) -> ca.SX:
        mobility, least = scaled(q, block.u.vector, p.vector, *point)
        return count(eigen(mobility)[0], before, tolerance, hysteresis, least)

    found = (*eigen(scaled(q, *given)[0]), before)
    P_c = rendered.put_matrix(projector(*found))
    output = {f"{prefix}P_c": P_c, f"{prefix}n_constraints": before}
    first, after = own, own
    if points:
        first, after = [points.first], [points.after]
        before = ca.if_else(points.changes, 0, before)
    numbers = number(q0, ca.SX(0), *first), number(q1, before, *after)
    scaled_by = S @ rendered.reduction(whole)
    return ConstrainedDirections(*numbers, output, rendered, scaled_by, *found)
