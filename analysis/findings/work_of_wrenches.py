"""The work of wrenches at positions, as they act and as their sources have them, window by window.

Each is a sum over the steps of a run, which goes on in the next window where it was left.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.orchestrator.base.signal_names import ENVIRONMENT_WRENCH, HANDLE_POSE, POINT_POSE
from hapticlink.orchestrator.results.read_results import Results, Table, Vector
from hapticlink.orchestrator.results.run_record import Energy, RunRecord
from hapticlink.orchestrator.system.latency_and_loss import SampleLink


class Arrivals:
    """When the samples of a connection's source, the rows of a table, were known to its target.

    The recorded latency, with its seed, gives that of all samples that the link counted as sent.
    Without a link, or where its counts are not those of the samples (rows that are left out, steps
    that are repeated), and in the order of Jacobi, the largest age on one clock is taken for that
    of each sample.
    """

    def __init__(self, record: RunRecord, connection: str, samples: int, same_clock: bool) -> None:
        """same_clock: whether the rows are those of the FMU's clock."""
        self._late = _drawn(record, connection, samples)
        age = record.delays.get(connection) if same_clock else None
        self._age = age.max if age else 0.0

    def known(self, stamps: Vector, first: int) -> Vector:
        """The times (s) from which samples, the `first` and those that follow, stamped `stamps`
        were known; infinite for lost ones."""
        if self._late is None:
            return stamps + self._age
        return stamps + self._late[first : first + len(stamps)]


def _drawn(record: RunRecord, connection: str, samples: int) -> Vector | None:
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


class Held:
    """The work (J) of the newest of the forces (n, 3), known from some times on, over the steps of
    a position. A force that comes after a newer one does not act."""

    def __init__(self) -> None:
        self._force, self._known = np.zeros((0, 3)), np.zeros(0)
        self._taken = self._reached = -np.inf
        self._done: float | None = None

    def at(
        self,
        times: Vector,
        force: Vector,
        known: Vector,
        stamps: Vector,
        path: tuple[Vector, Vector],
        end: float,
    ) -> Vector:
        """The work until the times of a window that ends at `end` (s), along times and places."""
        new = stamps > self._taken
        self._force = np.concatenate([self._force, force[new]])
        self._known = np.concatenate([self._known, known[new]])
        self._taken = max(self._taken, stamps[-1])
        time, x = (each[path[0] >= self._reached] for each in path)
        order = np.argsort(self._known, kind="stable")
        newest = np.maximum.accumulate(order)
        rows = np.searchsorted(self._known[order], time + 1e-12, "right") - 1
        held = self._force[newest[np.maximum(rows[:-1], 0)]]
        done = _running(self._done, (held * np.diff(x, axis=0)).sum(axis=1))
        last = max(int(np.searchsorted(time, end, "right")) - 1, 0)
        self._reached, self._done = time[last], float(done[last])
        if rows[last] >= 0:
            acting = newest[rows[last]]
            self._force, self._known = self._force[acting:], self._known[acting:]
        return np.interp(times, time, done)


class Ideal:
    """The work (J) of forces (n, 3) that are linear in the displacement between their stamps."""

    def __init__(self) -> None:
        self._reached = -np.inf
        self._done: float | None = None

    def at(
        self,
        times: Vector,
        force: Vector,
        stamps: Vector,
        path: tuple[Vector, Vector],
        end: float,
    ) -> Vector:
        """The work until the times of a window that ends at `end` (s), along times and places."""
        from_here = stamps >= self._reached
        stamps, force = stamps[from_here], force[from_here]
        at_stamps = np.stack([np.interp(stamps, path[0], x) for x in path[1].T], axis=1)
        mean = (force[:-1] + force[1:]) / 2
        done = _running(self._done, (mean * np.diff(at_stamps, axis=0)).sum(axis=1))
        last = max(int(np.searchsorted(stamps, end, "right")) - 1, 0)
        self._reached, self._done = stamps[last], float(done[last])
        return np.interp(times, stamps, done)


def _running(before: float | None, steps: Vector) -> Vector:
    """The sums up to each step; `before`: that of earlier windows."""
    if before is None:
        return np.concatenate([[0.0], steps.cumsum()])
    return np.concatenate([[before], steps]).cumsum()


class Passing:
    """A series changed in proportion to its own path so that it passes `value` at the time `until`,
    which takes two passes over the windows."""

    def __init__(self, until: float, value: float) -> None:
        self._until, self._value = until, value
        self._to, self._reached, self._begin = 0.0, 0.0, 0.0
        self._before: tuple[float, float] | None = None

    def again(self) -> None:
        """The second pass begins."""
        self._before = None

    def path(self, series: Vector, times: Vector) -> Vector:
        """The path of the series up to the times of a window, among which `until` is."""
        if self._before is None:
            self._begin = float(times[0]) if len(times) else 0.0
            path = np.concatenate([[0.0], np.abs(np.diff(series)).cumsum()])
        else:
            walked, value = self._before
            steps = np.abs(np.diff(np.concatenate([[value], series])))
            path = np.concatenate([[walked], steps]).cumsum()[1:]
        if len(path):
            self._before = float(path[-1]), float(series[-1])
        at = np.flatnonzero(times == self._until)
        if len(at):
            self._to, self._reached = float(path[at[0]]), float(series[at[0]])
        return path

    def changed(self, series: Vector, times: Vector) -> Vector:
        """The changed series, in the second pass."""
        path, to = self.path(series, times), self._to
        if not to:
            path, to = times - self._begin, max(self._until - self._begin, 1e-300)
        found: Vector = series + (self._value - self._reached) * path / to
        return found


class Work:
    """The work (J) of a wrench at a position: as it acts, and that of its source."""

    def __init__(self, arrivals: Arrivals | None, meter: Energy | None, whole: bool) -> None:
        """whole: the run is one window, so that both passes are made of it."""
        self._arrivals, self.until = arrivals, meter.until if meter else None
        ends = (meter.held, meter.ideal) if meter else ()
        self._passing = [Passing(meter.until, end) for end in ends] if meter else []
        self._whole = whole
        self.again(final=False)

    def again(self, final: bool = True) -> None:
        """The second pass begins."""
        self._held, self._ideal, self._final = Held(), Ideal(), final
        for passing in self._passing:
            passing.again()

    def at(
        self, times: Vector, force: Vector, table: Table, path: tuple[Vector, Vector], end: float
    ) -> tuple[Vector, ...]:
        """Both until the times, which have `until`, of a window that ends at `end` (s)."""
        stamps = table["time"]
        known = self._arrivals.known(stamps, table.first) if self._arrivals else stamps
        both = (
            self._held.at(times, force, known, stamps, path, end),
            self._ideal.at(times, force, stamps, path, end),
        )
        if not self._passing:
            return both
        pairs = [*zip(self._passing, both, strict=True)]
        if not self._final:
            for passing, series in pairs:
                passing.path(series, times)
            if not self._whole:
                return both
            for passing in self._passing:
                passing.again()
        return tuple(passing.changed(series, times) for passing, series in pairs)


Key = tuple[str, str, float, str | None]


class Works:
    """The works of a run, in two passes over its windows: those of the first, as far as a meter has
    them, are not those of the meter yet. One pass suffices where the `whole` run is one window."""

    def __init__(self, whole: bool = False) -> None:
        self._whole = whole
        self._of: dict[Key, Work] = {}
        self._window: Results | None = None
        self._found: dict[Key, tuple[Vector, Vector]] = {}
        """Of the window, which several ask for."""
        self._begin()

    def _begin(self) -> None:
        self._added, self._contacts = Held(), Ideal()
        self._absolute: dict[str, float] = {}

    def again(self) -> None:
        """The second pass begins."""
        self._window = None
        self._begin()
        for each in self._of.values():
            each.again()

    def of(
        self,
        window: Results,
        signal: str,
        position: str,
        times: Vector,
        sign: float = 1.0,
        connection: str | None = None,
    ) -> tuple[Vector, Vector]:
        """The work (J) of a wrench at a position until the times of a window: as it acts, and that
        of its source. `connection` is that with which it acts; by default one from the signal to
        the FMU of the position, without which the newest sample acts."""
        table, moved = table_of(window, signal), table_of(window, position)
        if not (table and moved):
            raise KeyError(f"work needs the signals {signal} and {position}")
        key = signal, position, sign, connection
        if self._window is not window:
            self._window, self._found = window, {}
        if key in self._found:
            return self._found[key]
        if (work := self._of.get(key)) is None:
            work = self._of[key] = _metered(window, key, table, moved, self._whole)
        until, to = work.until, times
        if until is not None and window.begin < until <= window.end:
            # Where the meter stops may be beside or after the times.
            to, _ = np.unique(np.append(times, until), return_index=True)
        path = moved["time"], moved[position]
        found = work.at(to, sign * table[signal], table, path, window.end)
        acts, source = (each[np.searchsorted(to, times)] for each in found)
        self._found[key] = acts, source
        return acts, source

    def absolute(self, window: Results, signal: str, position: str) -> float:
        """The absolute values (J) of a wrench's work in the steps of a position of the same rate,
        summed until the end of a window."""
        moved = table_of(window, position)
        assert moved
        work = (moved[signal][:-1] * np.diff(moved[position], axis=0)).sum(axis=1)
        steps = np.abs(work[window.within(moved["time"][1:])])
        total = float(_running(self._absolute.get(signal, 0.0), steps)[-1])
        self._absolute[signal] = total
        return total

    def added(self, window: Results, force: Vector, device: Table, times: Vector) -> Vector:
        """The work (J) of forces at the rows of the device on its handle, without a meter."""
        stamps = device["time"]
        path = stamps, device[HANDLE_POSE]
        return self._added.at(times, force, stamps, stamps, path, window.end)

    def ideal(self, window: Results, contact: Table, times: Vector) -> Vector:
        """The work (J) of contacts on the operational point, linear in its displacement."""
        stamps = contact["time"]
        path = stamps, contact[POINT_POSE]
        return self._contacts.at(times, contact[ENVIRONMENT_WRENCH], stamps, path, window.end)


def _metered(window: Results, key: Key, table: Table, moved: Table, whole: bool) -> Work:
    signal, position, _, connection = key
    meters, start = window.record.meters, f"{signal} -> {position.partition('.')[0]}."
    name = connection or next((each for each in meters if each.startswith(start)), None)
    if name is None:
        return Work(None, None, whole)
    arrivals = Arrivals(window.record, name, table.total, table is moved)
    return Work(arrivals, meters[name], whole)
