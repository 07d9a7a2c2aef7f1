"""Determines on which assembly (branch) of its loops a linkage is.

The loops determine the rates of dependent coordinates, W_d qd_d = -W_i qd_i. Branches meet where
det W_d = 0, so its sign distinguishes them. Coordinates that do not move the operational point are
made dependent first, since these are the ones that fold unnoticed.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.linkage.model import LinkageModel


def dependent_coordinates(model: LinkageModel, start: np.ndarray) -> tuple[list[int], list[int]]:
    """Rows and columns of W that form a regular block W_d at the start pose.

    start: the pose and the flat default parameters, (q, p).
    """
    n = model.q.numel()
    W = ca.Function("W", [model.q, model.p.vector], [model.W])
    return choose_dependent(model, np.array(W(start[:n], start[n:]), dtype=float))


def choose_dependent(model: LinkageModel, W: np.ndarray) -> tuple[list[int], list[int]]:
    """Rows and columns of W, (m, n), that form a regular block, by elimination. Redundant rows are
    left out."""
    n, A = model.q.numel(), W.copy()
    unseen = [not model.J_h[:, j].nnz() for j in range(n)]
    smallest = 1e-9 * np.abs(A).max(initial=0.0)
    chosen: list[int] = []
    columns: list[int] = []
    while True:
        # Coordinates that do not move the operational point first, then the largest pivot.
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
