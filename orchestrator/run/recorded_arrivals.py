"""Runs a scene again with the arrivals of an earlier run in real time, without clock or network.

The steps beside the loop are done when the earlier run's samples arrived, by a clock that goes on
only while the loop waits for it; what a board measured is read where it was recorded, and ticks are
skipped that were skipped. Holds then get the same samples at the same ticks, so that tables
of the same FMUs have the same numbers, however late samples were.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.replayed_board import RecordedDriver
from hapticlink.orchestrator.network.served_part import OF_A_RUN
from hapticlink.orchestrator.results import run_record
from hapticlink.orchestrator.results.read_results import read_table
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.concurrent_fmus import SAMPLES, Job
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System

END = 1.0
"""Seconds behind the last recorded arrival after which none is waited for."""


class RecordedClock:
    """A clock (ns) that jumps to where the loop waits for, and the jobs that are done by it."""

    def __init__(self, begun: Sequence[int] = (), period: int = 0) -> None:
        """begun: the times (ns) at which the haptic loop has begun its events, of which those
        between were skipped, every `period`."""
        self.time = 0
        self._next = dict(pairwise(begun))
        self._period = period
        self._left: list[tuple[float, Job]] = []

    def __call__(self) -> int:
        left = self._left
        self._left = [row for row in left if row[0] > self.time]
        for due, done in left:
            if due <= self.time:
                done()
        return self.time

    def wait(self, until: int) -> None:
        behind = self._next.get(until, until) - self._period  # skips what is past until then
        self.time = max(self.time, until, behind + 1)

    def at(self, due: float, done: Job) -> None:
        """Call `done` at a time (ns)."""
        self._left.append((due, done))


class RecordedWorker:
    """Takes the steps of a clock's FMUs at once; the k-th sample is done at its arrival (s)."""

    def __init__(self, clock: RecordedClock, arrivals: Vector) -> None:
        self._clock, self._arrivals = clock, arrivals
        self._begun = self._done = self._sample = 0

    def submit(self, job: Job, done: Job) -> None:
        if self._begun == self._done:  # the first FMU's step of a sample
            self._sample += 1
        self._begun += 1
        job()

        def counted() -> None:
            self._done += 1
            done()

        late = self._sample >= len(self._arrivals)
        self._clock.at(math.inf if late else int(1e9 * self._arrivals[self._sample]), counted)

    def close(self, seconds: float) -> bool:
        return True


class RecordedArrivals(RealTimeRun):
    """A run of `scene` with the arrivals that are recorded in the folder of an earlier one. Raises
    InputFault where that was no run of this scene in real time."""

    def __init__(self, folder: Path, scene: Scene) -> None:
        self._folder = folder
        before = run_record.read_record(text_files.read_json(folder / "run.json"), folder)
        if not before.real_time:
            raise InputFault(f"{folder}: no run in real time, so that it has no arrivals")
        if hardware := [fmu.name for fmu in scene.fmu if fmu.hardware]:
            raise InputFault(f"{', '.join(map(str, hardware))}: hardware is not moved once more")
        plain = scene.tables()
        keys = [k for k in before.scene if k not in OF_A_RUN]
        if differing := [k for k in keys if not _same(before.scene[k], plain.get(k))]:
            raise InputFault(f"{folder}: a run of another scene: {', '.join(differing)} differ")
        boards = any(driver_of(scene, user) for user in scene.all_devices)
        self._table = read_table(folder / "haptics.csv") if boards else None
        clock, arrivals = RecordedClock(), {}
        if self._table is not None:
            begun = [int(1e9 * time) for time in self._table["time"]]
            clock = RecordedClock(begun, int(1e9 * before.real_time["period"]))
        for name in before.real_time["samples"]:
            arrivals[name] = read_table(folder / f"{name}_{SAMPLES}.csv")["arrival"]
        last = max([before.end.time or 0.0, *(float(a.max()) for a in arrivals.values())])
        self._end = 1e9 * (last + END)
        super().__init__(
            self._require_arrivals,
            clock,
            clock.wait,
            lambda name: RecordedWorker(clock, arrivals[name]),
        )

    def with_recordings(self, system: System) -> System:
        """The system, whose boards are read from the earlier run. Raises InputFault where that has
        not recorded them."""
        if self._table is None:
            return system
        if system.recording.every != 1:
            raise InputFault(f"{self._folder}: a board needs all rows: run with record.every = 1")
        fmus = []
        for fmu in system.fmus:
            if fmu.driver:
                own = vars(fmu.driver) | {"port": "", "name": fmu.name, "columns": self._table}
                fmu = replace(fmu, in_its_place=RecordedDriver(**own))
            fmus.append(fmu)
        return replace(system, fmus=tuple(fmus))

    def _require_arrivals(self, simulation: Simulation, loop: CompiledLoop) -> None:
        if self.pace.now() > self._end:
            raise Ended("end of the recorded arrivals")

    def report(self) -> dict[str, Any]:
        return super().report() | {"reproducible": True, "arrivals": str(self._folder)}


def _same(recorded: Any, now: Any) -> bool:
    """Whether a value of run.json is that of a scene, whose tuples are lists there."""
    return bool(json.loads(json.dumps(now)) == recorded)
