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

from collections.abc import Callable
from functools import reduce
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector

Read = Callable[[], Vector]
Rows = TypeVar("Rows", NDArray[np.float64], NDArray[np.int64])
ROWS = 1024
"""Rows of the target's steps that are kept before they are added to the sums."""
Mark = tuple[int, int, int]


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

    stamps and samples are of the source, ticks, moves and efforts of the target's steps, `full` the
    number of these that are kept; counts: of stamps, ticks and efforts. The compiled loop writes
    rows, too; `changed` is called when the arrays have been replaced.
    """

    def __init__(self, source: Read, held: Read, x: Read) -> None:
        self.source, self.held, self.x = source, held, x
        self.changed: Callable[[], object] = lambda: None
        n = len(source())
        self.counts = np.zeros(3, np.int64)
        self.stamps: NDArray[np.int64] = np.zeros(ROWS, np.int64)
        self.ticks: NDArray[np.int64] = np.zeros(ROWS, np.int64)
        self.samples, self.moves = np.zeros((ROWS, n)), np.zeros((ROWS, n))
        self.efforts = np.zeros((ROWS, n))
        self.totals = np.zeros(3)
        self.full = ROWS

    def sample(self, stamp: int) -> None:
        """Record the source's new sample, stamped `stamp`."""
        n = self.counts[0]
        if n and self.stamps[n - 1] == stamp:
            self.samples[n - 1] = self.source()
            return
        if n == len(self.stamps):
            self.stamps, self.samples = _grown(self.stamps, 2 * n), _grown(self.samples, 2 * n)
            self.changed()
        self.stamps[n], self.samples[n] = stamp, self.source()
        self.counts[0] = n + 1

    def move(self, tick: int) -> None:
        """Record the target's displacement at `tick`."""
        n = self.counts[1]
        if n and self.ticks[n - 1] == tick:
            return
        if n >= self.full:
            self._fold()
            n = self.counts[1]
        self.ticks[n], self.moves[n] = tick, self.x()
        self.counts[1] = n + 1

    def hold(self, share: float) -> None:
        """Record the effort that the target holds over a fraction `share` of its step."""
        effort = self.held() if share == 1.0 else self.held() * share
        _, moves, n = self.counts
        if n < moves:
            self.efforts[n] = effort
            self.counts[2] = n + 1
        else:
            self.efforts[n - 1] += effort

    def checkpoint(self, rows: int) -> Mark:
        """Checkpoint for `rollback`, valid for up to `rows` further rows."""
        if self.counts[1] + rows >= self.full:
            self._fold()
        stamps, ticks, efforts = self.counts.tolist()
        return stamps, ticks, efforts

    def rollback(self, mark: Mark) -> None:
        """Remove what was recorded since the checkpoint `mark`."""
        self.counts[:] = np.minimum(self.counts, mark)

    def energy(self, seconds: float) -> Energy:
        """The energies until now; `seconds` is the length of a tick (s)."""
        if not self.counts[0] or not self.counts[1]:
            return Energy(0.0, 0.0, 0.0, 0.0, 0.0)
        sums = self._sums()
        until = int(self.stamps[sums.sample]) * seconds
        return Energy(sums.work - sums.ideal, sums.work, sums.ideal, until, sums.peak)

    def _sums(self) -> _Sums:
        """All sums up to the newest sample that the target has stepped past."""
        ticks, x = self.ticks[: self.counts[1]], self.moves[: self.counts[1]]
        known = self.stamps[: self.counts[0]]
        sample = max(int(np.searchsorted(known, ticks[-1], "right")) - 1, 0)
        stamps, efforts = known[: sample + 1], self.samples[: sample + 1]
        row = max(int(np.searchsorted(ticks, stamps[-1], "right")) - 1, 0)
        work = np.zeros(len(ticks))
        if len(ticks) > 1:
            done = self.efforts[: len(ticks) - 1] * np.diff(x, axis=0)
            work[1:] = _over_entries(done).cumsum()
        interpolated = _between(stamps, ticks)
        x_stamps = interpolated(x)
        ideal = np.zeros(len(stamps))
        done = (efforts[:-1] + efforts[1:]) / 2 * np.diff(x_stamps, axis=0)
        ideal[1:] = _over_entries(done).cumsum()
        held = interpolated(work)
        total, total_ideal, peak = self.totals.tolist()
        return _Sums(
            total + float(held[-1]),
            total + float(work[row]),
            total_ideal + float(ideal[-1]),
            sample,
            row,
            max(peak, float((held - ideal).max()) + total - total_ideal),
        )

    def _fold(self) -> None:
        """Add rows to the sums and drop them; grow the arrays if a slow source still needs them."""
        if self.counts[0]:
            sums = self._sums()
            self.totals[:] = sums.work_at_row, sums.ideal, sums.peak
            for array in (self.stamps, self.samples):
                array[: -sums.sample or None] = array[sums.sample :]
            for array in (self.ticks, self.moves, self.efforts):
                array[: -sums.row or None] = array[sums.row :]
            self.counts -= (sums.sample, sums.row, min(sums.row, self.counts[2]))
        self.full = max(ROWS, 2 * int(self.counts[1]))
        if self.full > len(self.ticks):
            self.ticks, self.moves = _grown(self.ticks, self.full), _grown(self.moves, self.full)
            self.efforts = _grown(self.efforts, self.full)
        self.changed()


def _over_entries(rows: Vector) -> Vector:
    """The sum over each row, column by column: NumPy's along rows takes seven times as long."""
    sums: Vector = reduce(np.add, rows.T)
    return sums


def _between(stamps: NDArray[np.int64], ticks: NDArray[np.int64]) -> Callable[[Vector], Vector]:
    """Linear interpolation, at `stamps`, of values or rows at `ticks`; without it where these are
    the same, as at one rate."""
    n = len(stamps)
    if np.array_equal(ticks[:n], stamps):
        return lambda values: values[:n]

    def interpolated(values: Vector) -> Vector:
        if values.ndim == 1:
            return np.interp(stamps, ticks, values)
        return np.stack([np.interp(stamps, ticks, column) for column in values.T], axis=1)

    return interpolated


def _grown(array: Rows, rows: int) -> Rows:
    """A copy with `rows` rows, the new ones 0."""
    grown = np.zeros((rows, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


class Meters:
    """One meter for each connection that carries power, of the efforts that its target gets: `of`
    by its name, of_source and of_target the names by FMU. The gets and sets of a run update them
    (`instructions`)."""

    def __init__(self, signals: SignalVector) -> None:
        self.of: dict[str, Meter] = {}
        self.of_source: dict[str, list[str]] = {}
        self.of_target: dict[str, list[str]] = {}
        self._seconds = float(signals.system.timeline.base)
        for c in signals.system.connections:
            if power := bond(c, signals):
                source, held = (
                    Reader(signals, power.of(places), power.factor, power.offset)
                    for places in (signals.sources(c), signals.places(c))
                )
                self.of[c.name] = Meter(source, held, Reader(signals, power.moved, power.scale))
                self.of_source.setdefault(c.source, []).append(c.name)
                self.of_target.setdefault(c.target, []).append(c.name)

    def start(self) -> None:
        for meter in self.of.values():
            meter.sample(0)
            meter.move(0)

    def checkpoint(self) -> list[Mark]:
        """Checkpoint of all meters for `rollback`."""
        return [meter.checkpoint(4) for meter in self.of.values()]

    def rollback(self, marks: list[Mark]) -> None:
        """Remove what all meters recorded since the checkpoint `marks`."""
        for meter, mark in zip(self.of.values(), marks, strict=True):
            meter.rollback(mark)

    def energies(self) -> dict[str, Energy]:
        """The energies (J) of each connection that carries power, by its name."""
        return {name: meter.energy(self._seconds) for name, meter in self.of.items()}
