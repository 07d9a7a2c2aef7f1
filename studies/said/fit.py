"""The growth rate of the slowest motion in a run, from its samples alone.

    d_{k+1} = A d_k,   s = ln(z)/P

d_k are the changes of handle and mechanism over the k-th hyperperiod P, at every phase of it, which
leaves out where they rest; A is fitted to them by least squares in the directions that the run
moves in (dynamic mode decomposition: Schmid, J. Fluid Mechanics 656 (2010), 5), and z are its
eigenvalues. Fitted are two windows; what they do not agree on is not clean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

SCALES = {
    "haptic_device.x_true": 1.0, "haptic_device.v_true": 0.1, "hand.F": 1e-3,
    "virtual_mechanism.q": 1.0, "virtual_mechanism.qd": 0.1,
}  # fmt: skip
"""What is seen of a motion, and how large it counts (m or rad)."""
PHASES, RANK, SMALL = 6, 14, 1e-7
FLOOR, LARGE = 3e-12, 3e-4
"""Changes of a coordinate (m, rad) between which a motion is neither rounding nor large."""
LEAST = 0.003
"""Share of the motion at the end of a window, from which a mode counts."""


@dataclass(frozen=True)
class Fitted:
    """Growth rate (1/s), its spread between windows, and the turn over a step (rad); or why none is
    found."""

    growth: float = np.nan
    spread: float = np.inf
    turn: float = np.nan
    step: float = np.nan
    why: str = ""


def fitted(run: Any, step: float, since: float = 0.0) -> Fitted:
    """The growth rate of a run from a time on, in changes over `step` (s)."""
    try:
        d = _changes(run, step, since)
    except KeyError as name:
        return Fitted(why=f"{name} is not recorded")
    size = np.linalg.norm(d, axis=1)
    if not len(size):
        return Fitted(why="the run ends within its first periods")
    within = size > FLOOR * np.sqrt(d.shape[1])
    end = len(size) if within.all() else int(np.argmax(~within))
    if (beyond := size > LARGE * np.sqrt(d.shape[1])).any() and size[end - 1] > size[0]:
        end = min(end, int(np.argmax(beyond)))
    begin = int(np.argmax(~beyond)) if beyond[0] else 0
    begin += (end - begin) // 6
    if end - begin < 8:
        return Fitted(why="fewer than 8 periods between rounding and large motions")
    found = [_leading(d[first:end], step) for first in (begin, (begin + end) // 2)]
    if any(each is None for each in found):
        return Fitted(why="no mode stands out of the motion")
    (z1, share), (z2, _) = found  # type: ignore[misc]
    s1, s2 = (float(np.log(abs(z)) / step) for z in (z1, z2))
    del share
    return Fitted(s2, abs(s1 - s2), float(abs(np.angle(z2))), step)


def _changes(run: Any, step: float, since: float) -> np.ndarray:
    """The changes over each step, (k, phases and coordinates); velocities times the step."""
    columns, rows = [], []
    for name, scale in SCALES.items():
        time, y = run.time(name), run[name]
        rate = round((len(time) - 1) / (time[-1] - time[0]))
        n = step * rate
        if n < 0.999 or abs(n - round(n)) > 1e-6:
            continue
        n, first = round(n), int(np.searchsorted(time, since))
        y = y[first:]
        y = y[: len(y) // n * n].reshape(-1, n, y.shape[1])[:, :: max(1, n // PHASES)]
        columns.append(np.diff(y.reshape(len(y), -1), axis=0) * scale)
        rows.append(len(columns[-1]))
    if not columns:
        raise KeyError(f"nothing at a period of {step:.3g} s")
    return np.concatenate([c[: min(rows)] for c in columns], axis=1)


def _leading(d: np.ndarray, step: float) -> tuple[complex, float] | None:
    """The eigenvalue of the mode that grows most, or decays least, of those with a LEAST share of
    the motion at the end; what neither grows nor decays, nor turns, is a drift of the rest."""
    X, Y = d[:-1].T, d[1:].T
    weight = 1.0 / np.linalg.norm(X, axis=0)
    U, s, Vt = np.linalg.svd(X * weight, full_matrices=False)
    r = min(RANK, max(1, int((s > SMALL * s[0]).sum())), max(1, X.shape[1] // 2))
    A = U[:, :r].T @ (Y * weight) @ Vt[:r].T / s[:r]
    z, v = np.linalg.eig(A)
    last = U[:, :r].T @ d[-1]
    share = np.abs(np.linalg.lstsq(v, last.astype(complex), rcond=None)[0])
    share *= np.linalg.norm(v, axis=0) / np.linalg.norm(last)
    moving = (share > LEAST) & (np.abs(z - 1.0) > 5e-4 * step)
    if not moving.any():
        return None
    i = max(np.flatnonzero(moving), key=lambda i: abs(z[i]))
    return complex(z[i]), float(share[i])
