"""What a server carries out, and what it refuses, by its messages alone."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic_ns
from typing import Any

import numpy as np
import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.network import served_part, server
from hapticlink.orchestrator.network.messages import Answer, Request, answer_of
from hapticlink.orchestrator.network.server import Server
from hapticlink.orchestrator.system.build_system import build_system
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene

ONE, TWO = bytes(16), bytes(15) + b"2"
OUTPUTS = ["y", "steps"]


class Run:
    """A run as the server sees it."""

    def __init__(self, of: Server, session: bytes, identity: dict[str, str]) -> None:
        self.of, self.session, self.identity, self.number = of, session, identity, 0

    def message(self, call: str, *arguments: Any, pending: Any = (), number: int = -1) -> bytes:
        number = self.number if number < 0 else number
        return Request(self.session, number, 0, [*pending], call, [*arguments]).packed()

    def sent(self, message: bytes, call: str = "step") -> Answer | None:
        answer = self.of.answered([message], monotonic_ns())
        return None if answer is None else answer_of(answer, call, len(OUTPUTS))

    def call(self, call: str, *arguments: Any, pending: Any = ()) -> Answer:
        answer = self.sent(self.message(call, *arguments, pending=pending), call)
        assert answer
        assert answer.number == self.number
        self.number += answer.kind != "refused"
        return answer

    def started(self) -> Run:
        for call in ("hello", "connect", "enter_initialization", "exit_initialization"):
            of = {"hello": ("slow", OUTPUTS, self.identity), "connect": (["u"],)}
            ends = {"enter_initialization": (0.0, 1.0)}
            assert self.call(call, *(of | ends).get(call, ())).kind == "answer"
        return self

    def step(self, time: float, pending: Any = ()) -> list[float]:
        answer = self.call("step", time, time + 0.25, 0.25, pending=pending)
        assert answer.kind == "answer", answer.content
        return list(struct.unpack("<2d", answer.content[0]))


@contextmanager
def serving(folder: Path, body: str, **options: bool) -> Iterator[Run]:
    """The first run of a server of an FMU."""
    python_fmu(folder, "Slow", body, **options)
    read = open_scene.load(scene(folder, fmu_table("slow", "Slow")), ())
    with build_system(read) as system:
        fmu = system.fmu["slow"]
        identity = served_part.identity(read, fmu)
        of = Server({"slow": (fmu, identity)}, read.faults, lambda text: None)
        yield Run(of, ONE, identity)
        of.close()


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """Of an FMU that adds u to the time."""
    with serving(tmp_path, "self.y = self.u + time + size") as first:
        yield first


def test_calls_are_carried_out_once_each(run: Run) -> None:
    """A step that comes again has the answer that it had, and the FMU has taken it once."""
    run.started()
    u = [[0, struct.pack("<d", 2.0)]]
    assert run.step(0.0, u) == [2.25, 1]
    again = run.message("step", 0.0, 0.25, 0.25, pending=u, number=run.number - 1)
    for _ in range(3):
        answer = run.sent(again)
        assert answer
        assert struct.unpack("<2d", answer.content[0]) == (2.25, 1)
    assert run.step(0.25) == [2.5, 2]
    assert run.call("close").content["step"] == 2


def test_calls_out_of_order_are_refused(run: Run) -> None:
    run.started()
    old = run.message("step", 0.0, 0.25, 0.25)
    assert run.step(0.0) == [0.25, 1]
    assert run.step(0.25) == [0.5, 2]
    assert run.sent(old) is None  # a replayed message
    assert run.sent(run.message("step", 9.0, 9.25, 0.25, number=99)) is None
    for call, arguments in (
        ("step", (0.25, 0.5, 0.25)),  # a replayed stamp
        ("step", (0.5, 0.5, 0.0)),
        ("enter_initialization", (0.0, 1.0)),
        ("connect", (["y"],)),
        ("connect", ([5],)),
    ):
        assert run.call(call, *arguments).kind == "refused"
    for pending in ([[5, b""]], [[-1, bytes(8)]], [[0, bytes(16)]]):
        assert run.call("step", 0.5, 0.75, 0.25, pending=pending).kind == "refused"
    assert run.step(0.5) == [0.75, 3]


def test_another_scene_or_version_is_refused_by_what_differs(run: Run) -> None:
    other = run.identity | {"scene haptics": "0123", "casadi": "1.0"}
    answer = run.call("hello", "slow", OUTPUTS, other)
    assert answer.kind == "refused"
    assert "its scene is another one: scene haptics (" in answer.content
    assert "casadi (" in answer.content
    assert run.call("hello", "fast", OUTPUTS, run.identity).content.startswith("no FMU 'fast'")
    assert run.call("hello", "slow", ["z"], run.identity).kind == "refused"


def test_a_second_run_has_to_wait(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    run.started()
    second = Run(run.of, TWO, run.identity)
    assert "in use by another run" in second.call("hello", "slow", OUTPUTS, run.identity).content
    assert run.step(0.0) == [0.25, 1]
    run.call("close")
    assert second.started().step(0.0) == [0.25, 1]
    third = Run(run.of, ONE[:-1] + b"3", run.identity)
    monkeypatch.setattr(server, "LEASE", 0.0)  # a run that is not heard of
    assert third.started().step(0.0) == [0.25, 1]
    lost = second.call("step", 0.25, 0.5, 0.25)
    assert lost.kind == "refused"
    assert "the state of the FMU is lost" in lost.content


def test_a_fault_of_the_fmu_is_the_answer(tmp_path: Path) -> None:
    with serving(tmp_path, "raise ValueError('three')") as run:
        answer = run.started().call("step", 0.0, 0.25, 0.25)
    assert answer.kind == "fault"
    assert "three" in str(answer.content)


def test_a_flood_changes_nothing_and_fills_no_memory(run: Run) -> None:
    """Random bytes, and messages of a run that is not known, between two steps."""
    run.started()
    assert run.step(0.0) == [0.25, 1]
    random = np.random.default_rng(1)
    for i in range(5000):
        run.of.answered([random.bytes(i % 200)], 0)
        run.of.answered([random.bytes(3), b""], 0)
        stranger = Request(random.bytes(16), i, 0, [], "read", [])
        run.of.answered([stranger.packed()], 0)
    assert run.of.refused.total() == 15000
    assert len(run.of.refused) <= server.KINDS + 1
    assert run.step(0.25) == [0.5, 2]


def test_states_are_those_that_were_saved(tmp_path: Path) -> None:
    def steps(call: str, *arguments: Any) -> Any:
        return run.call(call, *arguments).content

    with serving(tmp_path, "self.y = time + size", canGetAndSetFMUstate=True) as run:
        run.started()
        assert steps("rollback", 3) == "rollback: no state was saved in slot 3"
        assert steps("save", 2) is None
        first = run.step(0.0)
        assert steps("rollback", 2) is None
        assert run.step(0.0) == first
        for slot in (-1, server.SLOTS, 2**63):
            assert "where there are 0 to" in steps("save", slot)


def test_an_fmu_without_states_is_not_asked_for_them(run: Run) -> None:
    run.started()
    assert "cannot save its state" in run.call("save", 0).content
    assert run.step(0.0) == [0.25, 1]


def test_setters_are_bounded(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same inputs have one setter; no input stands twice in it."""
    run.started()
    for _ in range(50):
        assert run.call("connect", ["u"]).content == 0
    assert run.call("connect", ["u", "u"]).content == "connect: an input twice"
    monkeypatch.setattr(server, "SETTERS", 1)
    assert "more than 1 groups" in run.call("connect", []).content
    assert run.step(0.0, [[0, struct.pack("<d", 2.0)]]) == [2.25, 1]


def test_a_mistake_of_ours_ends_one_run(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    run.started()
    monkeypatch.setattr(server.ServedFmu, "read", lambda self: 1 / 0)
    answer = run.call("read")
    assert (answer.kind, "ZeroDivisionError" in answer.content) == ("refused", True)
    assert run.call("step", 0.0, 0.25, 0.25).kind == "refused"
    monkeypatch.undo()
    assert Run(run.of, TWO, run.identity).started().step(0.0) == [0.25, 1]
