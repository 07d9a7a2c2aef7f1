"""Runs an experiment from scene to result folder: build, run, write `run.json`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from hapticlink.orchestrator import open_scene, simulated_plant
from hapticlink.orchestrator.base import interrupt, shelf
from hapticlink.orchestrator.base.errors import (
    Fault,
    InputFault,
    Interrupted,
    describe_os_error,
)
from hapticlink.orchestrator.describe_run import describe_scene, setup
from hapticlink.orchestrator.host import crash_monitor, host_state
from hapticlink.orchestrator.network.remote_fmu import FRAME, FRAMES
from hapticlink.orchestrator.network.served_part import NOWHERE, Servers, place_remote_fmus
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results import folder_lock, record_crash
from hapticlink.orchestrator.results.read_results import (
    IN_MEMORY,
    Results,
    Table,
    load,
    with_record,
)
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.run_record import (
    Resumed,
    RunEnding,
    RunRecord,
    RunSetup,
    content,
)
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.results.write_files import remove_rows
from hapticlink.orchestrator.run import run_state
from hapticlink.orchestrator.run.compiled import lanes, library
from hapticlink.orchestrator.run.concurrent_fmus import COLUMNS, SAMPLES, require_concurrent
from hapticlink.orchestrator.run.execute_plan import Outcome, Progress, run, run_side_by_side
from hapticlink.orchestrator.run.fetched_outputs import choose_fetched
from hapticlink.orchestrator.run.open_fmus import find_isolated, refuse_hardware, refuse_text
from hapticlink.orchestrator.run.real_time import RealTimeRun
from hapticlink.orchestrator.run.run_state import RunState, require_savable
from hapticlink.orchestrator.run.save_times import NO_TIMES, SaveTimes, Saving
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.run.state_fits import require_fit
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import MAX_SYSTEMS, build_again, build_system
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
                try:
                    return with_record(load(self.folder, True, record), record, self.scene)
                except InputFault as why:  # which this run has written
                    raise self.outcome.fault or Fault(
                        f"the results are gone, or were changed while the run wrote them: {why}"
                    ) from None
            return _ResultsInMemory(self, self.memory.tables(), record)
        empty: dict[str, Table] = {}
        recorded = _columns(self.system)
        for clock in self.system.timeline.clocks:
            columns = ("time", *recorded.get(clock.name, ()))
            empty[clock.name] = Table(columns, np.zeros((0, len(columns))), empty)
        return Results(self.folder, self.run, empty)


class _ResultsInMemory(Results):
    """Those of an experiment whose rows are in no file; its run.json is made where it is asked
    for."""

    _made: Experiment

    def __init__(self, made: Experiment, tables: Mapping[str, Table], record: RunRecord) -> None:
        with_record(self, record, made.scene)
        vars(self).update(folder=None, tables=tables, _made=made)

    @cached_property
    def run(self) -> dict[str, Any]:
        return self._made.run


@dataclass(frozen=True)
class Prepared:
    """What there is of a run before it begins. every: the system with all outputs of its FMUs;
    plan: of the system with those that are fetched; tables: the columns of each by its name;
    before: what run.json says of it."""

    every: System
    plan: Plan
    tables: Mapping[str, Sequence[str]]
    before: RunSetup

    @property
    def system(self) -> System:
        return self.plan.system

    def shares_events(self, other: Prepared) -> bool:
        """Whether events of both may have the same ticks, and operations on the same FMUs."""
        mine, its = self.system, other.system
        return (
            mine.timeline == its.timeline
            and mine.coupling == its.coupling
            and [fmu.description for fmu in mine.fmus] == [fmu.description for fmu in its.fmus]
        )

    def differs_in_starts(self, every: System) -> bool:
        """Whether a system differs in start values alone, as `build_system` makes it of one."""
        mine = self.every
        return mine.connections is every.connections and mine.timeline is every.timeline

    def experiment(
        self,
        scene: Scene,
        outcome: Outcome,
        folder: Path,
        build_time: float,
        memory: RunResults | None = None,
    ) -> Experiment:
        ending = outcome.ending(build_time)
        return Experiment(scene, self.system, outcome, folder, self.before, ending, memory)


_PREPARED: shelf.Shelf[Prepared] = shelf.Shelf(MAX_SYSTEMS)


def _prepare(
    scene: Scene, every: System, real_time: RealTimeRun | None, remote: Servers
) -> Prepared:
    """Of a scene's system. Raises InputFault as `Plan.check` does."""
    system = place_remote_fmus(choose_fetched(every), scene, remote)
    plan = Plan(system)
    plan.check()
    tables: dict[str, Sequence[str]] = {**_columns(system)}
    if real_time:
        sides = dict.fromkeys(require_concurrent(plan).values())
        tables |= {f"{clock}_{SAMPLES}": COLUMNS for clock in sides}
        tables |= {f"{fmu.name}_{FRAMES}": FRAME for fmu in system.fmus if fmu.served}
    else:
        refuse_hardware(system.fmus)
    return Prepared(every, plan, tables, setup(scene, plan, tables, _find_left_out(every, system)))


def _prepare_once(scene: Scene, every: System) -> Prepared:
    """The same, and kept for systems that `build_system` makes of this one by other start values,
    which shows in that they share all else."""
    ready = _PREPARED.take(lambda item: item.differs_in_starts(every))
    if ready is None:
        ready = _prepare(scene, every, None, NOWHERE)
    else:
        starts = (fmu.starts for fmu in every.fmus)
        system = ready.system.restarted(starts, lambda _: every.energy, every.timeline)
        before = replace(ready.before, **describe_scene(scene))
        ready = replace(ready, every=every, plan=replace(ready.plan, system=system), before=before)
    _PREPARED.put(ready)
    return ready


def _columns(system: System) -> dict[str, list[str]]:
    """The column names of each table that has some."""
    signals = SignalVector(system)
    tables = (system.recording.tables(clock.name) for clock in system.timeline.clocks)
    recorded = {name: signals.recorded(name) for names in tables for name in names}
    return {table: [*columns] for table, columns in recorded.items() if columns is not None}


def _find_left_out(every: System, system: System) -> list[str]:
    """The outputs `fmu.port` of which an entry is not written in the rows of its rate."""
    if (written := system.recording.whole) is None:
        return []
    rows = {*written}
    outputs = ((u.name, s) for u in every.fmus for s in u.description.outputs)
    left_out = (f"{u}.{s.port}" for u, s in outputs if f"{u}.{s.name}" not in rows)
    return [*dict.fromkeys(left_out)]


def _fits_in_memory(system: System, columns: Mapping[str, Sequence[str]]) -> bool:
    """Whether the rows of a run may be kept in memory."""
    counts = {
        table: len(clock.starts)
        for clock in system.timeline.clocks
        for table in system.recording.tables(clock.name)
    }
    written = sum(counts[table] * (1 + len(names)) for table, names in columns.items())
    return 8 * written <= IN_MEMORY


def _find_state(
    scene: Scene, system: System, folder: Path, real_time: RealTimeRun | None
) -> RunState | None:
    """The state from which a scene goes on, if it names one. Raises InputFault where it does not
    fit, and where the run would replace the results that the state belongs to."""
    if real_time:
        open_scene.require_start(scene)
    if not scene.resume:
        return None
    state = run_state.read(Path(scene.resume))
    require_fit(state, system, open_scene.write_tables(scene))
    if state.path.parent == folder:
        raise InputFault(
            f"{folder} has the state and the results before it, which this run would replace: give "
            "another folder (--out)"
        )
    return state


def _find_saving(
    scene: Scene,
    system: System,
    folder: Path,
    real_time: RealTimeRun | None,
    save: SaveTimes,
    state: RunState | None,
) -> Saving | None:
    """What saves the states of a run, if that is asked for. Raises InputFault for a time that is
    not within it, and with the FMUs that cannot save their state."""
    if not save.files:
        return None
    if real_time:
        raise InputFault("--save: no state of a run in real time is saved: leave one out")
    require_savable(system)
    ticks = save.ticks(system.timeline, state.time if state else scene.start_time)
    return Saving(ticks, folder, open_scene.write_tables(scene))


def _watch(folder: Path) -> AbstractContextManager[None]:
    """Context in which a crash of this process is recorded in a folder."""
    guard: Callable[[int], object] = lambda on: None  # noqa: E731
    with suppress(Fault):  # which the run itself reports
        guard = library.load().guard
    return crash_monitor.watch_for_crash(folder, record_crash.__name__, guard)


@interrupt.defer_signals()
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
    locked: bool = False,
    save: SaveTimes = NO_TIMES,
) -> Experiment:
    """Run a scene (a name, a path, or a Scene), changed by `options`, with results in `folder`.

    Raises InputFault before the run for invalid input and where another run writes to `folder`, and
    Interrupted for a signal before the run. A fault during the run is in the outcome, and its
    results up to then are kept. Results of an earlier run in `folder` are removed once the first
    rows of this one are written. Without `csv` the tables stay in the binary form in which a run
    writes them, with `keep_rows` beside the CSVs, until `remove_rows`. `in_memory`: nothing is
    written, unless the tables are too long (`IN_MEMORY`) or an FMU of others, which may crash the
    process, runs in it. remote: the FMUs that run on other computers. locked: the caller holds the
    lock of the folder. save: when states are saved.
    """
    begin, folder = perf_counter(), Path(folder).absolute()  # FMUs may change the current one
    read = open_scene.load(scene, options, takes=open_scene.BEGINNINGS)
    with ExitStack() as stack:
        if not (in_memory or locked):
            stack.enter_context(folder_lock.lock_folder(folder))
        try:
            every = stack.enter_context(build_system(read))
            if real_time:
                every = real_time.with_recordings(every)
                every = stack.enter_context(simulated_plant.attach(read, every))
        except Interrupted:
            raise Interrupted(when="before the run") from None
        if in_memory and remote is NOWHERE and not real_time:
            ready = _prepare_once(read, every)
        else:
            ready = _prepare(read, every, real_time, remote)
        system, plan, tables, before = ready.system, ready.plan, ready.tables, ready.before
        state = _find_state(read, system, folder, real_time)
        saving = _find_saving(read, system, folder, real_time, save, state)
        before = replace(
            before,
            files=[*before.files, *save.files],
            resumed=Resumed(str(state.path), state.time) if state else None,
        )
        ready = replace(ready, before=before)
        build_time = perf_counter() - begin
        alone = find_isolated(system.fmus)
        for change in (*system.changes, *(run_state.new_starts(state, system) if state else ())):
            refuse_text(change, alone)
        foreign = [fmu.name for fmu in read.fmu if fmu.path and fmu.name not in alone]
        if in_memory and not foreign and _fits_in_memory(system, tables):
            memory = RunResults()
            with host_state.restore_interpreter():
                outcome = run(plan, memory, progress, real_time, state)
            return ready.experiment(read, outcome, folder, build_time, memory)
        if in_memory:
            stack.enter_context(folder_lock.lock_folder(folder))
        csv = csv and read.record.format == "csv"
        with RunFolder(folder, before, csv) as results:
            with (
                _watch(folder) if foreign else nullcontext(),
                host_state.restore_directory(*foreign),
                host_state.restore_interpreter(),
            ):
                outcome = run(plan, results, progress, real_time, state, saving)
            unsaved = [name for name in save.files if saving and name not in saving.saved]
            before = replace(before, files=[f for f in before.files if f not in unsaved])
            results.leave_out(unsaved)
            outcome.details = replace(
                outcome.details, logged=results.count_logged(), unsaved=unsaved
            )
            try:
                results.end(outcome.ending(build_time), tables)
            except OSError as error:
                if outcome.fault is None:
                    outcome.fault = Fault(describe_os_error(error, folder))
                    outcome.reason = "fault"
                results.end_in_place(outcome.ending(build_time))
            outcome.published = results.published
    ended = ready.experiment(read, outcome, folder, build_time)
    if not keep_rows:
        ended.remove_rows()
    return ended


Kept = TypeVar("Kept")


@interrupt.defer_signals()
def simulate_together(
    scenes: Sequence[Scene], folder: Path, compiles: bool, of: Callable[[Experiment], Kept]
) -> list[Kept | None]:
    """What `of` gives of the runs of scenes with results in memory, the same ones as of `simulate`:
    those that share their events go side by side, by vector instructions. None for a scene that
    cannot be run so.

    compiles: whether to compile the steps of several instances that the cache lacks. Raises
    Interrupted.
    """
    begin = perf_counter()
    ready: list[tuple[int, Prepared]] = []
    kept: list[Kept | None] = [None] * len(scenes)
    with ExitStack() as stack:
        for i, scene in enumerate(scenes):
            with suppress(InputFault):
                again = build_again(scene) if i else None
                every = again or stack.enter_context(build_system(scene))
                made = _prepare_once(scene, every)
                if not (scene.fmu or scene.resume) and _fits_in_memory(made.system, made.tables):
                    ready.append((i, made))
        build_time = (perf_counter() - begin) / len(scenes)
        while ready:
            first = ready[0][1]
            group = dict(islice((e for e in ready if e[1].shares_events(first)), lanes.MOST))
            ready = [each for each in ready if each[0] not in group]
            done = _run_group([*group.values()], compiles)
            for (i, one), (outcome, memory) in zip(group.items(), done, strict=True):
                kept[i] = of(one.experiment(scenes[i], outcome, folder, build_time, memory))
    return kept


def _run_group(group: Sequence[Prepared], compiles: bool) -> Iterator[tuple[Outcome, RunResults]]:
    """The outcomes and results of runs that share their events, of those that did not last side by
    side alone."""
    runs = [(one.plan, RunResults()) for one in group]
    steps = lanes.find_steps(group[0].system, compiles) if len(group) > 1 else {}
    outcomes = run_side_by_side(runs, steps) if steps else [None] * len(runs)
    for (plan, results), outcome in zip(runs, outcomes, strict=True):
        alone = results if outcome else RunResults()
        yield outcome or run(plan, alone), alone
