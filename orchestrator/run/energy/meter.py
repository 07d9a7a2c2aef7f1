"""The energy that a held effort generates: what it did, minus what its ideal source did.

held  = sum F_held,j . (x_{j+1} - x_j)               over the target's steps
ideal = sum (F_n + F_{n+1})/2 . (x(t_{n+1}) - x(t_n))   over the source's samples
made  = held - ideal,   most = the largest that made was at any sample

Each held effort is paired with the displacement that follows it: a spring K sampled with a
zero-order hold makes 1/2 K sum dx^2 (paired with the displacement before it, the same leak would
look like loss). The ideal source is straight in the displacement between its samples, which is
exact for a spring on any path; x is straight between the target's steps. An effort that changes
over the substeps of one step counts with its mean.
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
"""Steps of the target that are kept before they are folded."""
Mark = tuple[int, int, int]


@dataclass(frozen=True)
class Energy:
    """In J, from 0 to `until` (s), the newest sample of the source that the target moved past."""

    made: float
    held: float
    ideal: float
    until: float
    most: float


class _Sums(NamedTuple):
    """Up to `sample`; work_at_row up to the target's `row` before it."""

    work: float
    work_at_row: float
    ideal: float
    sample: int
    row: int
    most: float


class Meter:
    """Books one connection. `source`, `held` (the effort, as its source gives it and as the target
    gets it) and `x` (the displacement, with the sign of the power) are read, each time into a new
    vector, when `sample`, `hold` and `move` are called; now and then the rows are folded into
    sums."""

    def __init__(self, source: Read, held: Read, x: Read) -> None:
        self._source, self._held, self._x = source, held, x
        self._stamps: list[int] = []
        self._samples: list[Vector] = []
        self._ticks: list[int] = []
        self._moves: list[Vector] = []
        self._efforts: list[Vector] = []
        self._work = self._ideal = self._most = 0.0
        self._full = ROWS

    def sample(self, stamp: int) -> None:
        """Book the source's new sample, stamped `stamp`."""
        if self._stamps and self._stamps[-1] == stamp:
            self._samples[-1] = self._source()
            return
        self._stamps.append(stamp)
        self._samples.append(self._source())

    def move(self, tick: int) -> None:
        """Book the target's displacement at `tick`."""
        if self._ticks and self._ticks[-1] == tick:
            return
        if len(self._ticks) >= self._full:
            self._fold()
        self._ticks.append(tick)
        self._moves.append(self._x())

    def hold(self, share: float) -> None:
        """Book the effort that the target holds over `share` of its step."""
        effort = self._held() if share == 1.0 else self._held() * share
        if len(self._efforts) < len(self._moves):
            self._efforts.append(effort)
        else:
            self._efforts[-1] += effort

    def mark(self, room: int) -> Mark:
        """Checkpoint for `back` (rollback); keeps at least `room` rows."""
        if len(self._ticks) + room >= self._full:
            self._fold()
        return len(self._stamps), len(self._ticks), len(self._efforts)

    def back(self, mark: Mark) -> None:
        """Roll back to the checkpoint `mark`."""
        stamps, ticks, efforts = mark
        del self._stamps[stamps:], self._samples[stamps:]
        del self._ticks[ticks:], self._moves[ticks:], self._efforts[efforts:]

    def energy(self, seconds: float) -> Energy:
        """The account; `seconds` is the base."""
        if not self._stamps or not self._ticks:
            return Energy(0.0, 0.0, 0.0, 0.0, 0.0)
        book = self._book()
        until = self._stamps[book.sample] * seconds
        return Energy(book.work - book.ideal, book.work, book.ideal, until, book.most)

    def _book(self) -> _Sums:
        """All sums up to the newest sample that the target has moved past."""
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
        there = np.stack([np.interp(stamps, ticks, column) for column in x.T], axis=1)
        ideal = np.zeros(len(stamps))
        done = (efforts[:-1] + efforts[1:]) / 2 * np.diff(there, axis=0)
        ideal[1:] = done.sum(axis=1).cumsum()
        held = np.interp(stamps, ticks, work)
        return _Sums(
            self._work + float(held[-1]),
            self._work + float(work[row]),
            self._ideal + float(ideal[-1]),
            sample,
            row,
            max(self._most, float((held - ideal).max()) + self._work - self._ideal),
        )

    def _fold(self) -> None:
        """Drop rows that are in the sums; grow the buffer where a slow source still needs them."""
        if self._stamps:
            book = self._book()
            self._work, self._ideal, self._most = book.work_at_row, book.ideal, book.most
            del self._stamps[: book.sample], self._samples[: book.sample]
            del self._ticks[: book.row], self._moves[: book.row], self._efforts[: book.row]
        self._full = max(ROWS, 2 * len(self._ticks))
