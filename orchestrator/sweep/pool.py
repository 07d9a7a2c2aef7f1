"""Jobs in processes of their own: a crash takes one run, Ctrl-C leaves nothing behind.

At most one job a process is under way. Where a process dies, its pool breaks and does not say
which job did it: those under way are made again, each alone, and the one that dies alone is told.
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
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.sweep.job import Job
from hapticlink.orchestrator.sweep.row import DIED, Row, failed

Work = Callable[[Job], Row]
Done = tuple[Job, Row]
RUNS = 200
"""Runs of one process, before a fresh one takes over: libraries of Python FMUs stay loaded."""


def in_processes(work: Work, jobs: Sequence[Job], count: int) -> Iterator[Done]:
    """Each job with its row, as they finish. Raises Interrupted at SIGINT or SIGTERM, when all
    processes have ended."""
    queue = deque(jobs)
    while queue:
        suspects = yield from _spread(work, queue, count)
        for job in suspects:
            if (yield from _spread(work, deque([job]), 1)):
                yield job, failed(DIED, "the process of this run crashed")


def _spread(work: Work, queue: deque[Job], count: int) -> Generator[Done, None, list[Job]]:
    """Take jobs from `queue` until it is empty, or a process dies: then what was under way."""
    under_way: dict[Future[Row], Job] = {}
    with _executor(min(count, len(queue))) as pool:
        while queue or under_way:
            try:
                while queue and len(under_way) < count:
                    with _signals_blocked():
                        under_way[pool.submit(work, queue[0])] = queue[0]
                    queue.popleft()
                ready = wait(under_way, timeout=0.2, return_when=FIRST_COMPLETED).done
                interrupt.check()
                for future in ready:
                    row = future.result()
                    yield under_way.pop(future), row
            except BrokenProcessPool:
                return list(under_way.values())
    return []


class _Worker(SpawnProcess):
    """A spawned process that does not run the caller's script once more, as they do by default:
    a sweep in it needs no `if __name__ == "__main__"`, and its file need not be there."""

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            return SpawnProcess._Popen(process)
        finally:
            sys.modules["__main__"] = main


@contextmanager
def _executor(count: int) -> Iterator[ProcessPoolExecutor]:
    before = set(multiprocessing.active_children())

    def kill() -> None:
        for process in set(multiprocessing.active_children()) - before:
            process.kill()
            process.join(1.0)

    context = SpawnContext()  # FMUs hold threads and libraries: no fork
    context.Process = _Worker  # type: ignore[misc]
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=_follow, max_tasks_per_child=RUNS
    )
    interrupt.add(kill)
    try:
        yield pool
    except BaseException:
        workers = set(multiprocessing.active_children()) - before
        pool.shutdown(wait=False, cancel_futures=True)
        for process in workers:
            process.terminate()
        for process in workers:  # they remove their folders; a second shutdown waits for nobody
            process.join(5.0)
        raise
    finally:
        pool.shutdown()
        interrupt.remove(kill)


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Processes and threads that are made within get no Ctrl-C from the terminal, not at their
    imports either."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow() -> None:
    """A worker leaves signals of the terminal to its parent, ends by SIGTERM with its folders
    cleaned up, and does not outlive the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    while True:  # a first one ends the run, a second one the process
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.5)
