"""Analyses compute in one thread of BLAS, and leave its threads as they were."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Event
from typing import Any

import pytest
import scipy.linalg  # noqa: F401  # with the BLAS of SciPy

import hapticlink as hl
from hapticlink.analysis.advise import advise_method
from hapticlink.analysis.transparency import mobility_at_hand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.blas_threads import loaded_blas, one_blas_thread

SCENE = "closed-loop-ideal"


def threads() -> list[int]:
    return [library.get() for library in loaded_blas()]


@pytest.fixture(autouse=True)
def before() -> Iterator[list[int]]:
    """Other numbers of threads than one, and than each other."""
    found = threads()
    if not found:
        pytest.skip("NumPy and SciPy have no OpenBLAS")
    chosen = [3, 2][: len(found)]
    for library, count in zip(loaded_blas(), chosen, strict=True):
        library.set(count)
    yield chosen
    for library, count in zip(loaded_blas(), found, strict=True):
        library.set(count)


ENTRIES: dict[str, Callable[[], Any]] = {
    "stability": lambda: hl.stability(SCENE),
    "equilibrium_stability": lambda: hl.equilibrium_stability(SCENE),
    "passivity": lambda: hl.passivity(SCENE),
    "tune": lambda: hl.tune(SCENE),
    "advise": lambda: advise_method.advise(SCENE, (), None),  # type: ignore[arg-type]
    "transparency": lambda: hl.transparency(SCENE),
    "costs": lambda: mobility_at_hand.costs(SCENE, (), print),
    "fit": lambda: hl.fit("none.csv", SCENE),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_analysis_has_one_and_what_fails_leaves_as_many_as_before(
    entry: str, before: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = []

    def load(*_: Any) -> Any:
        inside.append(threads())
        raise ZeroDivisionError

    monkeypatch.setattr(open_scene, "load", load)
    with pytest.raises(ZeroDivisionError):
        ENTRIES[entry]()
    assert inside == [[1] * len(before)]
    assert threads() == before


def test_contexts_of_several_threads_end_with_the_last(before: list[int]) -> None:
    """Three enter in turn and leave in the same order, each by an exception, so that none leaves
    before the others are in, and the last is alone."""
    turns = [Barrier(3) for _ in range(7)]

    def work(number: int) -> list[list[int]]:
        seen = []
        try:
            for turn, barrier in enumerate(turns[:3]):
                barrier.wait(60)
                if turn == number:
                    context = one_blas_thread()
                    context.__enter__()
            for turn, barrier in enumerate(turns[3:6]):
                barrier.wait(60)
                if turn <= number:
                    seen.append(threads())
                turns[6].wait(60)
                if turn == number:
                    assert not context.__exit__(*fault())  # which it does not swallow
        except BaseException:
            for barrier in turns:
                barrier.abort()
            raise
        return seen

    def fault() -> tuple[Any, Any, Any]:
        try:
            raise ZeroDivisionError
        except ZeroDivisionError:
            return sys.exc_info()

    with ThreadPoolExecutor(3) as pool:
        seen = [*pool.map(work, range(3))]
    assert seen == [[[1] * len(before)] * (number + 1) for number in range(3)]
    assert threads() == before


PROBE = """
import os, time, numpy as np, scipy.linalg
from hapticlink.orchestrator.base.blas_threads import one_blas_thread

def others():
    '''Processor time (ticks) of all threads but this one.'''
    rest = {*os.listdir("/proc/self/task")} - {str(os.getpid())}
    stat = (open(f"/proc/self/task/{n}/stat").read().rpartition(")")[2].split() for n in rest)
    return sum(int(fields[11]) + int(fields[12]) for fields in stat)

def multiply():
    began = others()
    for _ in range(4):
        a @ a, scipy.linalg.blas.dgemm(1.0, a, a)
    return others() - began

a = np.random.default_rng(0).normal(size=(1000, 1000))
apart = multiply()
time.sleep(0.5)  # threads of OpenBLAS spin for a moment after their work
with one_blas_thread():
    alone = multiply()
print(apart > 0, alone, multiply() > 0)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_no_other_thread_of_the_process_computes() -> None:
    """In a process in which nothing limits them, and on more processors than one."""
    free = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    if len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one processor")
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(command, env=free, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "0", "True"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_has_the_contexts_of_the_thread_that_forked(before: list[int]) -> None:
    """Another thread may be anywhere in a context of its own meanwhile: it is not there."""

    def is_right_in_child(expected: list[int]) -> bool:
        child = os.fork()
        if child == 0:
            signal.alarm(10)  # ends a child that waits for a lock which nobody holds
            right = threads() == expected
            with one_blas_thread():
                right &= threads() == [1] * len(before)
            os._exit(0 if right and threads() == expected else 3)
        return os.waitpid(child, 0)[1] == 0

    entered, leave = Event(), Event()

    def hold() -> None:
        with one_blas_thread():
            entered.set()
            leave.wait()

    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(hold)
        entered.wait()
        assert is_right_in_child(before)
        with one_blas_thread():
            assert is_right_in_child([1] * len(before))
        leave.set()
        other.result()
        with one_blas_thread():
            pass
    assert threads() == before

    stop = Event()

    def enter_and_leave() -> None:
        while not stop.is_set():
            with one_blas_thread():
                pass

    with ThreadPoolExecutor(1) as pool:
        pool.submit(enter_and_leave)
        try:
            assert all(is_right_in_child(before) for _ in range(20))
        finally:
            stop.set()
    assert threads() == before
