"""Messages of somebody who has the key, to a server of FMUs: calls in any order, with arguments
that a run may send and others, mutated and cut; the server's own loop is not needed for that.

Whatever comes, each message gets an answer or is dropped, the server lives, its memory is bounded,
and another run that comes afterwards steps the FMU as ever.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from pathlib import Path
from time import monotonic_ns
from typing import Any

import msgpack

from fuzz import mutations
from fuzz.cases import Made, seeded
from fuzz.processes import own_folder
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.network import served_part, server
from hapticlink.orchestrator.network.messages import ARGUMENTS, KINDS, Request
from hapticlink.orchestrator.network.server import Server
from hapticlink.orchestrator.system.build_system import build_system
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene

CALLS = 60
"""Messages of a case."""
NUMBERS = (-1, 0, 1, 2, 3, 2**31, 2**63, 2**64 - 1, -(2**63))
NAMES = ("u", "on", "gain", "y", "z", "", "x" * 5000)
OUTPUTS = ["y", "steps"]


class Holder:
    """A holder of the key: knows what a run knows, and keeps its count of calls right half of the
    time."""

    def __init__(self, of: Server, identity: dict[str, str], draw: random.Random) -> None:
        self.of, self.identity, self.draw = of, identity, draw
        self.session, self.number = draw.randbytes(16), 0
        self.newest = b""

    def send(self, call: str, arguments: list[Any], pending: list[Any]) -> str:
        """The kind of the answer, "" where there is none."""
        sent = Request(self.session, self.number, 0, pending, call, arguments)
        return self.deliver(sent.packed())

    def deliver(self, message: bytes) -> str:
        self.newest = message
        answer = self.of.answered([message], monotonic_ns())
        if answer is None:
            return ""
        number, *_, kind, _ = msgpack.unpackb(answer)
        self.number = min(max(self.number, number + (kind != "refused")), 2**64 - 1)
        assert kind in KINDS
        return str(kind)

    def run(self) -> bool:
        """Whether a whole little run is carried out as ever."""
        answers = [
            self.send("hello", ["slow", OUTPUTS, self.identity], []),
            self.send("connect", [["u"]], []),
            self.send("enter_initialization", [0.0, 1.0], []),
            self.send("exit_initialization", [], []),
            self.send("step", [0.0, 0.25, 0.25], [[0, struct.pack("<d", 2.0)]]),
            self.send("close", [], []),
        ]
        return answers == ["answer"] * len(answers)

    def misuse(self) -> None:
        draw, call = self.draw, self.draw.choice([*ARGUMENTS, "step", "connect", "close"])
        if call == "close" and draw.random() < 0.8:
            call = "step"
        values = [draw.choice((b"", bytes(8), bytes(16), bytes(8001))) for _ in range(2)]
        pending = [[draw.choice(NUMBERS), v] for v in values] if draw.random() < 0.4 else []
        message = [self.session, self.number, 0, pending, call, self._arguments(call)]
        how = draw.random()
        if how < 0.15:
            message[draw.randrange(6)] = draw.choice(
                (*NUMBERS, None, "x", b"", [], {}, [[]] * 9, 1.5, float("nan"))
            )
        packed = msgpack.packb(message)
        if 0.15 < how < 0.25:
            packed = mutations.flipped(packed, draw)
        elif 0.25 < how < 0.3:
            packed = self.newest
        self.deliver(packed)

    def _arguments(self, call: str) -> list[Any]:
        draw = self.draw
        if call == "hello":
            outputs = draw.choice((OUTPUTS, [], ["z"], ["y"] * 9, [7]))
            return [draw.choice(("slow", "fast", "")), outputs, self.identity]
        if call == "connect":
            return [[draw.choice(NAMES) for _ in range(draw.randrange(4))]]
        times = (0.0, 0.25, -1.0, 1e300, 5e-324, float("inf"), float("nan"))
        kinds = {float: times, int: NUMBERS}
        return [draw.choice(kinds.get(kind, (None,))) for kind in ARGUMENTS[call]]


def _case(folder: Path, draw: random.Random, states: bool) -> tuple[str, str]:
    read = open_scene.load(scene(folder, fmu_table("slow", "Slow")), ())
    with build_system(read) as system:
        fmu = system.fmu["slow"]
        identity = served_part.identity(read, fmu)
        of = Server({"slow": (fmu, identity)}, read.faults, lambda text: None)
        try:
            holder = Holder(of, identity, draw)
            begins = draw.randrange(5)
            for call, arguments in (
                ("hello", ["slow", OUTPUTS, identity]),
                ("connect", [["u"]]),
                ("enter_initialization", [0.0, 1.0]),
                ("exit_initialization", []),
            )[:begins]:
                holder.send(call, arguments, [])
            for _ in range(CALLS):
                holder.misuse()
            if ours := [why for why in of.refused if "has failed in the server" in why]:
                return "crashed", ours[0]
            server.LEASE = 0.0
            if not Holder(of, identity, draw).run():
                return "lost", "the next run is not served"
        except Exception as error:
            return "crashed", f"{type(error).__name__}: {error}"
        finally:
            of.close()
    return "done", ""


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` holders of the key, of an FMU with states and one without in turn."""
    with own_folder() as folder:
        for states in (False, True):
            (folder / str(states)).mkdir()
            python_fmu(
                folder / str(states), "Slow", "self.y = self.u + time", canGetAndSetFMUstate=states
            )
        for i, case, draw in seeded(number, seed):
            states = bool(i % 2)
            made = _case(folder / str(states), draw, states)
            yield Made("with states" if states else "without states", case, *made)
