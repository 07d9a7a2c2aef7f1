"""The growth of x_{k+1} = A_k x_k, where A_k is one of several matrices.

Each matrix leads from a node to a node: what may follow depends on the node alone. With one node,
any sequence may occur.

    joint spectral radius   the fastest growth per matrix of any sequence; between the largest
                            rho(P)^(1/k) of closed products of k matrices, and a bound by norms
    mean square             rho of X_j -> sum p A X_i A' over the matrices i -> j, drawn at random
                            with probabilities p: E|x|^2 decays if it is below 1
    Lyapunov exponent       lim ln|x_k|/t_k, almost surely, estimated on a drawn sequence
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import matrix_balance, solve_triangular
from scipy.sparse.linalg import LinearOperator, eigs
from scipy.stats import t as student

from hapticlink.orchestrator.base.arrays import Matrix

BATCHES = 40
CONFIDENCE = 0.95
ROUNDING = 1e-12
"""Of the spectral radius of a product, relative."""
DENSE = 600
"""Largest number of second moments whose map is written as a matrix."""


@dataclass(frozen=True)
class Edge:
    """A matrix A (n, n) from node `start` to node `end`; it is taken with the `probability` there,
    and lasts `seconds`."""

    start: int
    end: int
    A: Matrix
    probability: float = 1.0
    seconds: float = 1.0


@dataclass(frozen=True)
class Bounds:
    """lower <= joint spectral radius <= upper; `worst`: the edges of a product that attains
    `lower`."""

    lower: float
    upper: float
    worst: tuple[int, ...]


def joint_spectral_radius(
    edges: Sequence[Edge], tolerance: float = 1e-6, products: int = 100_000
) -> Bounds:
    """Bounds of the joint spectral radius, at most `tolerance` apart unless that takes more than
    `products`: branch and bound of Gripenberg, Linear Algebra Appl. 234 (1996), 43, in ellipsoidal
    norms. A product is continued while all its beginnings P of i matrices have
    |P|^(1/i) > lower + tolerance."""
    scaled = _in_good_norms(edges)
    after: dict[int, list[int]] = {}
    for i, edge in enumerate(edges):
        after.setdefault(edge.start, []).append(i)
    lower = 0.0
    worst: tuple[int, ...] = ()
    level: list[tuple[Matrix, float, tuple[int, ...], float]] = [
        (*_normed(A), (i,), float(np.linalg.norm(A, 2))) for i, A in enumerate(scaled)
    ]
    upper, spent = max(bound for *_, bound in level), len(level)
    while level:
        for P, size, path, _ in level:
            if edges[path[0]].start == edges[path[-1]].end:
                found = float(np.abs(np.linalg.eigvals(P)).max())
                found **= 1 / len(path)
                found *= np.exp(size / len(path))
                if found > lower * (1.0 + ROUNDING):  # a shorter product has the same otherwise
                    lower, worst = found, path
        level = [each for each in level if each[-1] > lower + tolerance]
        upper = min(upper, max([lower + tolerance, *(bound for *_, bound in level)]))
        children = sum(len(after[edges[path[-1]].end]) for _, _, path, _ in level)
        if not level or spent + children > products:
            break
        spent += children
        longer = []
        for P, size, path, bound in level:
            for i in after[edges[path[-1]].end]:
                Q, grown = _normed(scaled[i] @ P)
                grown += size
                longer.append((Q, grown, (*path, i), min(bound, np.exp(grown / (len(path) + 1)))))
        level = longer
    return Bounds(lower, max(lower, upper), worst)


def _normed(P: Matrix) -> tuple[Matrix, float]:
    """P/|P| and ln |P|, since long products leave the range of doubles; 0 and -inf for P = 0."""
    size = float(np.linalg.norm(P, 2))
    return (P / size, float(np.log(size))) if size else (P, -np.inf)


def _in_good_norms(edges: Sequence[Edge], rounds: int = 60) -> list[Matrix]:
    """The matrices in coordinates, one set a node, in which their largest norm is small: those of
    the quadratic forms X_i = sum w A' X_j A, with weights w that grow for the larger ones."""
    n = len(edges[0].A)
    nodes = sorted({node for e in edges for node in (e.start, e.end)})
    weights = np.ones(len(edges))
    best, least = [e.A for e in edges], max(np.linalg.norm(e.A, 2) for e in edges)
    X = {node: np.eye(n) for node in nodes}
    for _ in range(rounds):
        for _ in range(10):
            Y = {node: np.zeros((n, n)) for node in nodes}
            for w, e in zip(weights, edges, strict=True):
                Y[e.start] += w * e.A.T @ X[e.end] @ e.A
            size = max(np.trace(y) for y in Y.values()) / n
            if not size > 0.0:
                return best
            X = {node: y / size for node, y in Y.items()}
        floor = 1e-10 * size * np.eye(n)
        roots = {node: np.linalg.cholesky(x + floor / size) for node, x in X.items()}
        made = [
            solve_triangular(roots[e.start], (roots[e.end].T @ e.A).T, lower=True).T for e in edges
        ]
        norms = np.array([np.linalg.norm(A, 2) for A in made])
        if norms.max() < least:
            best, least = made, norms.max()
        weights *= (norms / norms.max()) ** 0.5 + 1e-12
    return best


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
    found = eigs(map_, k=1, which="LR", v0=start, return_eigenvectors=False)
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
    width = float(student.ppf((1 + CONFIDENCE) / 2, BATCHES - 1) * rates.std(ddof=1))
    return mean, width / BATCHES**0.5
