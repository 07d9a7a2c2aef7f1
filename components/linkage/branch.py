"""Which assembly of its loops a linkage is on.

The loops give the rates of dependent coordinates from the others, W_d qd_d = -W_i qd_i. The
branches meet where det W_d = 0, so its sign tells them apart. Dependent are, first, the
coordinates that do not move the operational point: those that the hand cannot see fold.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.linkage.model import LinkageModel


def dependent_coordinates(
    model: LinkageModel, start: np.ndarray, unseen_first: bool = True
) -> tuple[list[int], list[int]]:
    """(rows of W, columns of W) of a regular block W_d at the start pose, by elimination.

    start: flat parameters' defaults and pose as (q, p). Redundant rows are left out. Without
    unseen_first the largest pivots alone choose, for a block far from singular.
    """
    n = model.q.numel()
    W = ca.Function("W", [model.q, model.p.vector], [model.W])
    A = np.array(W(start[:n], start[n:]), dtype=float)
    unseen = [unseen_first and not model.J_h[:, j].nnz() for j in range(n)]
    smallest = 1e-9 * np.abs(A).max()
    chosen: list[int] = []
    columns: list[int] = []
    while True:
        # Unseen coordinates first; among equals the largest pivot.
        pivots = [
            (unseen[j], abs(A[i, j]), i, j)
            for i in set(range(len(A))) - set(chosen)
            for j in set(range(n)) - set(columns)
            if abs(A[i, j]) > smallest
        ]
        if not pivots:
            break
        _, _, i, j = max(pivots)
        for k in range(len(A)):
            if k != i:
                A[k] -= A[k, j] / A[i, j] * A[i]
        chosen.append(i)
        columns.append(j)
    return sorted(chosen), sorted(columns)


def branch_sign(W: ca.SX, rows: list[int], columns: list[int]) -> ca.SX:
    """det W_d: positive on one branch, negative on the other, zero where they meet."""
    return ca.det(W[rows, columns])
