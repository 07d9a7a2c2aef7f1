"""The linearisation of the lifted map, A = V' dF/dz V, by perturbations that are carried through
the operations of a period P (forward_sensitivity.py), and its modes: eigenvalues z of A.

V_j are the unit vectors of the coordinates, or directions within the closures
(closure_directions.py). A number that is overwritten before anything reads it has a zero column and
is left out. A number that nothing changes, a gain that a hold keeps, is a parameter of the lifted
map: its row is that of the identity, and it is left out too.

    s = ln(z)/P = sigma + i omega,   p_k = |v_k w_k| / sum |v_k w_k|

sigma is the growth rate (1/s). p is the participation of coordinate k, from
the right and left eigenvectors v and w; it does not depend on the units of the coordinates
(Perez-Arriaga, Verghese, Schweppe, IEEE Trans. Power Apparatus and Systems 101 (1982), 3117). An
error E of A moves a simple eigenvalue by at most |w||E||v| / |w v| entry by entry, which is taken
for its uncertainty. Of eigenvalues that coincide, as those of a closure error that is critically
damped, w v is 0 and that says nothing: where it leaves open whether the leading mode grows, the
distance is taken by which the errors with these signs, and with the opposite ones, really move it.

The argument of z is known up to whole turns only: the phase of a number c that the mode moves,
unwrapped over the events of the period, is omega P. It is exact as long as c turns by less than
half a turn between two events.

To the hand that feels it a growing mode is a *drift* where it is slow: below 1 Hz, and by less than
0.2 1/s, which a person corrects without noticing. Above that an *oscillation* grows, from 40 Hz on
a *vibration*, which skin and hand no longer feel as motion (flutter and vibration: Talbot,
Darian-Smith, Kornhuber, Mountcastle, J. Neurophysiology 31 (1968), 301). A *divergence* grows
faster than a drift, at less than its frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, matrix_balance

from hapticlink.analysis.findings.noticed import VIBRATION
from hapticlink.orchestrator.base.arrays import Complex, Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault

ONE = 1e-7
"""Largest deviation from 1 of the diagonal entry of a parameter, and of eigenvalues that are 1:
two that coincide without two directions are as far apart as the root of rounding, about 1e-8, which
their uncertainty by the first order does not have."""
FLOOR = 1e-9
"""Relative error of the entries of A by rounding."""
DOUBLED = 2.0
"""Spectral radius up to which a growing mode may be marginal."""
NEAR = 1e-4
"""Largest |z - 1| of a neutral mode, however uncertain z is: one further off may grow."""


@dataclass(frozen=True)
class Bounds:
    """Up to which frequency (Hz) and growth rate (1/s) a growing mode is a drift."""

    hertz: float = 1.0
    growth: float = 0.2


DRIFT = Bounds()


def kind(growth: float, hertz: float, bounds: Bounds) -> str:
    """drift, divergence, oscillation or vibration."""
    if hertz < bounds.hertz:
        return "drift" if growth < bounds.growth else "divergence"
    return "oscillation" if hertz < VIBRATION else "vibration"


@dataclass(frozen=True)
class Linearisation:
    """The map around `point`: F(point) = image, with the Jacobian A (n, n) along the orthonormal
    directions V, the columns of a matrix, and its error E (n, n) by slopes to one side."""

    point: Vector
    image: Vector
    V: Matrix
    A: Matrix
    E: Matrix

    @property
    def taken(self) -> NDArray[np.intp]:
        """The coordinates of the state that the directions move."""
        return np.flatnonzero(self.V.any(axis=1))

    @property
    def change(self) -> Vector:
        """Along each direction, F(point) - point."""
        return self.V.T @ (self.image - self.point)

    def moved(self, by: Vector) -> Vector:
        """The point moved along the directions, with all that is overwritten as in the image."""
        return self.image + self.V @ (by - self.change)

    @property
    def scales(self) -> Vector:
        """Scales d of the coordinates that balance A: rows of D^-1 A D as large as its columns."""
        return matrix_balance(self.A, permute=False, separate=True)[1][0]


def constant(A: Matrix, same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which coordinates nothing changes, not even in turn the others."""
    n = len(A)
    own = np.abs(np.diag(A) - 1.0) < ONE
    alone = np.count_nonzero(A - np.diag(np.diag(A)), axis=1) == 0
    return own & alone & same if n else np.zeros(0, bool)


@dataclass(frozen=True)
class Mode:
    """A mode: its eigenvalue z over a period, |z - exact| at most `uncertainty`; growth rate
    (1/s), angular frequency (rad/s), and the participation (n,) of the coordinates taken."""

    z: complex
    uncertainty: float
    growth: float
    omega: float
    participation: Vector
    vector: np.ndarray

    @property
    def neutral(self) -> bool:
        """Whether z is 1 within its uncertainty: a motion that neither grows nor decays."""
        return abs(self.z - 1.0) <= max(ONE, min(self.uncertainty, NEAR))

    @property
    def is_in_doubt(self) -> bool:
        """Whether it is further from 1 than a neutral mode, and may grow or decay."""
        return abs(self.z - 1.0) > NEAR and verdict(abs(self.z), self.uncertainty) == "marginal"


def verdict(radius: float, uncertainty: float) -> str:
    """stable, unstable, or marginal where a spectral radius is 1 within its uncertainty. What grows
    beyond DOUBLED is unstable: over the many operations of a period the relative error of a large
    number becomes larger than 1, which does not make it 1."""
    if abs(radius - 1.0) <= uncertainty and radius <= DOUBLED:
        return "marginal"
    return "unstable" if radius > 1.0 else "stable"


def judged_modes(modes: Sequence[Mode]) -> Sequence[Mode]:
    """The modes by which a scene is judged: neutral ones only where there are no others."""
    return [mode for mode in modes if not mode.neutral] or modes


def modes(linear: Linearisation, period: float) -> list[Mode]:
    """The modes, that of the largest |z| first; of a complex pair the one with omega > 0. Raises
    InputFault where A is not finite."""
    if not np.isfinite(linear.A).all():
        raise InputFault("its small motions grow beyond all numbers within a period")
    scale = linear.scales
    A, E = linear.A * scale / scale[:, None], np.abs(linear.E * scale / scale[:, None])
    E = np.maximum(E, FLOOR * np.abs(A))
    # Beyond 1.5e138 SciPy's eigenvalues are those of the matrix that LAPACK has scaled.
    size = 2.0 ** max(np.frexp(np.abs(A).max(initial=0.0))[1] - 400, 0)
    values, left, right = eig(A / size, left=True, right=True)
    upper, values = values.imag >= 0.0, size * values
    z, v, w = values[upper], right[:, upper], left[:, upper].conj()
    overlap = np.abs((w * v).sum(axis=0))
    apart = ((np.abs(w).T @ E).T * np.abs(v)).sum(axis=0)
    uncertainty = np.divide(apart, overlap, out=np.full(len(z), np.inf), where=overlap > 0.0)
    vectors = linear.V @ (scale[:, None] * v)
    shares = np.abs(vectors * (linear.V @ (w / scale[:, None])))[linear.taken]
    total = shares.sum(axis=0)
    shares /= np.where(total > 0.0, total, 1.0)
    with np.errstate(divide="ignore"):
        s = np.log(z) / period
    found = [
        (
            Mode(
                complex(z[i]),
                float(uncertainty[i]),
                float(s[i].real),
                float(s[i].imag),
                shares[:, i],
                vectors[:, i],
            ),
            w[:, i],
            v[:, i],
        )
        for i in range(len(z))
    ]
    found.sort(key=lambda each: -abs(each[0].z))
    sorted_modes = [mode for mode, _, _ in found]
    first = next((i for i, mode in enumerate(sorted_modes) if not mode.neutral), None)
    if first is not None and sorted_modes[first].is_in_doubt:
        mode, left_1, right_1 = found[first]
        slope = np.outer(left_1, right_1) * np.conj(mode.z * (left_1 @ right_1))
        moved = _distance(mode.z, A, np.sign(slope.real) * E)
        sorted_modes[first] = replace(mode, uncertainty=min(mode.uncertainty, moved))
    return sorted_modes


def _distance(z: complex, A: Matrix, E: Matrix) -> float:
    """How far an error of E or of -E moves the eigenvalue z of A."""
    return float(max(np.abs(np.linalg.eigvals(A + e) - z).min() for e in (E, -E)))


def with_turns(mode: Mode, path: Complex, period: float) -> Mode:
    """The mode with the frequency of a number that moves along `path` in a period (s)."""
    path = path[np.abs(path) > 0]
    if len(path) < 2:
        return mode
    if mode.z.imag == 0.0:  # a real mode changes its sign at half turns
        turns = np.count_nonzero(np.diff(np.sign(path.real))) / 2
        return replace(mode, omega=2 * np.pi * turns / period)
    whole = np.unwrap(np.angle(path))[-1] - np.angle(path[0])
    argument = np.angle(mode.z)
    turns = np.round((whole - argument) / (2 * np.pi))
    return replace(mode, omega=abs(argument + 2 * np.pi * turns) / period)


def leading(mode: Mode, names: Sequence[str], most: int = 3) -> list[tuple[str, float]]:
    """The names with the largest shares in a mode; those that have one together are summed up."""
    shares: dict[str, float] = {}
    for name, share in zip(names, mode.participation.tolist(), strict=True):
        shares[name] = shares.get(name, 0.0) + share
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return [(name, share) for name, share in ranked[:most] if share > 0.02]
