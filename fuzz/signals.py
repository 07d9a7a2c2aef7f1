"""Ctrl-C at random instants from the start of `hapticlink run` to its end.

Each case has an earlier run in its folder and gets one SIGINT, or a second one soon after, sent to
its process group as a terminal does. Whatever the instant: the process ends by itself with status
0 or 1 and a message, what stands in the folder is whole and true, and no process and no file stays
behind. Only a signal that comes before Python has read the first line of this project is Python's.
"""

from __future__ import annotations

import json
import random
import shutil
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from fuzz.cases import Made, hear_interrupts
from fuzz.processes import PATIENCE, Process, Room, own_folder
from hapticlink.orchestrator.results import read_results

KINDS = {
    "in process": [],
    "isolated": ["--set", "isolate=true"],
    "building": [],  # with an empty cache
}


class Attack(Room):
    """Cases in a folder of their own."""

    def __init__(self, folder: Path, scene: str, duration: float) -> None:
        hear_interrupts()
        super().__init__(folder, HAPTICLINK_CACHE=str(folder / "cache"))
        self.out, self._earlier = folder / "out", folder / "earlier"
        self._arguments = ["run", scene, "--out", str(self.out), "--set", f"duration={duration}"]
        self.lasts: dict[str, float] = {}
        """How long (s) an undisturbed run of each kind takes."""
        for kind in ("building", "in process", "isolated"):
            process = self._run(kind)
            status, said = process.ended()
            assert status == 0, said
            self.lasts[kind] = time.monotonic() - process.begin
        shutil.copytree(self.out, self._earlier)

    def _run(self, kind: str) -> Process:
        if kind == "building":
            shutil.rmtree(self.folder / "cache", ignore_errors=True)
        return self.started([*self._arguments, *KINDS[kind]], stdout=False)

    def instants(self, kind: str, draw: random.Random) -> tuple[float, ...]:
        """When signals come after the start of the process (s)."""
        first = draw.uniform(0.0, 1.05 * self.lasts[kind])
        second = first + draw.uniform(0.0, 0.3)
        return (first, second) if draw.random() < 0.25 else (first,)

    def made(self, kind: str, instants: Sequence[float]) -> tuple[str, str]:
        """One of OF_SIGNALS, and what was wrong."""
        shutil.rmtree(self.out)
        shutil.copytree(self._earlier, self.out)
        process = self._run(kind)
        for instant in instants:
            process.signal(signal.SIGINT, instant)
        status, said = process.ended()
        if status is None:
            return "hung", f"no end after {PATIENCE:g} s"
        if python_itself(status, said):
            return "before", ""
        if status not in (0, 1) or "Traceback" in said or "Fatal" in said:
            return "crashed", f"status {status}: {said[-500:]}"
        if wrong := [*self._untrue(status, said), *self.left(), *self.hidden(self.out)]:
            return "lost", f"status {status}: {'; '.join(wrong)}: {said[-300:]}"
        return "told" if status else "done", ""

    def _untrue(self, status: int, said: str) -> Iterator[str]:
        if status and "interrupted" not in said:
            yield "not told as interrupted"
        story = (self.out / "run.json").read_bytes()
        if story == (self._earlier / "run.json").read_bytes():
            if status == 0:
                yield "done, without results"
            for path in (self._earlier).iterdir():
                if path.read_bytes() != (self.out / path.name).read_bytes():
                    yield f"{path.name} of the earlier run has changed"
            return
        end = json.loads(story)["end"]
        if end["reason"] not in (("duration",) if status == 0 else ("duration", "interrupted")):
            yield f"run.json says {end['reason']}"
        elif read_results.load(self.out).haptics["time"][-1] != end["time"]:
            yield "run.json says another end than the rows"
        there, listed = {p.name for p in self.out.iterdir()}, set(json.loads(story)["files"])
        if status == 0 and there != listed:
            yield f"run.json lists other files: {', '.join(sorted(there ^ listed))}"


def python_itself(status: int, said: str) -> bool:
    """Whether the signal came before the first line of this project was read."""
    return status == -signal.SIGINT or ("KeyboardInterrupt" in said and "hapticlink" not in said)


def attack(
    number: int, seed: int, scene: str = "closed-loop-ideal", duration: float = 0.2
) -> Iterator[Made]:
    """Each case that is made."""
    draw = random.Random(seed)
    with own_folder() as folder:
        room = Attack(folder, scene, duration)
        kinds = [kind for kind in room.lasts for _ in range(1 if kind == "building" else 3)]
        for i in range(number):
            kind = kinds[i % len(kinds)]
            instants = room.instants(kind, draw)
            yield Made(kind, str(instants), *room.made(kind, instants))
