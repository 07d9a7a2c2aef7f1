"""Runs a scene, and reads results back."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.summary import Findings
from hapticlink.api.result import Run
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.errors import Fault, InputFault, Interrupted, describe_os_error
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.network import key_file
from hapticlink.orchestrator.network.served_part import NOWHERE, Servers
from hapticlink.orchestrator.plan import explain
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results import folder_lock, folders
from hapticlink.orchestrator.results.read_results import (
    Results,
    read_into_memory,
    with_record,
    without_rows,
)
from hapticlink.orchestrator.results.read_results import load as read_tables
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun
from hapticlink.orchestrator.run.recorded_arrivals import RecordedArrivals
from hapticlink.orchestrator.run.save_times import NO_TIMES, SaveTimes, read_save_times
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.overrides import Options, write_options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization import figure_files


class RunInterrupted(Interrupted):
    """A run was interrupted by Ctrl-C; `run` are its results up to then."""

    def __init__(self, run: Run) -> None:
        super().__init__(run.record.end.time)
        self.run = run


def with_board(port: str | None) -> dict[str, Any]:
    """The options that put the board at a port in the place of a scene's device: it has encoders,
    and the observer is beside it; none where there is no port."""
    if port is None:
        return {}
    return {"device.driver.port": port, "device.observer.beside": True, "sensing": "encoders"}


def _ending(stop: Callable[[], bool]) -> Callable[..., None]:
    def turn(_: Simulation, loop: CompiledLoop) -> None:
        loop.events.patience(0)  # a turn after each event: a hand may wait for it
        if stop():
            raise Ended("stopped")

    return turn


@interrupt.defer_signals()
def run(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    out: str | Path | None = None,
    figures: bool = True,
    format: str = "png",
    progress: Callable[[float], None] | None = None,
    real_time: bool = False,
    speed: float = 1.0,
    arrivals: str | Path | None = None,
    device: str | None = None,
    stop: Callable[[], bool] | None = None,
    ready: Callable[[str], object] | None = None,
    remote: Mapping[str, str] | None = None,
    key: str | Path | None = None,
    save: Sequence[float | str] = (),
    answer: Callable[[Run], object] | None = None,
) -> Run:
    """Run a scene, changed by `options` (see `scene`).

    The results are returned, and with `out` also written to that folder: a CSV per rate, run.json,
    plan.txt and, where `figures` is true, figures, in the formats `format` (png, pdf or svg,
    several with commas between). They replace those of an earlier run there from
    the first row on. `progress` is called with the simulated time (s) from time to time, `answer`
    with the results as soon as they are there, before figures are drawn.
    `real_time` paces the haptic loop by the wall clock, with FMUs of other rates beside it
    (docs/real-time.md), at `speed` times that of the clock, less than 1 for slow motion. `arrivals`
    is the folder of a run in real time, whose samples arrive here when they arrived there. `device`
    is the port of the board in the place of the simulated device (docs/your-device.md); `stop` is
    asked at every tick whether the run in real time is to end, and `ready` is told what to do with
    the handle of a board that has a `home`, and returns when it is done. `remote` has the addresses
    HOST:PORT of FMUs, or of all FMUs at a rate, that `hapticlink serve` serves on other
    computers, and `key` is the file of the key of both (docs/two-computers.md). `save`: when the
    state of the run is saved to `out`, at times (s), at its "end", or every so many seconds,
    "every=0.5" (docs/resume.md); a scene goes on from one as its key `resume` says, and a state is
    a scene itself.

    Raises InputFault for invalid input and where another run writes to `out`, before anything runs.
    A fault during the run raises no exception: it is the `fault` of the returned Run, which has the
    results up to then. Ctrl-C raises RunInterrupted, with the results so far as its `run`. Tables
    of more than 16 MiB in `out` are read when they are asked for. Threads of one process may
    run scenes at the same time, each into a folder of its own; the current directory stays as it
    is, and Ctrl-C ends the runs of the main thread.
    """
    drawn = figure_files.formats(format) if figures else ()
    options = (*write_options(options), *write_options(with_board(device)))
    read = open_scene.load(scene, options, takes=() if device else open_scene.BEGINNINGS)
    if real_time:
        from hapticlink.api.board_start import start_at_handle  # slow to load

        read = start_at_handle(read, ready or (lambda what: None))
    if arrivals is not None and (real_time or remote):
        raise InputFault("arrivals are those of an earlier run: without real time and remote FMUs")
    if speed != 1.0 and not real_time:
        raise InputFault("speed: a run is as fast as it can be: add real_time (--real-time)")
    paced = RealTimeRun(stop and _ending(stop), speed=speed) if real_time else None
    if arrivals is not None:
        paced = RecordedArrivals(Path(arrivals), read)
    servers = Servers(remote or {}, Path(key) if key else key_file.DEFAULT)
    if save and out is None:
        raise InputFault("save: states are files of the results: give `out`, their folder")
    times = read_save_times(save)
    return run_paced(read, out, paced, drawn, progress, remote=servers, answer=answer, save=times)


@interrupt.defer_signals()
def run_paced(
    scene: Scene,
    out: str | Path | None,
    real_time: RealTimeRun | None,
    figures: Sequence[str] = ("png",),
    progress: Callable[[float], None] | None = None,
    tables: bool = True,
    remote: Servers = NOWHERE,
    answer: Callable[[Run], object] | None = None,
    save: SaveTimes = NO_TIMES,
) -> Run:
    """As `run`, with the formats of figures; without `out` and `tables` there are no tables."""
    simulated = partial(
        simulate, scene, progress=progress, real_time=real_time, remote=remote, save=save
    )
    if out is None:
        ended = _in_memory(simulated, tables)
        if answer:
            answer(ended)
    else:
        with folder_lock.lock_folder(Path(out)):
            ended = _in_folder(simulated, Path(out), figures, answer)
    if interrupt.came() or ended.record.end.reason == "interrupted":
        raise RunInterrupted(ended)
    return ended


def _in_memory(simulated: Callable[..., Experiment], tables: bool) -> Run:
    with temporary_folders.temporary_folder() as folder:
        ended = simulated(folder, csv=False)
        if not tables:
            return Run(None, ended.run, {})
        results = read_into_memory(ended.results)
    return _result(None, results, summary.find(results), ended.run)


def _in_folder(
    simulated: Callable[..., Experiment],
    folder: Path,
    figures: Sequence[str],
    answer: Callable[[Run], object] | None,
) -> Run:
    ended = simulated(folder, keep_rows=True, locked=True)
    try:
        return _describe_run(folder, ended, figures, answer)
    finally:
        ended.remove_rows()


def _describe_run(
    folder: Path, ended: Experiment, figures: Sequence[str], answer: Callable[[Run], object] | None
) -> Run:
    """What the rows of a run say of it, in its folder."""
    results = ended.results
    if not ended.outcome.published:
        return Run(None, results.run, results.tables)
    found = summary.find(results)
    run, files = results.run, _write_files(ended, figures)
    with _tell_of_missing_files(folder, ended):
        for names in islice(files, 2):
            run = folders.add(folder, names, found.added)
    if answer:
        answer(_result(folder, results, found, run))
    with _tell_of_missing_files(folder, ended):
        for names in files:
            run = folders.add(folder, names, found.added)
    return _result(folder, results, found, run)


def _result(folder: Path | None, results: Results, found: Findings, run: dict[str, Any]) -> Run:
    """What is returned of results, of which `run` is what run.json says."""
    told = Run(folder, run | found.added, without_rows(results), numbers=found.numbers)
    record = replace(found.record, files=run["files"], scene=run["scene"])
    return with_record(told, record, results.known_scene)


@contextmanager
def _tell_of_missing_files(folder: Path, ended: Experiment) -> Iterator[None]:
    """Context in which files are added to the results of a run, which are there."""
    try:
        yield
    except Interrupted:
        message = f"interrupted: {folder} has the results of the run, not all of its figures"
        raise Fault(message) from None
    except InputFault as why:  # of run.json, which this run has written
        raise ended.outcome.fault or Fault(f"the record of the run was changed: {why}") from None
    except OSError as error:  # a full disk; the rows are there, and why the run ended is told
        message = "%s has the results of the run, not all of its figures: %s"
        logging.getLogger(__name__).warning(message, folder, describe_os_error(error, folder))


def _write_files(ended: Experiment, figures: Sequence[str]) -> Iterator[list[str]]:
    """Writes the plan of a run that had a step, and then its figures; the names of the files, none
    at first. Raises Interrupted and OSError."""
    yield []
    if ended.outcome.end_time <= ended.scene.start_time or ended.outcome.reason == "interrupted":
        return
    (ended.folder / "plan.txt").unlink(missing_ok=True)  # a link is replaced, not followed
    with (ended.folder / "plan.txt").open("x", encoding="utf-8") as file:
        for line in explain.explain(Plan(ended.system)):
            interrupt.raise_if_interrupted()
            file.write(f"{line}\n")
    yield ["plan.txt"]
    if figures:
        from hapticlink.visualization.figures import run_figures  # with casadi, slow to load

        yield figure_files.write(run_figures.files(ended.results, figures), ended.folder)


def load(folder: str | Path) -> Run:
    """Read the results of a run from its folder. Raises InputFault if it contains no run."""
    results = read_tables(folder)
    return Run(results.folder, results.run, results.tables)
