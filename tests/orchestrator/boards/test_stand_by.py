"""The kernel's workers that pass on the bytes of serial ports, while a run with a board lasts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hapticlink.orchestrator.boards.stand_by import raise_workers
from hapticlink.orchestrator.boards.zero_torque_when_killed import write_if_killed

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the kernel is Linux'")


def names(processes: list[int]) -> list[str]:
    return [Path(f"/proc/{each}/comm").read_text() for each in processes]


def normal_workers() -> list[int]:
    """By another program."""
    table = subprocess.run(["ps", "-eo", "pid,cls,ni,comm"], capture_output=True, text=True).stdout
    rows = [line.split() for line in table.splitlines()]
    return [int(r[0]) for r in rows if r[1:3] == ["TS", "0"] and r[3].startswith("kworker/u")]


@pytest.fixture
def workers() -> list[int]:
    return normal_workers() or pytest.skip("no worker of the kernel is seen here")


def test_workers_are_raised_and_have_the_normal_priority_afterwards(workers, monkeypatch):
    given: dict[int, list[tuple[int, int]]] = {}

    def schedule(process: int, policy: int, parameter: os.sched_param) -> None:
        given.setdefault(process, []).append((policy, parameter.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    with raise_workers(19) as raised:
        assert all(name.startswith("kworker/u") for name in names(raised))
        assert set(raised) & set(workers)
        assert all(given[each] == [(os.SCHED_FIFO, 19)] for each in raised)
    assert [*given] == raised
    assert all(calls[-1] == (os.SCHED_OTHER, 0) for calls in given.values())


def test_without_the_right_nothing_is_raised(monkeypatch):
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with raise_workers(19) as raised:
        assert raised == []


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs the right")
@pytest.mark.parametrize("kind", ["terminal", "pipe"])
def test_they_are_raised_for_a_serial_port_alone(workers, kind):
    """A board behind a network does not need them; while the context lasts, and not after it."""
    reading, writing = os.openpty() if kind == "terminal" else os.pipe()
    with write_if_killed(writing, b"zero") as told:
        during = set(workers) & set(normal_workers())
    assert told == ("SCHED_FIFO 19" if kind == "terminal" else "normal")
    assert (during != set(workers)) == (kind == "terminal")
    assert set(workers) & set(normal_workers())
    os.close(reading)
    os.close(writing)
