"""The growth rate of the leading motion in a run, from its rows alone.

Snapshots are the changes of handle and mechanism over a hyperperiod, at every phase of it, which
leaves out where they rest; or changes of these, where something creeps on evenly. Fitted are two
windows; what they do not agree on is not clean.

Over each hyperperiod the loop is the same linear map, whose modes are those of the fit. Over frames
of different lengths it is not, and a fit by frames is but near.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from studies.run_modes import Array, fit_modes

SCALES = {
    "haptic_device.x_true": 1.0, "haptic_device.v_true": 0.1, "hand.F": 1e-3,
    "virtual_mechanism.q": 1.0, "virtual_mechanism.qd": 0.1,
}  # fmt: skip
"""What is seen of a motion, and how large it counts (m or rad)."""
PHASES, RANK, FEWEST = 6, 14, 3
FLOOR, LARGE = {True: 1e-14, False: 2e-12}, {True: 1e-5, False: 1e-4}
"""Changes of a coordinate (m, rad) between which a motion is neither rounding nor large, if it
grows or decays: what is quadratic in a growing one grows twice as fast; what has decayed by four
decades may end in a larger rounding. The handle's angle in seed 4900623 is rounded by 3e-14 rad: of
-0.436 1/s fits of its 26 hyperperiods down to 5e-13 show -0.08 and -0.20, down to 2e-12 -0.436."""
RISE = 1e-11, 1e-6
"""Changes of the handle in a tick (m, rad) between which what grows fast is neither rounding nor
large."""
CREEP = 0.01
"""Rate (1/s) below which, and below a tenth of what is told, a mode is a creep of the rest."""
EVEN = 0.005
"""Part by which the mean changes of the last two sixteenths of a decay differ where they are a
creep of the rest, which is taken off: of 1e-13 m, its rate was fitted as 0.07 1/s. A decay differs
by as much as that over 60 s from 0.0013 1/s on, by 0.07 at 0.018 1/s."""
SHARE, FAINT, SAME = 0.02, 1e-3, 0.01
"""Shares of the motion at the end of a window, from which a mode counts, and a decaying one counts
on which both windows agree within `SAME`. What decays least rises above the others late: of -0.0182
beside -0.0590 1/s, 1.3 % were left after 100 s, and the windows agreed within 0.05 %. What grows
most is always found large, and a faint mode of twice its rate is its square."""

FOLDS = 2.0
"""By which a motion grows or decays over a hyperperiod, up to which it is fitted by hyperperiods:
between rounding and large motions are then 8 or more. Seed 4900606 decays by 0.62 over one: by
frames its runs show -1.0, -1.5 and -0.6 1/s, by hyperperiods -1.237 as told, and so does a central
difference of the loop over them. Beyond, too few are left: of 5.3 a fit shows 7.3, in both windows
alike."""


def hyperperiod(fast: Fraction, slow: Fraction) -> float:
    """After which ticks and frames of two rates (Hz) fall together again (s)."""
    return float((fast / slow).numerator / fast)


def step_of(fast: Fraction, slow: Fraction, told: float) -> float:
    """The step between snapshots (s): the hyperperiod, or about a frame where motions change much
    over it."""
    period = hyperperiod(fast, slow)
    return period if abs(told) * period < FOLDS else float(round(fast / slow) / fast)


class Odd:
    """Half the difference of two runs that are nudged to and fro: the part of a motion that is odd
    in its nudge. What goes with the square of it falls out, as a creep along rests that lie side by
    side: in seed 4900619 a hundredth of it is left of a tenth of the nudge, and its rates, -0.042
    and -0.015 1/s of two nudges, are none of small motions. The odd part has the told -0.378."""

    def __init__(self, to: Any, fro: Any) -> None:
        self.runs, self.fault = (to, fro), to.fault or fro.fault

    def time(self, name: str) -> Any:
        return min((run.time(name) for run in self.runs), key=len)

    def __getitem__(self, name: str) -> Any:
        n = len(self.time(name))
        to, fro = (run[name][:n] for run in self.runs)
        return (to - fro) / 2


@dataclass(frozen=True)
class Growth:
    """Growth rate (1/s), its spread between windows, and the turn over a step (rad) of `step`
    seconds, whole turns left out; or why none is found."""

    rate: float = np.nan
    spread: float = np.inf
    turn: float = np.nan
    step: float = np.nan
    why: str = ""


def hertz(run: Any, step: float) -> float:
    """The frequency (Hz) of what moves the handle at the end of a run: half the sign changes a
    second of its largest change over a step, at every tick. Over hyperperiods whole turns are not
    seen: in seed 5000729 1.013 Hz looked like 0.013 over one of 1 s."""
    time, y = run.time("haptic_device.x_true"), run["haptic_device.x_true"]
    n = max(1, round(step / float(np.median(np.diff(time)))))
    d = (y[n:] - y[:-n])[len(time) // 2 :]
    largest = d[:, np.argmax(np.abs(d).max(axis=0))]
    changes = np.flatnonzero(np.diff(np.sign(largest)))
    if len(changes) < 2:
        return 0.0
    return (len(changes) - 1) / 2 / float(time[changes[-1]] - time[changes[0]])


def growth_of(run: Any, step: float, told: float, block: str = "", creeps: bool = False) -> Growth:
    """The growth rate of a run of which a rate is told, in changes over `step` (s) of what is seen
    of a `block`, or of all; in changes of these if it `creeps`, or nothing is found otherwise."""
    d = _changes(run, step, block)
    found = Growth(why="a creep") if creeps else _fit(d, step, told)
    return _fit(np.diff(d, axis=0), step, told) if found.why else found


def growth_by_ticks(run: Any) -> Growth:
    """Of what grows beyond all that a step could show: the slope of the logarithm of the handle's
    changes in a tick, while they RISE, and how far those of both halves differ. Seed 5500203 grows
    by 8.8 over a frame: by frames its runs show how they calm down afterwards, by ticks the told
    282 1/s."""
    time, y = run.time("haptic_device.x_true"), run["haptic_device.x_true"]
    size = np.abs(np.diff(y, axis=0)).max(axis=1)
    end = int(np.argmax(size > RISE[1]))
    begin = max(np.flatnonzero(size[:end] < RISE[0]) + 1, default=0)
    if end - begin < 4 * FEWEST:
        return Growth(why=f"{end - begin} ticks between rounding and large motions")
    middle = (begin + end) // 2
    whole, early, late = (
        float(np.polyfit(time[i:j], np.log(size[i:j]), 1)[0])
        for i, j in ((begin, end), (begin, middle), (middle, end))
    )
    return Growth(whole, abs(early - late), step=0.0)


def _fit(d: Array, step: float, told: float) -> Growth:
    grows, creep = told > 0.0, min(CREEP, 0.1 * abs(told))
    if not grows and len(d) >= 16:
        before, rest = (part.mean(axis=0) for part in np.array_split(d, 16)[-2:])
        d = d - rest * (np.linalg.norm(rest - before) < EVEN * np.linalg.norm(rest))
    size = np.linalg.norm(d, axis=1) / np.sqrt(max(1, d.shape[1]))
    floor = FLOOR[grows]
    if not grows:
        floor = max(floor, min(30 * size.min(initial=1.0), 1e-4 * size.max(initial=0.0)))
    falls = size[::-1] if grows else size  # what grows decays backwards
    begin = max(np.flatnonzero(falls > LARGE[grows]) + 1, default=0)
    end = min(np.flatnonzero(falls[begin:] < floor) + begin, default=len(size))
    if grows:
        begin, end = len(size) - end, len(size) - begin
    begin += (end - begin) // 6
    if end - begin < FEWEST:
        return Growth(why=f"{end - begin} periods between rounding and large motions")
    early, late = (
        (z[moves], share[moves])
        for z, share in (fit_modes(d[i:end], RANK) for i in (begin, (begin + end) // 2))
        for moves in [(np.abs(z - 1.0) > creep * step) & (z != 0.0)]
    )
    found = [_leading(*one, other[0], grows) for one, other in ((early, late), (late, early))]
    if None in found:
        return Growth(why="no mode stands out of the motion")
    rates = [float(np.log(abs(z)) / step) for z in found if z is not None]
    turn = float(abs(np.angle(found[1])))  # type: ignore[arg-type]
    return Growth(rates[1], abs(rates[0] - rates[1]), turn, step)


def _changes(run: Any, step: float, block: str) -> Array:
    """The changes over each step, (k, phases and coordinates)."""
    columns = []
    for name, scale in SCALES.items():
        if not name.startswith(block):
            continue
        time, y = run.time(name), run[name]
        n = step / float(np.median(np.diff(time))) if len(time) > 2 else 0.0
        if n < 0.999 or abs(n - round(n)) > 1e-6 or len(y) < round(n):
            continue  # slower than the step
        whole = y[: len(y) // round(n) * round(n)].reshape(-1, round(n), y.shape[1])
        seen = whole[:, :: max(1, round(n) // PHASES)].reshape(len(whole), -1)
        columns.append(np.diff(seen, axis=0) * scale)
    if not columns:
        return np.zeros((0, 1))
    return np.concatenate([c[: min(map(len, columns))] for c in columns], axis=1)


def _leading(z: Array, share: Array, other: Array, grows: bool) -> complex | None:
    """The mode that grows most, or decays least, of those with a SHARE, or that are FAINT, decay in
    a window of a decay, and are found in the `other` window too."""
    counts = share > SHARE
    if not grows and len(other):
        apart = np.abs(np.log(z)[:, None] - np.log(other)).min(axis=1)
        counts |= (share > FAINT) & (np.abs(z) < 1.0) & (apart < SAME * np.abs(np.log(z)))
    return complex(z[counts][np.argmax(np.abs(z[counts]))]) if counts.any() else None
