"""The report's experiment in real time, beside an empty timer loop of the same rate, and beside
cyclictest of the same rate and priority where it is installed.

The empty loop is the loop in C without an operation, in a thread of the same process that has the
normal priority. What cyclictest misses is the machine's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from threading import Thread
from typing import Any

from benchmarks import cyclictest
from benchmarks.page import Progress, load_average, system, table
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.ticks import Clock, Timeline
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.run import real_time_priority
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.compiled.loop import Events
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.real_time import RealTimeRun
from hapticlink.visualization.figures.real_time_figure import real_time

SCENE, RATE, SECONDS, QUICK = "closed-loop-ideal", 512, 60, 3
NEVER = 2**62
Report = Mapping[str, Any]


class EmptyLoop:
    """A loop of RATE Hz without an operation, in a thread."""

    def __init__(self, seconds: float) -> None:
        self.library, self.pace = load(), Pace()
        self.loop = structures.Loop(numerator=1.0, denominator=float(RATE))
        ticks = round(seconds * RATE)
        clock = Clock("timer", range(ticks + 3))
        timeline = Timeline(Fraction(1, RATE), ticks, (clock,))
        events: Any = Events
        self._events = events(self, timeline, lambda event: (0, 0), self.pace)
        self._events.patience(NEVER)
        self._thread = Thread(target=self._events.run, args=(lambda tick: None,))

    def publish(self) -> None:
        """It has no operations to publish."""

    def code(self, at: object, run: Callable[..., int], *arguments: int) -> int:
        """What a function of the loop returns."""
        return run(*arguments)

    def start(self) -> None:
        """Start, before the other loop, which would wait for the new thread's first turn."""
        self.pace.c.origin = self.pace.now()
        self._thread.start()

    def report(self) -> Report:
        """What became of it, once it has ended."""
        self._thread.join()
        assert self.pace.c.ticks, "the empty loop did not run"
        return self.pace.report()


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes real_time.png to `folder`."""
    seconds = QUICK if quick else SECONDS
    empty, load = EmptyLoop(seconds), load_average()
    options = ["packaging=native", f"duration={seconds}", f"haptics.rate={RATE}"]
    with (
        cyclictest.beside(RATE, real_time_priority.PRIORITY) as latencies,
        temporary_folders.temporary_folder() as room,
    ):
        empty.start()
        results = simulate(
            SCENE,
            room,
            options,
            lambda time: progress(SCENE, int(time), seconds),
            real_time=RealTimeRun(),
        ).results
    report = results.record.real_time
    assert report, results.record.fault
    assert not results.record.fault, results.record.fault
    beside = empty.report()
    curves = {"lateness of an empty loop": beside["histograms"]["lateness"]}
    figure = real_time(results, curves, f"an empty loop beside it misses {missed(beside)}")
    assert figure
    figure.savefig(folder / "real_time.png", dpi=150)
    return page(report, beside, latencies[0] if latencies else None, seconds, load, command)


def missed(report: Report) -> str:
    return f"{report['deadlines_missed'] or 'none'}"


def page(
    ours: Report,
    empty: Report,
    latencies: cyclictest.Latencies | None,
    seconds: int,
    load: float,
    command: str,
) -> str:
    """The page: deadlines missed by both loops and by cyclictest, and the table of their times."""
    priority = real_time_priority.PRIORITY
    rows = {
        "step time of the haptic loop": ours["step_time"],
        "lateness of the haptic loop": ours["lateness"],
        "lateness of the empty loop": empty["lateness"],
    }
    machine = []
    if latencies:
        rows["lateness of cyclictest"] = latencies.quantiles()
        later = latencies.later_than(ours["period"])
        machine = [
            f"`cyclictest` at priority {priority} in the same time woke later than a period "
            f"{later or 'not once'} of {latencies.wakings} times."
        ]
    samples = ours["samples"]["graphics"]
    lines = [
        "# Real time",
        "",
        f"In {seconds} s at {RATE} Hz the haptic loop of `{SCENE}` with native FMUs missed "
        f"{missed(ours)} of {ours['ticks']} deadlines, an empty timer loop beside it "
        f"{missed(empty)} of {empty['ticks']}.",
        *machine,
        "",
        "![Share of ticks whose step time and lateness exceed a time](real_time.png)",
        "",
        f"Made by `{command}`, on {system()} and a load average of {load:.1f} before; the loop's "
        f"scheduler: {ours['priority']['scheduler']}. "
        f"Milliseconds; the deadline of a tick is the next one, {short(1e3 * ours['period'])} ms "
        "after it was due. Rows are recorded, the "
        f"graphics clock runs in a thread: {samples['late']} of its {samples['taken']} samples "
        f"were late, at most by {short(1e3 * samples['largest_lateness'])} ms.",
        "",
        *table(
            f"| {' | '.join(ours['lateness'])}",
            "l" + "r" * len(ours["lateness"]),
            ([name, *(short(1e3 * t) for t in row.values())] for name, row in rows.items()),
        ),
        "",
    ]
    return "\n".join(lines)
