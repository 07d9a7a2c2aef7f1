"""The energy meters of a run: the energy that sampling and holding an effort generates. What is
measured, and how, is told in run/compiled/meters.c."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import fill_reader
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import Connection

Ticks = NDArray[np.int64]
Rows = TypeVar("Rows", NDArray[np.float64], NDArray[np.int64])
ROWS = 1024
"""Rows of the target's steps that are kept before they are added to the sums."""
Mark = tuple[int, int, int]
_ROWS = ("stamps", "samples", "ticks", "moves", "efforts")


class Meter:
    """The energy meter of one connection.

    source and held read the effort at the source and as the target gets it, x the displacement with
    the sign of the power. stamps and samples are of the source, ticks, moves and efforts of the
    target's steps; counts: of stamps, ticks and efforts. The loop writes rows, and adds old ones to
    `totals` from time to time (run/compiled/meters.c). `c` is its structure.
    """

    def __init__(self, library: ctypes.CDLL, source: Reader, held: Reader, x: Reader) -> None:
        self._library, self._kept = library, (source, held, x)
        n = len(source.where)
        self.counts, self.totals = np.zeros(3, np.int64), np.zeros(3)
        self.stamps: Ticks = np.zeros(ROWS, np.int64)
        self.ticks: Ticks = np.zeros(ROWS, np.int64)
        self.samples, self.moves, self.efforts = np.zeros((3, ROWS, n))
        self.c = c = structures.Meter(full=ROWS, least=ROWS)
        for reader, of in ((source, c.source), (held, c.held), (x, c.x)):
            fill_reader(of, reader)
        c.fill(self, "counts", "totals")
        self.take_rows()

    def take_rows(self) -> None:
        """Tell the loop where the rows are, and how many there can be."""
        self.c.fill(self, *_ROWS)
        self.c.fill(room=len(self.stamps), rows=len(self.ticks))

    def start(self, values: Vector) -> None:
        """Take the first sample and displacement, those of t = 0."""
        assert not self._library.meter_start(ctypes.addressof(self.c), values.ctypes.data)

    def grow(self) -> None:
        """Make room for rows that a slow source still needs."""
        if self.counts[0] == len(self.stamps):
            room = 2 * len(self.stamps)
            self.stamps, self.samples = _grown(self.stamps, room), _grown(self.samples, room)
        if self.counts[1] >= self.c.full:
            rows = max(len(self.ticks), 2 * int(self.counts[1]))
            self.ticks, self.moves = _grown(self.ticks, rows), _grown(self.moves, rows)
            self.efforts = _grown(self.efforts, rows)
        self.take_rows()

    def checkpoint(self, rows: int) -> Mark:
        """Checkpoint for `rollback`, valid for up to `rows` further rows."""
        while self._library.meter_room(ctypes.addressof(self.c), rows + 1):
            self.grow()
        stamps, ticks, efforts = self.counts.tolist()
        return stamps, ticks, efforts

    def rollback(self, mark: Mark) -> None:
        """Remove what was recorded since the checkpoint `mark`."""
        self.counts[:] = np.minimum(self.counts, mark)

    def saved(self) -> dict[str, Any]:
        """All that it has counted and not added up yet."""
        arrays = {name: getattr(self, name).copy() for name in ("counts", "totals", *_ROWS)}
        return {"arrays": arrays, "full": self.c.full, "least": self.c.least}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from there."""
        arrays = saved["arrays"]
        self.counts[:], self.totals[:] = arrays["counts"], arrays["totals"]
        for name in _ROWS:
            setattr(self, name, arrays[name].copy())
        self.take_rows()
        self.c.fill(full=saved["full"], least=saved["least"])

    def energy(self, seconds: float, begin: float = 0.0) -> Energy:
        """The energies until now; `seconds` is the length of a tick, `begin` the time of the first
        (s)."""
        found = np.zeros(5)
        self._library.energy(ctypes.addressof(self.c), found.ctypes.data)
        generated, held, ideal, peak, stamp = found.tolist()
        return Energy(generated, held, ideal, begin + int(stamp) * seconds, peak)


def _grown(array: Rows, rows: int) -> Rows:
    """A copy with `rows` rows, the new ones 0."""
    grown = np.zeros((rows, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


class Meters:
    """One meter for each connection that carries power, of the efforts that its target gets: `of`
    by its name, of_source and of_target the names by FMU; tick_s, begin: the length of a
    tick, and the time of the first (s). The gets and sets of
    a run update them (`instructions`)."""

    def __init__(self, library: ctypes.CDLL, signals: SignalVector) -> None:
        self.of: dict[str, Meter] = {}
        self.of_source: dict[str, list[str]] = {}
        self.of_target: dict[str, list[str]] = {}
        self.take_time(signals.system.timeline)
        self._values = signals.values
        for c, readers in metered(signals):
            self.of[c.name] = Meter(library, *readers)
            self.of_source.setdefault(c.source, []).append(c.name)
            self.of_target.setdefault(c.target, []).append(c.name)

    def take_time(self, timeline: Timeline) -> None:
        self.tick_s, self.begin = float(timeline.base), float(timeline.begin)

    def start(self) -> None:
        for meter in self.of.values():
            meter.start(self._values)

    def checkpoint(self) -> list[Mark]:
        """Checkpoint of all meters for `rollback`."""
        return [meter.checkpoint(4) for meter in self.of.values()]

    def rollback(self, marks: list[Mark]) -> None:
        """Remove what all meters recorded since the checkpoint `marks`."""
        for meter, mark in zip(self.of.values(), marks, strict=True):
            meter.rollback(mark)

    def energies(self) -> dict[str, Energy]:
        """The energies (J) of each connection that carries power, by its name."""
        return {name: meter.energy(self.tick_s, self.begin) for name, meter in self.of.items()}


def metered(signals: SignalVector) -> Iterator[tuple[Connection, tuple[Reader, Reader, Reader]]]:
    """The connections that carry power, each with the readers of its effort at the source, as the
    target gets it, and of its displacement."""
    for c in signals.system.connections:
        if power := bond(c, signals):
            source, held = (
                Reader(signals, power.of(places), power.factor, power.offset)
                for places in (signals.sources(c), signals.places(c))
            )
            yield c, (source, held, Reader(signals, power.moved, power.scale))
