"""The growth of x_{k+1} = A_k x_k, where A_k is one of several matrices.

Each matrix leads from a node to a node: what may follow depends on the node alone.

    mean square             rho of X_j -> sum p A X_i A' over the matrices i -> j, drawn at random
                            with probabilities p: E|x|^2 decays if it is below 1
    Lyapunov exponent       lim ln|x_k|/t_k, almost surely, estimated on a drawn sequence
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import matrix_balance
from scipy.sparse.linalg import LinearOperator, eigs
from scipy.special import stdtrit

from hapticlink.orchestrator.base.arrays import Matrix

BATCHES = 40
CONFIDENCE = 0.95
DENSE = 600
"""Largest number of second moments whose map is written as a matrix."""
KRYLOV = 80
"""Dimension of the Krylov space: with SciPy's 20 a complex pair nearby was returned instead."""


@dataclass(frozen=True)
class Edge:
    """A matrix A (n, n) from node `start` to node `end`; it is taken with the `probability` there,
    and lasts `seconds`."""

    start: int
    end: int
    A: Matrix
    probability: float = 1.0
    seconds: float = 1.0


def mean_square(edges: Sequence[Edge]) -> float:
    """The spectral radius of the map of second moments. Costa, Fragoso, Marques, Discrete-Time
    Markov Jump Linear Systems (2005), section 3.3. It maps positive semidefinite X to such, so that
    its radius is an eigenvalue, the one with the largest real part (Krein, Rutman): no power method
    finds it, since others may be as large."""
    n = len(edges[0].A)
    nodes = sorted({node for e in edges for node in (e.start, e.end)})
    sizes = sum(np.abs(e.A) for e in edges)
    scale = matrix_balance(sizes, permute=False, separate=True)[1][0]
    balanced = [e.A * scale / scale[:, None] for e in edges]

    def moved(x: Matrix) -> Matrix:
        X = dict(zip(nodes, x.reshape(len(nodes), n, n), strict=True))
        Y = {node: np.zeros((n, n)) for node in nodes}
        for e, A in zip(edges, balanced, strict=True):
            Y[e.end] += e.probability * A @ X[e.start] @ A.T
        return np.concatenate([Y[node].ravel() for node in nodes])

    size = len(nodes) * n * n
    if size <= DENSE:
        return float(np.abs(np.linalg.eigvals(np.stack([*map(moved, np.eye(size))]))).max())
    start = np.tile(np.eye(n).ravel(), len(nodes))
    if not moved(start).any():
        return 0.0
    map_ = LinearOperator((size, size), moved)
    found = eigs(map_, k=1, which="LR", v0=start, ncv=KRYLOV, return_eigenvectors=False)
    return float(found[0].real)


def lyapunov(edges: Sequence[Edge], seed: int = 0, steps: int = 20_000) -> tuple[float, float]:
    """The Lyapunov exponent (1/s) of a sequence that is drawn by numpy's PCG64 with `seed`, and the
    half-width of its 95 % confidence interval, from the means of 40 batches."""
    generator = np.random.Generator(np.random.PCG64(seed))
    after: dict[int, list[Edge]] = {}
    for edge in edges:
        after.setdefault(edge.start, []).append(edge)
    node, x = edges[0].start, generator.standard_normal(len(edges[0].A))
    chances = {k: np.cumsum([e.probability for e in v]) for k, v in after.items()}
    logs, times = np.zeros((2, BATCHES + 1))
    for k in range((BATCHES + 1) * (steps // BATCHES)):
        drawn = np.searchsorted(chances[node], generator.random() * chances[node][-1])
        edge = after[node][int(drawn)]
        x = edge.A @ x
        size = float(np.linalg.norm(x))
        if size == 0.0:
            return -np.inf, 0.0
        batch = k // (steps // BATCHES)
        logs[batch] += np.log(size)
        times[batch] += edge.seconds
        x, node = x / size, edge.end
    rates = logs[1:] / times[1:]  # the first batch finds the direction
    mean = float(logs[1:].sum() / times[1:].sum())
    width = float(stdtrit(BATCHES - 1, (1 + CONFIDENCE) / 2) * rates.std(ddof=1))
    return mean, width / BATCHES**0.5
