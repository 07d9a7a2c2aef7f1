"""Absolute stability: the damping that a multiport is short of, to be stable with any passive
terminations that know nothing of each other.

A multiport with the impedance Z (F = Z v) at one frequency has its entries in blocks, one for each
termination. Passive impedances Z_i that make it oscillate exist if and only if some flows v have
Re v_i*(Z v)_i <= 0 in every block i: each then is a map from v_i to -(Z v)_i. These are Hermitian
forms of v; the values of two of them form a convex set (Toeplitz, Hausdorff), so that no such v
exists if and only if a positive combination is positive definite, for one scale d_i > 0 a block:

    D Z D^-1 + (D Z D^-1)* > 0,   D = diag(d_1 I, d_2 I, ...)

For two blocks of one entry each that is Llewellyn's condition (Proc. IRE 40 (1952), 271)

    Re z_11 >= 0,   Re z_22 >= 0,   2 Re z_11 Re z_22 >= |z_12 z_21| + Re(z_12 z_21)

and for more than two blocks it is sufficient: the bound of the structured singular value of the
scattering matrix by scales (Packard, Doyle, Automatica 29 (1993), 71). Dampers b on all entries add
b I to Z, so that the damping shortage is

    b = -max over D of the least eigenvalue of (D Z D^-1 + (D Z D^-1)*)/2
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from hapticlink.orchestrator.base.arrays import Complex, Vector

SPAN = 8.0
"""Of ln d to both sides of the scale that makes two blocks act equally on each other."""
ITERATIONS = 30
"""Of the search for more than two scales; fewer give a larger bound."""


def least(Z: Complex) -> float:
    """The least b with which Z + b I is passive, also a negative one."""
    return -float(np.linalg.eigvalsh((Z + Z.conj().T) / 2)[0])


def damping_shortage_of_two(Z: Complex, k: int) -> tuple[float, float]:
    """The damping shortage: the least b with which Z + b I is absolutely stable, the first k
    entries being one block and the others the second; and ln d of the first."""
    there, back = (max(float(np.linalg.norm(X)), 1e-300) for X in (Z[:k, k:], Z[k:, :k]))
    middle = (np.log(back) - np.log(there)) / 2

    def shortage(s: float) -> float:
        scaled = Z.copy()
        scaled[:k, k:] *= np.exp(s)
        scaled[k:, :k] *= np.exp(-s)
        return least(scaled)

    bounds = middle - SPAN, middle + SPAN
    best = minimize_scalar(shortage, bounds=bounds, method="bounded", options={"xatol": 1e-8})
    return float(best.fun), float(best.x)


def damping_shortage(Z: Complex, sizes: Sequence[int], start: Vector | None = None) -> float:
    """A b with which Z + b I is absolutely stable for blocks of `sizes`: an upper bound of the
    damping shortage. The search for the least one starts from ln d = `start`."""
    block = np.repeat(np.arange(len(sizes)), sizes)

    def shortage(s: Vector) -> tuple[float, Vector]:
        d = np.exp(s)[block]
        scaled = d[:, None] * Z / d
        values, vectors = np.linalg.eigh((scaled + scaled.conj().T) / 2)
        v = vectors[:, 0]
        slope = (v.conj() * (scaled @ v) - (scaled.conj().T @ v).conj() * v).real
        return -float(values[0]), -np.bincount(block, slope).astype(float)

    s = np.zeros(len(sizes)) if start is None else start
    best = minimize(shortage, s, jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS})
    return min(shortage(s)[0], float(best.fun))
