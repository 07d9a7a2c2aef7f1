"""Runs jobs in a pool of processes: a crash fails one run, and Ctrl-C ends all processes.

Each process has at most one batch of jobs. When a process dies its pool breaks without saying which
job was the cause: the jobs in progress are repeated one by one, and one that dies alone has failed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from multiprocessing import util
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.row import DIED, Row, failed
from hapticlink.orchestrator.base import interrupt, process, temporary_folders
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.system.fmu_files import prefer_compiled

Batch = Sequence[Job]
Work = Callable[[Batch], Sequence[Row]]
Done = tuple[Job, Row]
RUNS = 1600
"""Runs of a process, about, before it is replaced, since libraries of FMUs stay loaded."""


def in_processes(work: Work, batches: Sequence[Batch], count: int) -> Iterator[Done]:
    """Each job with its row, as they finish. Raises Interrupted after SIGINT or SIGTERM, when all
    processes have ended."""
    queue, most = deque(batches), -(-RUNS // max(map(len, batches), default=1))
    while queue:
        suspects = yield from _run_in_processes(work, queue, count, most)
        for job in (job for batch in suspects for job in batch):
            if (yield from _run_in_processes(work, deque([[job]]), 1, most)):
                yield job, failed(DIED, "the process of this run crashed")


def _run_in_processes(
    work: Work, queue: deque[Batch], count: int, most: int
) -> Generator[Done, None, list[Batch]]:
    """Runs jobs from `queue` until it is empty, up to `most` batches in a process; if a process
    dies, returns those in progress."""
    in_progress: dict[Future[Sequence[Row]], Batch] = {}
    with ExitStack() as own:
        processes = _kept.get() or own.enter_context(_Processes())
        pool = processes.start(count, most)
        while queue or in_progress:
            try:
                while queue and len(in_progress) < count:
                    with _block_signals():
                        in_progress[pool.submit(work, queue[0])] = queue[0]
                    queue.popleft()
                ready = wait(in_progress, timeout=0.2, return_when=FIRST_COMPLETED).done
                interrupt.raise_if_interrupted()
                for future in ready:
                    rows = future.result()
                    yield from zip(in_progress.pop(future), rows, strict=True)
            except BrokenProcessPool:
                processes.end()
                return list(in_progress.values())
    return []


class _Worker(SpawnProcess):
    """A spawned process that does not import the caller's main script, as it would by default: a
    script needs no `if __name__ == "__main__"`, and need not be a file."""

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return SpawnProcess._Popen(process)
        finally:
            sys.modules["__main__"] = main

    def run(self) -> None:
        process.raise_gc_threshold()
        process.freeze_gc()  # what is loaded by now
        with process_cache.keep_unpacked(), one_blas_thread(), prefer_compiled():
            super().run()
        process.freeze_gc()
        process.leave_threads(0)


class _Processes(ExitStack):
    """A pool of processes, each started when there is a job for it."""

    _pool: ProcessPoolExecutor | None = None

    def start(self, count: int, most: int) -> ProcessPoolExecutor:
        """The pool, of `count` processes for up to `most` batches each, where there is none yet."""
        self._pool = self._pool or self.enter_context(_executor(count, most))
        return self._pool

    def end(self) -> None:
        self._pool = None
        self.close()


_kept: ContextVar[_Processes | None] = ContextVar("_kept", default=None)


@contextmanager
def keep_processes() -> Iterator[None]:
    """Context in which calls of `in_processes` share their processes, which take half a second to
    start: for rounds of a few jobs."""
    with _Processes() as processes:
        before = _kept.set(processes)
        try:
            yield
        finally:
            _kept.reset(before)


@contextmanager
def _executor(count: int, most: int) -> Iterator[ProcessPoolExecutor]:
    before = set(multiprocessing.active_children())

    def kill() -> None:
        for process in set(multiprocessing.active_children()) - before:
            process.kill()
            process.join(1.0)
        util._run_finalizers(0)  # type: ignore[attr-defined]  # its semaphores, else warned of

    interrupt.add(kill)
    context = SpawnContext()  # FMUs hold threads and libraries: no fork
    context.Process = _Worker  # type: ignore[misc]
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=_follow, max_tasks_per_child=most
    )
    try:
        yield pool
    except BaseException:
        workers = set(multiprocessing.active_children()) - before
        pool.shutdown(wait=False, cancel_futures=True)
        for process in workers:
            process.terminate()
        for process in workers:  # time to remove their folders, since `shutdown` does not wait
            process.join(5.0)
            if process.is_alive():
                process.kill()
                process.join(1.0)
            if process.pid:
                temporary_folders.clear(process.pid)
        raise
    finally:
        pool.shutdown()
        interrupt.remove(kill)


@contextmanager
def _block_signals() -> Iterator[None]:
    """Processes and threads that are created in this context get no Ctrl-C from the terminal, not
    even during their imports."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow() -> None:
    """Initialises a worker: it ignores SIGINT, which its parent handles, ends orderly by SIGTERM so
    that its folders are removed, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    while True:  # the first signal ends the run, the second one the process
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.5)
