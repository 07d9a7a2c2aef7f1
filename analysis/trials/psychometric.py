"""The psychometric function of a trial with two alternatives, and its threshold.

    p(x) = 1/2 + (1/2 - lapse) F(slope (s(x) - s(threshold))),   F(z) = 1/(1 + exp(-z))

is the share of right answers at level x, with s the logarithm where all levels are above 0. At the
threshold it is half-way between guessing and the answers of somebody who lapses now and then. All
three parameters are those of the largest likelihood, lapse between 0 and MOST_LAPSES; the interval
of the threshold has all values whose largest likelihood is not less by more than chi^2_1 (0.95)/2.

Source: F. A. Wichmann and N. J. Hill, The psychometric function: I. Fitting, sampling, and goodness
of fit, Perception & Psychophysics 63 (2001) 1293-1313; the interval by the likelihood ratio: S. S.
Wilks, The Annals of Mathematical Statistics 9 (1938) 60-62.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special, stats

from hapticlink.orchestrator.base.arrays import Vector

GUESS = 0.5
"""Share of right answers of somebody who feels no difference between two."""
MOST_LAPSES = 0.06
COVERED = 0.95
SURE = 1e-12
"""Least share of wrong answers, so that one of them is never impossible."""
STEEPEST = 60.0
"""Slope, in levels from the first to the last one, above which a curve is a step."""
GRID = 241
"""Thresholds among which the interval is looked for."""
BEYOND = 0.5
"""Share of the levels' range by which a threshold may be outside of it."""


@dataclass(frozen=True)
class PsychometricFit:
    """A threshold with its interval, of which an end is None where the answers do not bound it.
    slope: of p in s; positive where larger levels are easier to tell."""

    threshold: float
    low: float | None
    high: float | None
    slope: float
    lapse: float
    logarithmic: bool

    def share(self, level: Vector) -> Vector:
        """p at these levels."""
        s, at = _scaled(level, self.logarithmic), _scaled(self.threshold, self.logarithmic)
        return GUESS + (1 - GUESS - self.lapse) * special.expit(self.slope * (s - at))


def fit_threshold(
    levels: Sequence[float], right: Sequence[int], trials: Sequence[int]
) -> PsychometricFit | str:
    """The threshold of `right` answers of so many `trials` at each level; why there is none in
    words."""
    x, k, n = (np.array(values, float) for values in (levels, right, trials))
    if len(np.unique(x)) < 2:
        return "one level: a threshold lies between levels that are told apart and others"
    if k.sum() == n.sum():
        return "all answers were right: take levels that are harder to tell"
    logarithmic = bool((x > 0).all())
    s = _scaled(x, logarithmic)
    middle, span = (s.min() + s.max()) / 2, s.max() - s.min()
    z = (s - middle) / span  # from -1/2 to 1/2

    def loss(p: Vector) -> float:
        told = special.expit(p[1] * (z - p[0]))
        share = np.clip(GUESS + (1 - GUESS - p[2]) * told, None, 1 - SURE)
        return -float(np.sum(special.xlogy(k, share) + special.xlogy(n - k, 1 - share)))

    edge = 0.5 + BEYOND
    best = _minimum(loss, [(-edge, edge), (-STEEPEST, STEEPEST), (0.0, MOST_LAPSES)])
    # A curve that is level has no place: what guessing alone explains as well.
    flat = -float(np.sum(special.xlogy(k, GUESS) + special.xlogy(n - k, 1 - GUESS)))
    limit = stats.chi2.ppf(COVERED, 1) / 2
    if flat - best.fun <= limit:
        return "guessing explains the answers as well: take levels that are easier to tell, or more"
    if abs(best.x[0]) > 0.5:
        return "the threshold lies outside of the levels: take levels on both sides of it"

    def profile(at: float) -> float:
        bounds = [(-STEEPEST, STEEPEST), (0.0, MOST_LAPSES)]
        return (
            _minimum(lambda p: loss(np.array([at, *p])), bounds, best.x[1:]).fun - best.fun - limit
        )

    grid = np.linspace(-edge, edge, GRID)
    ends = [
        _end(profile, best.x[0], side)
        for side in (grid[grid < best.x[0]][::-1], grid[grid > best.x[0]])
    ]

    def level(place: float) -> float:
        value = middle + span * place
        return float(np.exp(value) if logarithmic else value)

    low, high = (None if end is None else level(end) for end in ends)
    return PsychometricFit(
        level(best.x[0]), low, high, float(best.x[1] / span), float(best.x[2]), logarithmic
    )


def _scaled(level: float | Vector, logarithmic: bool) -> Vector:
    values = np.asarray(level, float)
    return np.log(values) if logarithmic else values


def _minimum(
    loss: Callable[[Vector], float],
    bounds: Sequence[tuple[float, float]],
    near: Vector | None = None,
) -> optimize.OptimizeResult:
    """The smallest of the minima from some starts: both signs and two sizes of the slope."""
    slopes = [np.array([s]) for s in (-12.0, -4.0, 4.0, 12.0)]
    before = [np.array([at]) for at in (-0.2, 0.2)] if len(bounds) == 3 else [np.empty(0)]
    starts = [near] if near is not None else []
    if near is None:
        starts = [np.concatenate([b, s, [0.02]]) for b in before for s in slopes]
    found = [optimize.minimize(loss, start, bounds=bounds, method="L-BFGS-B") for start in starts]
    return min(found, key=lambda result: result.fun)


def _end(profile: Callable[[float], float], best: float, outward: Vector) -> float | None:
    """Where the profile crosses its limit on the way outward, None where it does not."""
    before = best
    for at in outward:
        if profile(float(at)) > 0.0:
            return float(optimize.brentq(profile, before, float(at), xtol=1e-4))
        before = float(at)
    return None
