"""Sweeps: many jobs on a scene, a grid or a list, in parallel and resumable, as one table.

What a job measures is a run of its scene, or whatever else gives a row, such as a line of points of
a stability map.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from hapticlink.analysis.sweep import cluster, pool, table
from hapticlink.analysis.sweep.job import Job, key
from hapticlink.analysis.sweep.row import DIED, INTERRUPTED, REFUSED, Row, failed, measure
from hapticlink.orchestrator.base import interrupt, plugins, temporary_folders
from hapticlink.orchestrator.base.errors import Fault, Interrupted
from hapticlink.orchestrator.experiment import Experiment, simulate, simulate_together
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.run.compiled.lanes import MOST

Measure = Callable[[Experiment], Row]
"""Of a run."""
Judge = Callable[[Any, Path], Row]
"""Of a job, with a folder for what it writes meanwhile. It is called in other processes. The row of
several points has them as `rows`."""
Together = Callable[[Sequence[Job]], Sequence[Row | None]]
"""Of jobs, the rows of those that are done in one go."""
Tell = Callable[[int, int], object]
"""With the numbers of finished and of all jobs."""
TOGETHER = 8 * MOST
"""Runs that a process gets at a time, which share what is read and looked up for them."""
MANY = 500
"""Runs of a sweep from which on it compiles steps of several instances: a third as long as it takes
to compile them is won by so many, and all of it by the next sweeps."""


@dataclass(frozen=True)
class Means:
    """The folder in which rows are kept, the number of processes, who is told of the progress, and
    the address of the Dask scheduler that gives jobs to others instead."""

    folder: Path
    processes: int = 1
    tell: Tell | None = None
    scheduler: str | None = None


class Unfinished(Fault):
    """A sweep of `of` runs was interrupted after `done` of them, which are in `table`."""

    def __init__(self, done: int, of: int, folder: Path, table: str = "table.csv") -> None:
        self.done, self.of = done, of
        super().__init__(
            f"interrupted: {done} of {of} runs are in {folder}/{table}; the same command continues"
        )


def work(job: Job, folder: Path | None, judge: Judge) -> Row:
    """Does one job and returns its row; what is written meanwhile is kept below `folder` (by
    default the machine's one for temporary files)."""
    try:
        plugins.load(job.plugins)
    except Fault as missing:
        return failed(DIED, str(missing))
    with _room(job, folder) as results:
        try:
            return judge(job, results)
        except Fault as fault:
            return failed(REFUSED if _of_scene(fault) else DIED, str(fault))
        except Interrupted as interrupted:
            return failed(INTERRUPTED, str(interrupted))
        except Exception as error:  # the other jobs of the sweep go on
            return failed(DIED, f"{type(error).__name__}: {error}")
        finally:
            process_cache.trim()


def work_together(
    jobs: Sequence[Job], folder: Path | None, judge: Judge, together: Together | None = None
) -> list[Row]:
    """Does several jobs, `together` as far as that gives rows."""
    rows: Sequence[Row | None] = [None] * len(jobs)
    if together and len(jobs) > 1 and not any(job.plugins for job in jobs):
        try:
            rows = together(jobs)
        except Interrupted as interrupted:
            return [failed(INTERRUPTED, str(interrupted)) for _ in jobs]
        except Exception:  # which the jobs tell one by one
            process_cache.trim()
    return [row or work(job, folder, judge) for job, row in zip(jobs, rows, strict=True)]


def run_together(
    jobs: Sequence[Job], compiles: bool, measure: Measure = measure
) -> list[Row | None]:
    """The rows of the runs of jobs, side by side where they share their events; None of a job whose
    scene cannot be run so. compiles: as of `simulate_together`."""
    scenes = [job.scene for job in jobs if job.scene]
    if key(scenes[0]) != jobs[0].key:
        return [None] * len(jobs)
    return simulate_together(scenes, Path(), compiles, partial(_row, measure=measure))


def run(job: Job, results: Path, measure: Measure = measure) -> Row:
    """The row of a run of the scene of a job."""
    assert job.scene is not None
    if key(job.scene) != job.key:
        return failed(DIED, "this worker has another version of hapticlink or of what it uses")
    return _row(simulate(job.scene, results, csv=False, in_memory=True), measure)


def _row(experiment: Experiment, measure: Measure) -> Row:
    row, fault = measure(experiment), experiment.outcome.fault
    if fault is None or _of_scene(fault):
        return row
    # The next sweep repeats it.
    return row | {"end": INTERRUPTED if isinstance(fault, Interrupted) else DIED}


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


def _of_scene(fault: Fault | Interrupted) -> bool:
    """Whether a repetition of the run would give the same fault."""
    return fault.repeatable and not isinstance(fault.__cause__, OSError)


def sweep(jobs: Sequence[Job], means: Means, measure: Measure = measure) -> list[Row]:
    """The rows of the runs of `jobs`, as `tabulate`."""
    judge = partial(run, measure=measure)
    together = partial(run_together, compiles=len(jobs) >= MANY, measure=measure)
    return tabulate(jobs, means, judge, together)


@interrupt.defer_signals()
def tabulate(
    jobs: Sequence[Job],
    means: Means,
    judge: Judge,
    together: Together | None = None,
    *,
    before: Sequence[Row] = (),
    name: str = "table.csv",
    each_time: bool = False,
) -> list[Row]:
    """The rows of `jobs`, in their order, each with its point, behind those `before`. together:
    does several of them in one go.

    A row is stored in `rows` of the folder when its job ends and is reused by a later call, unless
    that failed for a reason other than its scene. The table `name` is written at the end, or
    `each_time` that a job ends. Raises Unfinished if the sweep is interrupted, after writing the
    table with the rows so far, and Fault if the disk is full.
    """
    folder, tell = means.folder, means.tell or (lambda done, of: None)
    try:
        stored = table.Rows(folder / "rows")
        rows = {j.key: row for j in jobs if j.scene and (row := stored.find(j.key))}
        # Points that give the same scene are run once.
        missing = list({j.key: j for j in jobs if j.scene and j.key not in rows}.values())

        def done() -> list[Job]:
            return [j for j in jobs if not j.scene or j.key in rows]

        def write() -> list[Row]:
            found = [*before]
            for j in done():
                row = rows[j.key] if j.scene else failed(REFUSED, j.refusal)
                found += ({**j.point, **part} for part in row.get("rows", [row]))
            table.write(folder / name, found)
            return found

        tell(finished := len(done()), len(jobs))
        points = Counter(j.key for j in jobs if j.scene)
        try:
            for job, row in _finished(missing, means, judge, together):
                if row["end"] == INTERRUPTED:  # a signal reached the worker too
                    continue
                if row["end"] != DIED:  # the next sweep repeats those
                    stored.keep(job.key, row)
                rows[job.key] = row
                finished += points[job.key]
                tell(finished, len(jobs))
                if each_time:
                    write()
        except Interrupted:
            pass
        made = write()
    except OSError as error:
        raise Fault(f"{folder}: {error}") from error
    if finished < len(jobs):
        raise Unfinished(finished, len(jobs), folder, name)
    return made


def batches_of(jobs: Sequence[Job], processes: int) -> list[Sequence[Job]]:
    """The jobs by up to TOGETHER, those together whose clocks are set alike, since runs side by
    side share their events."""
    ordered = sorted(jobs, key=lambda job: repr(job.scene and _CLOCKS(job.scene)))
    size = max(1, min(TOGETHER, len(jobs) // (4 * processes)))
    size -= size % MOST if size > MOST else 0
    return [ordered[i : i + size] for i in range(0, len(jobs), size)]


_CLOCKS = attrgetter("haptics", "graphics", "duration", "start_time")


def _finished(
    jobs: Sequence[Job], means: Means, judge: Judge, together: Together | None
) -> Iterator[pool.Done]:
    """Each job with its row, as they finish."""
    if means.scheduler:
        alone = partial(work, folder=None, judge=judge)
        yield from cluster.on_cluster(alone, jobs, means.scheduler)
        return
    running, processes = means.folder / ".running", means.processes
    clear = partial(shutil.rmtree, running, ignore_errors=True)
    clear()  # left by a sweep that was killed
    running.mkdir(parents=True)
    interrupt.add(clear)
    try:
        of_batch = partial(work_together, folder=running, judge=judge, together=together)
        batches = batches_of(jobs, processes) if together else [[job] for job in jobs]
        yield from pool.in_processes(of_batch, batches, processes)
    finally:
        interrupt.remove(clear)
        clear()
