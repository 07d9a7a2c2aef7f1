"""The work of wrenches at positions over time, as they act and as their sources have them."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.orchestrator.results.read_results import Results, Table, Vector
from hapticlink.orchestrator.results.run_record import RunRecord
from hapticlink.orchestrator.system.latency_and_loss import SampleLink

SAME_S = 1e-12
"""Time (s) up to which a row's time is that of another."""


def arrivals(record: RunRecord, connection: str, table: Table, same_clock: bool) -> Vector:
    """The times (s) from which the samples of a connection's source, the rows of a table, were
    known to its target; infinite for lost ones.

    The recorded latency, with its seed, gives that of all samples that the link counted as sent.
    Without a link, or where its counts are not those of the samples (rows that are left out, steps
    that are repeated), and in the order of Jacobi, the largest age on one clock is taken for that
    of each sample. same_clock: whether the rows are those of the FMU's clock.
    """
    stamps = table["time"]
    if (late := _draw_delays(record, connection, len(stamps))) is not None:
        return stamps + late
    age = record.delays.get(connection) if same_clock else None
    return stamps + age.max if age and age.max else stamps


def _draw_delays(record: RunRecord, connection: str, samples: int) -> Vector | None:
    """The delay (s) of each sample, infinite where it was lost, as the link has drawn it."""
    latency, counted = record.latencies.get(connection), record.links.get(connection)
    if not latency or not counted or record.coupling == "jacobi":
        return None
    base = Fraction(record.base.split()[0])
    link = SampleLink(latency, base)
    ticks = np.array([link.draw() for _ in range(counted.sent)])
    # The sample of t = 0 is known at once; that of a sampled block is sent again beside it.
    again = counted.sent - (samples - 1)
    if again not in (0, 1) or np.count_nonzero(ticks < 0) != counted.lost:
        return None
    late = np.where(ticks < 0, np.inf, ticks * float(base))[again:]
    return np.concatenate([[0.0], late])


def _sums(steps: Callable[[Table], Vector], table: Table) -> Vector:
    """The sums of a table's steps between rows, (..., n), up to each of these."""
    each = np.concatenate([steps(block) for block in table.blocks(more=1)], axis=-1)
    sums = np.zeros((*each.shape[:-1], each.shape[-1] + 1))
    np.cumsum(each, axis=-1, out=sums[..., 1:])
    return sums[..., : len(table.rows)]


def _at(times: Vector, known: Vector, series: Vector) -> Vector:
    """A series at other times, linear between those at which it is known."""
    same = times is known or np.array_equal(times, known)
    return series if same else np.interp(times, known, series)


def work_as_held(
    times: Vector,
    force_at: Callable[[NDArray[np.intp]], Vector],
    known: Vector,
    moved: Table,
    position: str,
) -> Vector:
    """The work (J), until some times (s), of the newest of the forces of some rows, (n, 3), which
    are known from some times on, over the steps of a position. A force that comes after a newer one
    does not act."""
    newest = None
    if (known[1:] < known[:-1]).any():
        order = np.argsort(known, kind="stable")
        known, newest = known[order], np.maximum.accumulate(order)

    def steps(block: Table) -> Vector:
        rows = np.searchsorted(known, block["time"][:-1] + SAME_S, "right") - 1
        rows = np.maximum(rows, 0)
        force = force_at(rows if newest is None else newest[rows])
        return _work(force, block[position])

    return _at(times, moved["time"], _sums(steps, moved))


def work_of_source(
    times: Vector, wrench: Table, signal: str, moved: Table, position: str, sign: float = 1.0
) -> Vector:
    """The work (J), until some times (s), of a wrench that is linear in the displacement between
    its stamps."""
    elsewhere = None if moved is wrench else (moved["time"], moved[position])

    def steps(block: Table) -> Vector:
        if elsewhere is None:
            at_stamps = block[position]
        else:
            path, place = elsewhere
            at_stamps = np.stack([np.interp(block["time"], path, x) for x in place.T], axis=1)
        return _work(_mean(_signed(sign, block[signal])), at_stamps)

    return _at(times, wrench["time"], _sums(steps, wrench))


def _of_one_table(
    times: Vector, table: Table, signal: str, position: str, sign: float
) -> tuple[Vector, Vector]:
    """As `work_as_held` and `work_of_source`, of samples that act from their stamps on."""

    def steps(block: Table) -> Vector:
        force, place = _signed(sign, block[signal]), block[position]
        return np.stack([_work(force[:-1], place), _work(_mean(force), place)])

    acts, source = _sums(steps, table)
    return _at(times, table["time"], acts), _at(times, table["time"], source)


def _work(force: Vector, place: Vector) -> Vector:
    """The work of a force in each step from one place to the next."""
    work: Vector = (force * (place[1:] - place[:-1])).sum(axis=1)
    return work


def _mean(force: Vector) -> Vector:
    return (force[:-1] + force[1:]) / 2


def _signed(sign: float, force: Vector) -> Vector:
    return force if sign == 1.0 else sign * force


def absolute_work(moved: Table, signal: str, position: str) -> float:
    """The absolute values (J) of a wrench's work in the steps of a position of the same table,
    summed."""

    def steps(block: Table) -> Vector:
        return np.abs(_work(block[signal][:-1], block[position]))

    return last(_sums(steps, moved))


def _passing(series: Vector, times: Vector, at: int, value: float) -> Vector:
    """A series changed in proportion to its own path so that it passes `value` at the time with the
    number `at`."""
    path = np.zeros(len(series))
    np.subtract(series[1:], series[:-1], out=path[1:])
    np.cumsum(np.abs(path, out=path), out=path)
    to, change = float(path[at]), value - float(series[at])
    if not to:
        path, to = times - times[0], max(float(times[at] - times[0]), 1e-300)
    path *= change
    path /= to
    path += series
    return path


class Works:
    """The works of a run. `last`: those of wrenches as they act at the last of the times, by signal
    and position."""

    def __init__(self, results: Results, times: Vector) -> None:
        self._results, self._times, self._meters = results, times, results.record.meters
        self._last: dict[tuple[str, str], float] = {}

    def of(
        self, signal: str, position: str, sign: float = 1.0, connection: str | None = None
    ) -> tuple[Vector, Vector]:
        """The work (J) of a wrench at a position until the times: as it acts, and that of its
        source. `connection` is that with which it acts; by default one from the signal to the FMU
        of the position, without which the newest sample acts."""
        results, times = self._results, self._times
        table, moved = table_of(results, signal), table_of(results, position)
        if not (table and moved):
            raise KeyError(f"work needs the signals {signal} and {position}")
        meters, start = self._meters, f"{signal} -> {position.partition('.')[0]}."
        name = connection or next((each for each in meters if each.startswith(start)), None)
        known = arrivals(results.record, name, table, table is moved) if name else table["time"]

        def force_at(rows: NDArray[np.intp]) -> Vector:
            if not len(rows):
                return np.zeros((0, *table.shape(signal)))
            first = int(rows.min())
            part = table.part(slice(first, int(rows.max()) + 1))
            return _signed(sign, part[signal][rows - first])

        # Of a run that goes on from a state, meters have the energies before its rows, too.
        meter = meters[name] if name and not results.record.resumed else None
        at = int(np.searchsorted(times, meter.until)) if meter else 0
        if between := meter and not (at < len(times) and times[at] == meter.until):
            times = np.insert(times, at, meter.until)
        if moved is table and known is table["time"] and table.least_step > SAME_S:
            acts, source = _of_one_table(times, table, signal, position, sign)
        else:
            acts = work_as_held(times, force_at, known, moved, position)
            source = work_of_source(times, table, signal, moved, position, sign)
        if meter:
            acts = _passing(acts, times, at, meter.held)
            source = _passing(source, times, at, meter.ideal)
        if between:
            acts, source = np.delete(acts, at), np.delete(source, at)
        if connection is None:
            self._last[signal, position] = last(acts)
        return acts, source

    def last(self, signal: str, position: str) -> float:
        """The work (J) of a wrench, as it acts, at the last of the times."""
        if (signal, position) not in self._last:
            self.of(signal, position)
        return self._last[signal, position]


def last(work: Vector) -> float:
    """The last of a series, 0 of an empty one."""
    return float(work[-1]) if len(work) else 0.0
