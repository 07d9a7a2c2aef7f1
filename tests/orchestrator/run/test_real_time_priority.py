"""The priority of the loop's thread: it has what the user may have, and gives it back."""

import os
import sys
import threading

import pytest

from hapticlink.orchestrator.run import real_time_priority
from hapticlink.orchestrator.run.concurrent_fmus import ThreadWorker

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="sched(7) is of Linux")


def test_the_thread_has_the_priority_and_its_threads_do_not():
    before = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getaffinity(0)
    beside: list[int] = []
    with real_time_priority.raise_priority() as got:
        own = os.sched_getscheduler(0)
        thread = threading.Thread(target=lambda: beside.append(os.sched_getscheduler(0)))
        thread.start()
        thread.join()
    allowed = got["scheduler"].startswith("SCHED_FIFO")
    assert (own & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO) == allowed
    assert beside == [os.SCHED_OTHER]
    after = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getaffinity(0)
    assert after == before


def test_steps_beside_the_loop_have_the_priority_below_it():
    """At the normal one the machine would stop them while they hold the interpreter, and with it
    the loop."""
    worker, done = ThreadWorker(), threading.Event()
    found: list[tuple[int, int]] = []

    def policy() -> None:
        found.append((os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))

    worker.submit(policy, done.set)
    assert done.wait(60)
    worker.close(60)
    with real_time_priority.raise_priority() as got:
        own = os.sched_getparam(0).sched_priority
    if got["scheduler"].startswith("SCHED_FIFO"):
        assert found == [(os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, own - 1)]
    else:
        assert found[0][1] == os.sched_getparam(0).sched_priority


def test_a_missing_right_is_a_reason_and_no_error(monkeypatch):
    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with real_time_priority.raise_priority() as got:
        pass
    assert got["scheduler"] == "normal: no right to SCHED_FIFO (ulimit -r 20)"


def test_a_higher_priority_stays(monkeypatch):
    """As under `chrt -f 50`."""
    monkeypatch.setattr(os, "sched_getparam", lambda _: os.sched_param(50))
    set_to: list[object] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: set_to.append(given))
    with real_time_priority.raise_priority() as got:
        assert got["scheduler"] == "priority 50, as it was before"
    assert set_to == []


@pytest.fixture
def isolated(monkeypatch, tmp_path):
    """Says which cores are isolated."""
    monkeypatch.setattr(real_time_priority, "_ISOLATED", tmp_path / "isolated")
    return (tmp_path / "isolated").write_text


def test_the_first_isolated_core_is_taken_if_it_can_be_had(isolated):
    before = os.sched_getaffinity(0)
    core = min(before)
    for cores, own, told in (
        ("1000", before, "shared: 1000 is isolated, and cannot be had"),
        (f"{core}-7", {core}, f"{core}, isolated"),
    ):
        isolated(f"{cores}\n")
        with real_time_priority.raise_priority() as got:
            assert os.sched_getaffinity(0) == own
        assert got["core"].startswith(told)
        assert os.sched_getaffinity(0) == before
