"""Runs an experiment from scene to result folder: build, run, write `run.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interpreter_state, interrupt
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.describe_run import setup
from hapticlink.orchestrator.network.remote_fmu import FRAME, FRAMES
from hapticlink.orchestrator.network.served_part import NOWHERE, Servers, place_remote_fmus
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results import folder_lock
from hapticlink.orchestrator.results.read_results import Results, Table, described
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.run_record import RunEnding, RunRecord, RunSetup, content
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.results.windows import WINDOW_BYTES, opened
from hapticlink.orchestrator.results.write_files import remove_rows
from hapticlink.orchestrator.run import crash_monitor
from hapticlink.orchestrator.run.concurrent_fmus import COLUMNS, SAMPLES, beside_or_refused
from hapticlink.orchestrator.run.execute_plan import Outcome, Progress, run
from hapticlink.orchestrator.run.fetched_outputs import with_fetched
from hapticlink.orchestrator.run.open_fmus import isolated
from hapticlink.orchestrator.run.real_time import RealTimeRun
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.system import System


@dataclass(frozen=True)
class Experiment:
    """A finished run. `before` and `ending` are what its run.json says, which is in `folder` unless
    the run had no row and results of an earlier run were kept there. `memory`: its results, where
    they are in no file."""

    scene: Scene
    system: System
    outcome: Outcome
    folder: Path
    before: RunSetup
    ending: RunEnding
    memory: RunResults | None = None

    @cached_property
    def run(self) -> dict[str, Any]:
        """The content of its run.json."""
        return content(self.before) | content(self.ending)

    def remove_rows(self) -> None:
        """Remove the rows of which the CSVs are made, if they were kept for `results`."""
        for name in self.before.files if self.outcome.published and not self.memory else ():
            if name.endswith(".csv") and (path := self.folder / name).exists():
                remove_rows(path)

    @property
    def results(self) -> Results:
        """The results of the run, with empty tables if it had no row."""
        if self.outcome.published:
            record = RunRecord(**vars(self.before), **vars(self.ending))
            if not self.memory:
                return opened(self.folder, record)
            return described(Results(None, self.run, self.memory.tables()), record)
        empty: dict[str, Table] = {}
        recorded = _columns(self.system)
        for clock in self.system.timeline.clocks:
            columns = ("time", *recorded.get(clock.name, ()))
            empty[clock.name] = Table(columns, np.zeros((0, len(columns))), empty)
        return Results(self.folder, self.run, empty)


def _columns(system: System) -> dict[str, list[str]]:
    """The column names of each clock's table, if it has one."""
    signals = SignalVector(system)
    recorded = {clock.name: signals.recorded(clock.name) for clock in system.timeline.clocks}
    return {clock: [*columns] for clock, columns in recorded.items() if columns is not None}


def _left_out(every: System, system: System) -> list[str]:
    """The outputs `fmu.port` of which an entry is not written."""
    if system.recording.outputs is None:
        return []
    outputs = ((u.name, s) for u in every.fmus for s in u.description.outputs)
    left_out = (
        f"{u}.{s.port}" for u, s in outputs if f"{u}.{s.name}" not in system.recording.outputs
    )
    return [*dict.fromkeys(left_out)]


def _fits_a_window(system: System, columns: Mapping[str, Sequence[str]]) -> bool:
    """Whether the rows of a run are no more than a window."""
    counts = {c.name: len(c.starts) for c in system.timeline.clocks}
    written = sum(counts[clock] * (1 + len(names)) for clock, names in columns.items())
    return 8 * written <= WINDOW_BYTES


@interrupt.held()
def simulate(
    scene: str | Path | Scene,
    folder: Path | str,
    options: Options = (),
    progress: Progress | None = None,
    csv: bool = True,
    real_time: RealTimeRun | None = None,
    keep_rows: bool = False,
    in_memory: bool = False,
    remote: Servers = NOWHERE,
) -> Experiment:
    """Run a scene (a name, a path, or a Scene), changed by `options`, with results in `folder`.

    Raises InputFault before the run for invalid input and where another run writes to `folder`, and
    Interrupted for a signal before the run. A fault during the run is in the outcome, and its
    results up to then are kept. Results of an earlier run in `folder` are removed once the first
    rows of this one are written. Without `csv` the tables stay in the binary form in which a run
    writes them, with `keep_rows` beside the CSVs, until `remove_rows`. `in_memory`: nothing is
    written, unless the tables are more than a window (`results.windows`) or an FMU of others, which
    may crash the process, runs in it. remote: the FMUs that run on other computers.
    """
    begin, folder = perf_counter(), Path(folder).absolute()  # FMUs may change the current one
    read = open_scene.load(scene, options)
    with ExitStack() as stack:
        if not in_memory:
            stack.enter_context(folder_lock.held(folder))
        every = stack.enter_context(built(read))
        system = place_remote_fmus(with_fetched(every), read, remote)
        plan = Plan(system)
        plan.check()
        build_time = perf_counter() - begin
        tables: dict[str, Sequence[str]] = {**_columns(system)}
        if real_time:
            sides = dict.fromkeys(beside_or_refused(plan).values())
            tables |= {f"{clock}_{SAMPLES}": COLUMNS for clock in sides}
            tables |= {f"{fmu.name}_{FRAMES}": FRAME for fmu in system.fmus if fmu.served}
        before = setup(read, plan, tables, _left_out(every, system))
        alone = isolated(system.fmus)
        foreign = [fmu.name for fmu in read.fmu if fmu.path and fmu.name not in alone]
        if in_memory and not foreign and _fits_a_window(system, tables):
            memory = RunResults()
            with interpreter_state.restored():
                outcome = run(plan, memory, progress, real_time)
            return Experiment(
                read, system, outcome, folder, before, outcome.ending(build_time), memory
            )
        stack.enter_context(folder_lock.held(folder))
        csv = csv and read.record.format == "csv"
        with RunFolder(folder, before, csv) as results:
            with (
                crash_monitor.watched(folder) if foreign else nullcontext(),
                interpreter_state.directory_restored(*foreign),
                interpreter_state.restored(),
            ):
                outcome = run(plan, results, progress, real_time)
            try:
                results.end(outcome.ending(build_time), tables)
            except OSError as error:
                if outcome.fault is None:
                    outcome.fault = Fault(f"{folder}: {error.strerror or error}")
                    outcome.reason = "fault"
                results.end_in_place(outcome.ending(build_time))
            outcome.published = results.published
    ended = Experiment(read, system, outcome, folder, before, outcome.ending(build_time))
    if not keep_rows:
        ended.remove_rows()
    return ended
