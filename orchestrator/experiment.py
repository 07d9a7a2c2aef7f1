"""One experiment from scene to folder: build, run, `run.json`."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.tables import Results, Table, load, size
from hapticlink.orchestrator.run import crash_monitor
from hapticlink.orchestrator.run.event_loop import Outcome, Progress, run
from hapticlink.orchestrator.run.open_fmus import isolated
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.run_json import _ending, _story
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.system import System


@dataclass(frozen=True)
class Experiment:
    """A finished run and how it ended. `run` is what run.json says: in `folder`, unless the run had
    no row and left there those of an earlier one."""

    scene: Scene
    system: System
    outcome: Outcome
    folder: Path
    run: dict[str, Any]

    def too_large(self, most: int) -> bool:
        """Whether the tables in `folder` have more than `most` bytes."""
        return self.outcome.published and size(self.folder, self.run) > most

    @property
    def results(self) -> Results:
        if self.outcome.published:
            return load(self.folder)
        none: dict[str, Table] = {}
        for clock, names in _columns(self.system).items():
            columns = ("time", *names)
            none[clock] = Table(columns, np.zeros((0, len(columns))), none)
        return Results(self.folder, self.run, none)


def _columns(system: System) -> dict[str, list[str]]:
    """By clock."""
    signals = SignalVector(system)
    return {clock.name: signals.columns(clock.name) for clock in system.timeline.clocks}


def simulate(
    scene: str | Path | Scene,
    folder: Path | str,
    options: Options = (),
    progress: Progress | None = None,
) -> Experiment:
    """Run a scene (a name, a path, or a Scene), changed by `options`, into `folder`.

    Raises InputFault before anything runs, Interrupted where a signal comes before that; a fault of
    the run itself is in the outcome, and its results are kept. Those of an earlier run in `folder`
    go when the first rows of this one are there.
    """
    with interrupt.held():
        return _simulated(scene, Path(folder), options, progress)


def _simulated(
    scene: str | Path | Scene, folder: Path, options: Options, progress: Progress | None
) -> Experiment:
    begin = perf_counter()
    read = open_scene.load(scene, options)
    with built(read) as system:
        plan = Plan(system)
        plan.check()
        build_time = perf_counter() - begin
        story = _story(read, plan)
        alone = isolated(system.fmus)
        risky = any(fmu.path and fmu.name not in alone for fmu in read.fmu)
        with RunFolder(folders.ensure(folder), story) as results:
            with crash_monitor.beside(folder) if risky else nullcontext():
                outcome = run(plan, results, progress)
            ending = _ending(system, outcome, build_time)
            try:
                results.end(ending, _columns(system))
            except OSError as error:
                if outcome.fault is None:
                    outcome.fault = Fault(f"{folder}: {error.strerror or error}")
                    outcome.reason = "fault"
                ending = _ending(system, outcome, build_time)
                results.end_in_place(ending)
            outcome.published = results.published
    return Experiment(read, system, outcome, folder, story | ending)
