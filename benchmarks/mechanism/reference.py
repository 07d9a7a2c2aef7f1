"""A tight reference for the tip of a linkage: two formulations, whose difference is the floor.

`maximal`: every body in absolute coordinates (maximal.py), multipliers by least squares.
`relative`: the component's own accelerations in joint coordinates. Both by SciPy's DOP853 at rtol
1e-13.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.maximal import Bodies
from benchmarks.our_mechanism import Ours

TOLERANCE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}


def tip(ours: Ours, end: float) -> tuple[np.ndarray, float]:
    """(x, y) of the operational point at `end` (s), and the error floor (m)."""
    first, second = _relative(ours, end), _maximal(ours, end)
    return second, float(np.linalg.norm(first - second))


def _relative(ours: Ours, end: float) -> np.ndarray:
    n = len(ours.start) // 2

    def f(_: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[n:], ours.outputs(x)["qdd"]]

    last = solve_ivp(f, (0, end), ours.start, **TOLERANCE).y[:, -1]
    return ours.outputs(last)["x"][:2]


def _maximal(ours: Ours, end: float) -> np.ndarray:
    bodies = Bodies(ours.linkage)
    joined, n = bodies.mechanism, bodies.mechanism.n
    wrench = np.array(ours.wrench)

    def f(_: float, y: np.ndarray) -> np.ndarray:
        z, zd = y[:n], y[n:]
        G, gamma = joined.closures(z, zd)
        J = joined.point(z, zd, bodies.tip)[1]
        force = bodies.weight.ravel() + J.T @ wrench
        return np.r_[zd, joined.accelerations(G, gamma[:, None], force[:, None])[:, 0]]

    first = np.concatenate(bodies.start(*np.split(ours.start, 2)))
    last = solve_ivp(f, (0, end), first, **TOLERANCE).y[:, -1]
    return joined.point(last[:n], last[n:], bodies.tip)[0][:2]
