"""The parameters of an arm behind a grip from a log of the handle's pose and the hand's wrench.

Axis by axis, with the arm's deflection e from where it would rest (components/blocks/hand.py),

    M e'' = -K e - B e' - F + c,    F = K_gr (e - x) + B_gr (e' - v)

is linear: F is a filtered x and v plus terms linear in the state at the start and in c. These are
solved for within (variable projection: Golub, Pereyra, SIAM J. Numerical Analysis 10 (1973), 413),
the five parameters by least squares of their logarithms. Pose and wrench go through the same low
pass first, which does not change the relation between them, but keeps the counts of encoders from
being differentiated. The arm's target is taken to stand still. Between samples x and v change
linearly, or where the log is `held` not at all, as in the sampled hand of a run.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import correlate1d
from scipy.optimize import least_squares
from scipy.signal import butter, cont2discrete, lfilter, sosfiltfilt, ss2tf

from hapticlink.analysis.fit.estimate import FROM_ZERO, Estimate, standard_deviations
from hapticlink.analysis.fit.log import Log
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.hand import ArmHand
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault

PASS = 40.0
"""Cut-off (Hz) of the low pass: beyond it an arm does not move."""
SLOPE = (1 / 12, -2 / 3, 0.0, 2 / 3, -1 / 12)
"""Central differences of fourth order: 0.2 % too small at the cut-off and 512 Hz, of second 4 %."""
CUT = 0.05
"""Time (s) at both ends of a log that the low pass distorts."""
BLOCKS = 20
"""Parts of a log that are taken to be independent of each other, for the spread."""
NAMES = ("mass", "stiffness", "damping", "grip_stiffness", "grip_damping")
UNITS = {
    "mass": PLANE.mass.units,
    "stiffness": PLANE.stiffness.units,
    "damping": PLANE.damping.units,
    "grip_stiffness": PLANE.stiffness.units,
    "grip_damping": PLANE.damping.units,
}
RANGE = (1e-7, 1e7)
"""Between these it ends (SI units): no arm is beyond, and the model's numbers stay finite."""
STILL = 1e-5
"""The motion (m, rad) of an axis below which nothing is fitted there."""
FORCELESS = 1e-9
"""The change (N, N.m) of a wrench in an axis below which nothing is fitted there."""


def fit_arm(log: Log, arm: ArmHand) -> tuple[list[Estimate], list[float]]:
    """Estimates of [hand] by axis, from `arm` on, and by axis the share of the wrench's variance
    that is not explained. Axes without motion, or whose wrench stays as it is, are left out. Raises
    InputFault for a log without the hand's wrench."""
    if log.hand is None:
        raise InputFault("hand: the log has no wrench of the hand")
    low = butter(4, min(2 * PASS * log.period, 0.9), output="sos")
    pose, wrench = (sosfiltfilt(low, values, axis=0) for values in (log.pose, log.hand))
    velocity = correlate1d(pose, SLOPE, axis=0) / log.period
    cut = int(CUT / log.period)
    inside = slice(cut, len(pose) - cut)
    estimates: list[Estimate] = []
    unexplained: list[float] = []
    for axis in range(PLANE.size):
        F = wrench[inside, axis]
        if np.ptp(pose[inside, axis]) < STILL or np.ptp(F) < FORCELESS:
            continue
        given = np.array([getattr(arm, name)[axis] for name in NAMES])
        model = _Axis(pose[inside, axis], velocity[inside, axis], F, log)
        found = least_squares(
            model.errors,
            np.log(np.clip(np.where(given > 0.0, given, FROM_ZERO), *RANGE)),
            bounds=tuple(np.log(RANGE)),
            xtol=1e-12,
            x_scale="jac",
        )
        spread = standard_deviations(found.jac, found.fun, BLOCKS, len(NAMES))
        for i, name in enumerate(NAMES):
            value, unit = float(np.exp(found.x[i])), UNITS[name][axis]
            sd = float(spread[i] * value)
            estimates.append(Estimate(f"hand.{name}[{axis}]", unit, value, sd, float(given[i])))
        unexplained.append(float(np.sum(found.fun**2) / np.sum((F - F.mean()) ** 2)))
    return estimates, unexplained


class _Axis:
    """What an axis of an arm does under the motion of the handle."""

    def __init__(self, x: Vector, v: Vector, F: Vector, log: Log) -> None:
        self._x, self._v, self._F, self._T = x - x[0], v, F, log.period
        self._between = "zoh" if log.held else "foh"

    def errors(self, logarithms: Vector) -> Vector:
        """F of the model less that of the log, with the best start and constant."""
        forced, free = self._wrench(np.exp(logarithms))
        weights, *_ = np.linalg.lstsq(free, self._F - forced, rcond=None)
        return forced + free @ weights - self._F

    def _wrench(self, parameters: Vector) -> tuple[Vector, Matrix]:
        """F from rest under x and v, and (n, 4) its response to e, e' at the start, to c, and 1."""
        M, K, B, K_gr, B_gr = parameters
        A = np.array([[0.0, 1.0], [-(K + K_gr) / M, -(B + B_gr) / M]])
        drive = np.array([[0.0, 0.0], [K_gr / M, B_gr / M]])
        C = np.array([[K_gr, B_gr]])
        D = np.array([[-K_gr, -B_gr]])
        Ad, Bd, Cd, Dd, _ = cont2discrete((A, drive, C, D), self._T, self._between)
        forced = np.zeros(len(self._F))
        for i, u in enumerate((self._x, self._v)):
            numerator, denominator = ss2tf(Ad, Bd, Cd, Dd, i)
            forced += lfilter(numerator[0], denominator, u)
        poles, modes = np.linalg.eig(Ad)
        powers = poles[None, :] ** np.arange(len(self._F))[:, None]
        starts = ((C @ modes)[0] * powers) @ np.linalg.inv(modes)
        return forced, np.column_stack([starts.real, np.ones(len(self._F))])
