"""The energy that sampling and holding an effort generates: work of the held effort minus work of
the ideal source.

held      = sum F_held,j . (x_{j+1} - x_j)                  over the target's steps
ideal     = sum (F_n + F_{n+1})/2 . (x(t_{n+1}) - x(t_n))   over the source's samples
generated = held - ideal,   peak = the largest value of generated at any sample

Each held effort is paired with the displacement of the step that it acts over: a spring K sampled
with a zero-order hold generates 1/2 K sum dx^2 (paired with the displacement before, the same
energy would appear dissipated). The ideal effort is linear in the displacement between samples,
which is exact for a spring on any path; x is linear between the target's steps. An effort that
changes over the substeps of a step counts with its mean.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Read = Callable[[], Vector]
ROWS = 1024
"""Steps of the target that are kept before they are added to the sums."""
Mark = tuple[int, int, int]


@dataclass(frozen=True)
class Energy:
    """Energies (J) of a connection from 0 to `until` (s), the newest sample of the source that the
    target has stepped past; symbols as in the module's text."""

    generated: float
    held: float
    ideal: float
    until: float
    peak: float


class _Sums(NamedTuple):
    """Sums up to the source's sample with index `sample`; work_at_row is the held work up to the
    target's last `row` before it."""

    work: float
    work_at_row: float
    ideal: float
    sample: int
    row: int
    peak: float


class Meter:
    """Energy meter of one connection.

    source and held read the effort at the source and as the target gets it, x the displacement with
    the sign of the power, each into a new vector; `sample`, `hold` and `move` call them. Old rows
    are added to sums from time to time.
    """

    def __init__(self, source: Read, held: Read, x: Read) -> None:
        self._source, self._held, self._x = source, held, x
        self._stamps: list[int] = []
        self._samples: list[Vector] = []
        self._ticks: list[int] = []
        self._moves: list[Vector] = []
        self._efforts: list[Vector] = []
        self._work = self._ideal = self._peak = 0.0
        self._full = ROWS

    def sample(self, stamp: int) -> None:
        """Record the source's new sample, stamped `stamp`."""
        if self._stamps and self._stamps[-1] == stamp:
            self._samples[-1] = self._source()
            return
        self._stamps.append(stamp)
        self._samples.append(self._source())

    def move(self, tick: int) -> None:
        """Record the target's displacement at `tick`."""
        if self._ticks and self._ticks[-1] == tick:
            return
        if len(self._ticks) >= self._full:
            self._fold()
        self._ticks.append(tick)
        self._moves.append(self._x())

    def hold(self, share: float) -> None:
        """Record the effort that the target holds over a fraction `share` of its step."""
        effort = self._held() if share == 1.0 else self._held() * share
        if len(self._efforts) < len(self._moves):
            self._efforts.append(effort)
        else:
            self._efforts[-1] += effort

    def checkpoint(self, rows: int) -> Mark:
        """Checkpoint for `rollback`, valid for up to `rows` further rows."""
        if len(self._ticks) + rows >= self._full:
            self._fold()
        return len(self._stamps), len(self._ticks), len(self._efforts)

    def rollback(self, mark: Mark) -> None:
        """Remove what was recorded since the checkpoint `mark`."""
        stamps, ticks, efforts = mark
        del self._stamps[stamps:], self._samples[stamps:]
        del self._ticks[ticks:], self._moves[ticks:], self._efforts[efforts:]

    def energy(self, seconds: float) -> Energy:
        """The energies until now; `seconds` is the length of a tick (s)."""
        if not self._stamps or not self._ticks:
            return Energy(0.0, 0.0, 0.0, 0.0, 0.0)
        sums = self._sums()
        until = self._stamps[sums.sample] * seconds
        return Energy(sums.work - sums.ideal, sums.work, sums.ideal, until, sums.peak)

    def _sums(self) -> _Sums:
        """All sums up to the newest sample that the target has stepped past."""
        ticks, x = np.array(self._ticks), np.array(self._moves)
        sample = max(bisect_right(self._stamps, self._ticks[-1]) - 1, 0)
        stamps, efforts = (
            np.array(self._stamps[: sample + 1]),
            np.array(self._samples[: sample + 1]),
        )
        row = max(bisect_right(self._ticks, self._stamps[sample]) - 1, 0)
        work = np.zeros(len(ticks))
        if len(ticks) > 1:
            done = np.array(self._efforts[: len(ticks) - 1]) * np.diff(x, axis=0)
            work[1:] = done.sum(axis=1).cumsum()
        x_stamps = np.stack([np.interp(stamps, ticks, column) for column in x.T], axis=1)
        ideal = np.zeros(len(stamps))
        done = (efforts[:-1] + efforts[1:]) / 2 * np.diff(x_stamps, axis=0)
        ideal[1:] = done.sum(axis=1).cumsum()
        held = np.interp(stamps, ticks, work)
        return _Sums(
            self._work + float(held[-1]),
            self._work + float(work[row]),
            self._ideal + float(ideal[-1]),
            sample,
            row,
            max(self._peak, float((held - ideal).max()) + self._work - self._ideal),
        )

    def _fold(self) -> None:
        """Add rows to the sums and drop them; grow the buffer if a slow source still needs them."""
        if self._stamps:
            sums = self._sums()
            self._work, self._ideal, self._peak = sums.work_at_row, sums.ideal, sums.peak
            del self._stamps[: sums.sample], self._samples[: sums.sample]
            del self._ticks[: sums.row], self._moves[: sums.row], self._efforts[: sums.row]
        self._full = max(ROWS, 2 * len(self._ticks))
