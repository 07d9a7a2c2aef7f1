"""Sweeps: many runs of a scene, a grid or a list, in parallel and resumable, as one table."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from hapticlink.analysis.sweep import cluster, job, pool, table
from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.row import DIED, INTERRUPTED, REFUSED, Row, failed, measure
from hapticlink.orchestrator.base import interrupt, plugins, temporary_folders
from hapticlink.orchestrator.base.faults import Fault, Interrupted
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.fmi import process_cache

Measure = Callable[[Experiment], Row]
Tell = Callable[[int], None]


class Unfinished(Fault):
    """A sweep of `of` runs was interrupted after `done` of them, which are in `table`."""

    def __init__(self, done: int, of: int, folder: Path, table: str = "table.csv") -> None:
        self.done, self.of = done, of
        super().__init__(
            f"interrupted: {done} of {of} runs are in {folder}/{table}; the same command continues"
        )


def work(each: Job, room: Path | None = None, measure: Measure = measure) -> Row:
    """Runs one job and returns its row; results are kept in `room` (by default the machine's folder
    for temporary files) until they are measured."""
    assert each.scene is not None
    try:
        plugins.load(each.plugins)
    except Fault as missing:
        return failed(DIED, str(missing))
    if job.key(each.scene) != each.key:
        return failed(DIED, "this worker has another version of hapticlink or of what it uses")
    with tempfile.TemporaryDirectory(dir=room) if room else temporary_folders.room() as folder:
        try:
            experiment = simulate(each.scene, folder, csv=False)
            row, fault = measure(experiment), experiment.outcome.fault
            return row if fault is None or _of_scene(fault) else row | {"end": _retried(fault)}
        except Fault as fault:
            return failed(REFUSED if _of_scene(fault) else _retried(fault), str(fault))
        except Exception as error:  # the other runs of the sweep go on
            return failed(DIED, f"{type(error).__name__}: {error}")
        finally:
            process_cache.trim()


def _of_scene(fault: Fault) -> bool:
    """Whether a repetition of the run would give the same fault."""
    return fault.repeatable and not isinstance(fault.__cause__, OSError)


def _retried(fault: Fault) -> str:
    """The end of a run whose fault is not caused by its scene, which the next sweep repeats."""
    return INTERRUPTED if isinstance(fault, Interrupted) else DIED


def sweep(
    jobs: Sequence[Job],
    folder: Path,
    processes: int,
    scheduler: str | None = None,
    tell: Tell = lambda done: None,
    measure: Measure = measure,
) -> list[Row]:
    """The rows of `jobs`, in their order, each with its point; `tell` is called with the number of
    finished runs.

    A row is stored in `folder`/rows when its run ends and is reused by a later call, unless the run
    failed for a reason other than its scene. Raises Unfinished if the sweep is interrupted, after
    writing table.csv with the rows so far, and Fault if the disk is full.
    """
    with interrupt.held():
        return _rows(jobs, folder, processes, scheduler, tell, measure)


def _rows(
    jobs: Sequence[Job],
    folder: Path,
    processes: int,
    scheduler: str | None,
    tell: Tell,
    measure: Measure,
) -> list[Row]:
    try:
        rows = table.Rows(folder / "rows")
        found = {j.key: kept for j in jobs if j.scene and (kept := rows.find(j.key))}
        # Points that give the same scene are run once.
        missing = list({j.key: j for j in jobs if j.scene and j.key not in found}.values())
        refused = sum(j.scene is None for j in jobs)

        def done() -> int:
            return refused + sum(j.key in found for j in jobs if j.scene)

        tell(done())
        try:
            for each, made in _finished(missing, folder, processes, scheduler, measure):
                if made["end"] == INTERRUPTED:  # a signal reached the worker too
                    continue
                if made["end"] != DIED:  # the next sweep repeats those
                    rows.keep(each.key, made)
                found[each.key] = made
                tell(done())
        except Interrupted:
            pass
        known = [
            {**j.point, **(found[j.key] if j.scene else failed(REFUSED, j.refusal))}
            for j in jobs
            if not j.scene or j.key in found
        ]
        table.write(folder / "table.csv", known)
    except OSError as error:
        raise Fault(f"{folder}: {error}") from error
    if len(known) < len(jobs):
        raise Unfinished(len(known), len(jobs), folder)
    return known


def _finished(
    jobs: Sequence[Job], folder: Path, processes: int, scheduler: str | None, measure: Measure
) -> Iterator[pool.Done]:
    if scheduler:
        yield from cluster.on_cluster(partial(work, measure=measure), jobs, scheduler)
        return
    room = folder / ".running"
    shutil.rmtree(room, ignore_errors=True)  # left by a sweep that was killed
    room.mkdir(parents=True)
    try:
        yield from pool.in_processes(partial(work, room=room, measure=measure), jobs, processes)
    finally:
        shutil.rmtree(room, ignore_errors=True)
