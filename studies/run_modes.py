"""The modes that a run shows.

Snapshots y_k, the same signals a period P apart, are those of a linear system, y_{k+1} = A y_k, and
the eigenvalues z of A between the directions that the snapshots have are fitted to them (dynamic
mode decomposition: Schmid, J. Fluid Mechanics 656 (2010), 5). The rate of a mode is ln|z|/P. Each
pair of snapshots is divided by the size of the first one, so that the last ones count as much.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
RANK = 1e-4
"""Directions of snapshots, relative to the largest, that are none."""


def fit_modes(snapshots: Array, most: int | None = None) -> tuple[Array, Array]:
    """The eigenvalues of the system that takes each snapshot (a row) to the next one, and the share
    of each mode in the last of them; of `most` directions, and of half as many as there are
    snapshots."""
    scale = np.linalg.norm(snapshots[:-1], axis=1)
    X, Y = (part.T / scale for part in (snapshots[:-1], snapshots[1:]))
    U, S, V = np.linalg.svd(X, full_matrices=False)
    kept = min(np.count_nonzero(S / S[0] > RANK), max(1, len(scale) // 2), most or len(S))
    U = U[:, :kept]
    z, v = np.linalg.eig(U.T @ Y @ V[:kept].T / S[:kept])
    last = U.T @ snapshots[-1]
    parts = np.linalg.lstsq(v, last.astype(complex), rcond=None)[0]
    return z, np.abs(parts) / max(float(np.linalg.norm(last)), 1e-300)
