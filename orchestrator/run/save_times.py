"""When the state of a run is saved, and to which files."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from heapq import merge
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Timeline, exact
from hapticlink.orchestrator.results.state_file import SUFFIX
from hapticlink.orchestrator.run import run_state
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop, Halt
from hapticlink.orchestrator.run.simulation import Simulation

END, LAST = f"end{SUFFIX}", f"last{SUFFIX}"
SaveTime = float | str
"""A time (s), "end", or "every=S" for each S seconds."""
SHORTEST = 1e-3
"""Time (s) between two states at least."""


@dataclass(frozen=True)
class SaveTimes:
    """At `times` (s), by the name of the file; and every so many seconds, each in the place of the
    one before."""

    times: tuple[tuple[str, float | None], ...] = ()
    every: float | None = None

    @property
    def files(self) -> list[str]:
        return [*(name for name, _ in self.times), *([LAST] if self.every else ())]

    def ticks(self, timeline: Timeline, begin: float) -> Iterator[tuple[int, str]]:
        """The ticks of a run that begins at `begin` (s), in their order, with the names of files.
        Raises InputFault for a time that is not within it."""
        last = last_whole(timeline)
        once = sorted((self._tick(timeline, begin, last, at), name) for name, at in self.times)
        return merge(once, self._regular(timeline, begin, last))

    @staticmethod
    def _tick(timeline: Timeline, begin: float, last: int, at: float | None) -> int:
        tick = last if at is None else math.ceil(timeline.ticks_until(exact(at)))
        if timeline.time(tick) > begin and tick <= last:
            return tick
        most = timeline.time(last)
        shown = "end" if at is None else f"{at:g}"
        raise InputFault(
            f"--save {shown}: give a time after {begin:g} s, up to {most:g} s, from where on steps "
            "that would pass the end of the run are left out; or a longer duration"
        )

    def _regular(self, timeline: Timeline, begin: float, last: int) -> Iterator[tuple[int, str]]:
        if self.every:
            step, n = exact(self.every), math.floor(exact(begin) / exact(self.every)) + 1
            while (tick := math.ceil(timeline.ticks_until(n * step))) <= last:
                yield tick, LAST
                n += 1


NO_TIMES = SaveTimes()


@dataclass(frozen=True)
class Saving:
    """What saves the states of a run. ticks: with the name of the file in `folder`; scene: its
    tables; saved: the names of files that were written, with the times (s) of their states."""

    ticks: Iterator[tuple[int, str]]
    folder: Path
    scene: Mapping[str, Any]
    saved: dict[str, float] = field(default_factory=dict)

    def halts(self, simulation: Simulation, loop: CompiledLoop) -> Iterator[Halt]:
        run_state.require_plain_holds(simulation)

        def save(name: str) -> None:
            time = run_state.save(self.folder / name, self.scene, simulation, loop)
            self.saved[name] = time

        return ((tick, partial(save, name)) for tick, name in self.ticks)


def last_whole(timeline: Timeline) -> int:
    """The tick of the first event at which a step is left out since it would pass the end: a state
    from before it is that of any longer run, too."""
    ends = (clock.starts[bisect_right(clock.starts, timeline.end) - 1] for clock in timeline.clocks)
    return min(ends)


def read_save_times(given: Sequence[SaveTime]) -> SaveTimes:
    """Raises InputFault for what is none of the three."""
    times: dict[str, float | None] = {}
    every: float | None = None
    for each in given:
        if each == "end":
            times[END] = None
            continue
        key, equals, text = str(each).rpartition("=")
        number = _positive(text) if key == "every" * bool(equals) else None
        if number is None or (key and number < SHORTEST):
            raise InputFault(f"--save {each}: write a time (s), `end`, or every=S, e.g. every=0.5")
        if key:
            every = number
        else:
            times[f"at-{number:.12g}{SUFFIX}"] = number
    return SaveTimes(tuple(times.items()), every)


def _positive(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0 < number < math.inf else None
