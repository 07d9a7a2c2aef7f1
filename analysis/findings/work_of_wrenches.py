"""The work of wrenches at positions over time, as they act and as their sources have them."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.orchestrator.results.read_results import Results, Table, Vector
from hapticlink.orchestrator.results.run_record import RunRecord
from hapticlink.orchestrator.system.latency_and_loss import Link


def arrivals(record: RunRecord, connection: str, table: Table, same_clock: bool) -> Vector:
    """The times (s) from which the samples of a connection's source, the rows of a table, were
    known to its target; infinite for lost ones.

    The recorded latency, with its seed, gives that of all samples that the link counted as sent.
    Without a link, or where its counts are not those of the samples (rows that are left out, steps
    that are repeated), and in the order of Jacobi, the largest age on one clock is taken for that
    of each sample. same_clock: whether the rows are those of the FMU's clock.
    """
    stamps = table["time"]
    if (late := _drawn(record, connection, len(stamps))) is not None:
        return stamps + late
    age = record.delays.get(connection) if same_clock else None
    return stamps + age.max if age and age.max else stamps


def _drawn(record: RunRecord, connection: str, samples: int) -> Vector | None:
    """The delay (s) of each sample, infinite where it was lost, as the link has drawn it."""
    latency, counted = record.latencies.get(connection), record.links.get(connection)
    if not latency or not counted or record.coupling == "jacobi":
        return None
    base = Fraction(record.base.split()[0])
    link = Link(latency, base)
    ticks = np.array([link.draw() for _ in range(counted.sent)])
    # The sample of t = 0 is known at once; that of a sampled block is sent again beside it.
    again = counted.sent - (samples - 1)
    if again not in (0, 1) or np.count_nonzero(ticks < 0) != counted.lost:
        return None
    late = np.where(ticks < 0, np.inf, ticks * float(base))[again:]
    return np.concatenate([[0.0], late])


def _sums(rows: int, steps: Callable[[Table], Vector], table: Table) -> Vector:
    """The sums of a table's steps between rows up to each of these."""
    sums, done = np.zeros(rows), 0
    for block in table.blocks(more=1):
        found = steps(block)
        sums[done + 1 : done + 1 + len(found)] = found
        done += len(found)
    np.cumsum(sums[1:], out=sums[1:])
    return sums


def work_as_held(
    times: Vector, force: Vector, known: Vector, moved: Table, position: str
) -> Vector:
    """The work (J), until some times (s), of the newest of the forces (n, 3), which are known from
    some times on, over the steps of a position. A force that comes after a newer one does not
    act."""
    order = np.argsort(known, kind="stable")
    newest = np.maximum.accumulate(order)
    known = known[order]

    def steps(block: Table) -> Vector:
        rows = np.searchsorted(known, block["time"][:-1] + 1e-12, "right") - 1
        held = force[newest[np.maximum(rows, 0)]]
        work: Vector = (held * np.diff(block[position], axis=0)).sum(axis=1)
        return work

    return np.interp(times, moved["time"], _sums(len(moved.rows), steps, moved))


def work_of_source(
    times: Vector, wrench: Table, force: Vector, moved: Table, position: str
) -> Vector:
    """The work (J), until some times (s), of forces (n, 3) that are linear in the displacement
    between their stamps."""
    path, place = moved["time"], moved[position]
    stamps, first = wrench["time"], 0

    def steps(block: Table) -> Vector:
        nonlocal first
        span = slice(first, first + len(block.rows))
        first = span.stop - 1
        at_stamps = np.stack([np.interp(stamps[span], path, x) for x in place.T], axis=1)
        mean = (force[span][:-1] + force[span][1:]) / 2
        work: Vector = (mean * np.diff(at_stamps, axis=0)).sum(axis=1)
        return work

    return np.interp(times, stamps, _sums(len(stamps), steps, wrench))


def absolute_work(results: Results, signal: str, position: str) -> float:
    """The absolute values (J) of a wrench's work in the steps of a position of the same rate,
    summed."""
    moved = table_of(results, position)
    assert moved

    def steps(block: Table) -> Vector:
        return np.abs((block[signal][:-1] * np.diff(block[position], axis=0)).sum(axis=1))

    sums = _sums(len(moved.rows), steps, moved)
    return float(sums[-1]) if len(sums) else 0.0


def _passing(series: Vector, times: Vector, until: float, value: float) -> Vector:
    """A series changed in proportion to its own path so that it passes `value` at a time that is
    among its times."""
    path = np.concatenate([[0.0], np.abs(np.diff(series)).cumsum()])
    at = int(np.searchsorted(times, until))
    to = float(path[at])
    if not to:
        path, to = times - times[0], max(until - float(times[0]), 1e-300)
    changed: Vector = series + (value - float(series[at])) * path / to
    return changed


class Works:
    """The works of a run. `last`: those of wrenches as they act at the last of the times, by signal
    and position."""

    def __init__(self, results: Results, times: Vector) -> None:
        self._results, self._times = results, times
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
        meters, start = results.record.meters, f"{signal} -> {position.partition('.')[0]}."
        name = connection or next((each for each in meters if each.startswith(start)), None)
        meter = meters[name] if name else None
        force = sign * table[signal]
        known = arrivals(results.record, name, table, table is moved) if name else table["time"]
        if meter:  # where the meter stops may be between or after the times
            times = np.unique(np.append(times, meter.until))
        acts = work_as_held(times, force, known, moved, position)
        source = work_of_source(times, table, force, moved, position)
        if meter:
            asked = np.searchsorted(times, self._times)
            acts = _passing(acts, times, meter.until, meter.held)[asked]
            source = _passing(source, times, meter.until, meter.ideal)[asked]
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
