"""Sweeps: many runs of a scene, a grid or a list, in parallel and resumable, as one table."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from hapticlink.analysis.sweep import cluster, pool, table
from hapticlink.analysis.sweep.job import Job, key
from hapticlink.analysis.sweep.row import DIED, INTERRUPTED, REFUSED, Row, failed, measure
from hapticlink.orchestrator.base import interrupt, plugins, temporary_folders
from hapticlink.orchestrator.base.errors import Fault, Interrupted
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


def work(job: Job, folder: Path | None = None, measure: Measure = measure) -> Row:
    """Runs one job and returns its row; results that are not in memory are kept below `folder` (by
    default the machine's one for temporary files) until they are measured."""
    assert job.scene is not None
    try:
        plugins.load(job.plugins)
    except Fault as missing:
        return failed(DIED, str(missing))
    if key(job.scene) != job.key:
        return failed(DIED, "this worker has another version of hapticlink or of what it uses")
    with _room(job, folder) as results:
        try:
            experiment = simulate(job.scene, results, csv=False, in_memory=True)
            row, fault = measure(experiment), experiment.outcome.fault
            return row if fault is None or _of_scene(fault) else row | {"end": _retried(fault)}
        except Fault as fault:
            return failed(REFUSED if _of_scene(fault) else _retried(fault), str(fault))
        except Exception as error:  # the other runs of the sweep go on
            return failed(DIED, f"{type(error).__name__}: {error}")
        finally:
            process_cache.trim()


@contextmanager
def _room(job: Job, folder: Path | None) -> Iterator[Path]:
    """Where the results of a job are, if they are in files: a folder that is created by them."""
    if folder is None:
        with temporary_folders.temporary_folder() as room:
            yield room
        return
    room = folder / job.key
    try:
        yield room
    finally:
        shutil.rmtree(room, ignore_errors=True)


def _of_scene(fault: Fault) -> bool:
    """Whether a repetition of the run would give the same fault."""
    return fault.repeatable and not isinstance(fault.__cause__, OSError)


def _retried(fault: Fault) -> str:
    """The end of a run whose fault is not caused by its scene, which the next sweep repeats."""
    return INTERRUPTED if isinstance(fault, Interrupted) else DIED


@interrupt.held()
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
    try:
        stored = table.Rows(folder / "rows")
        rows = {j.key: row for j in jobs if j.scene and (row := stored.find(j.key))}
        # Points that give the same scene are run once.
        missing = list({j.key: j for j in jobs if j.scene and j.key not in rows}.values())

        def done() -> list[Job]:
            return [j for j in jobs if not j.scene or j.key in rows]

        tell(len(done()))
        try:
            for job, row in _finished(missing, folder, processes, scheduler, measure):
                if row["end"] == INTERRUPTED:  # a signal reached the worker too
                    continue
                if row["end"] != DIED:  # the next sweep repeats those
                    stored.keep(job.key, row)
                rows[job.key] = row
                tell(len(done()))
        except Interrupted:
            pass
        finished = [
            {**j.point, **(rows[j.key] if j.scene else failed(REFUSED, j.refusal))} for j in done()
        ]
        table.write(folder / "table.csv", finished)
    except OSError as error:
        raise Fault(f"{folder}: {error}") from error
    if len(finished) < len(jobs):
        raise Unfinished(len(finished), len(jobs), folder)
    return finished


def _finished(
    jobs: Sequence[Job], folder: Path, processes: int, scheduler: str | None, measure: Measure
) -> Iterator[pool.Done]:
    """Each job with its row, as they finish."""
    if scheduler:
        yield from cluster.on_cluster(partial(work, measure=measure), jobs, scheduler)
        return
    running = folder / ".running"
    clear = partial(shutil.rmtree, running, ignore_errors=True)
    clear()  # left by a sweep that was killed
    running.mkdir(parents=True)
    interrupt.add(clear)
    try:
        of_job = partial(work, folder=running, measure=measure)
        yield from pool.in_processes(of_job, jobs, processes)
    finally:
        interrupt.remove(clear)
        clear()
