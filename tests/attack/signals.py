"""Ctrl-C at random instants from the start of `hapticlink run` to its end.

Each case has an earlier run in its folder and gets one SIGINT, or a second one soon after, sent to
its process group as a terminal does. Whatever the instant: the process ends by itself with status
0 or 1 and a message, what stands in the folder is whole and true, and no process and no file stays
behind. Only a signal that comes before Python has read the first line of this project is Python's.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hapticlink.orchestrator.results import tables
from tests.attack.cases import MARK, PATIENCE, Made, command, hear_interrupts, marked

COMMAND = [sys.executable, "-m", "hapticlink", "run", "closed-loop"]
KINDS = {
    "in process": [],
    "isolated": ["--set", "isolate=true"],
    "building": [],  # with an empty cache
}
OUTCOMES = ("before", "done", "told", "lost", "crashed", "hung")
"""before: Python's own start; done: after the last thing that asks; told: status 1, interrupted."""


@dataclass(frozen=True)
class Case:
    """Instants (s) of the signals after the start of the process."""

    kind: str
    instants: tuple[float, ...]


def cases(number: int, seed: int, lasts: dict[str, float]) -> Iterator[Case]:
    """`lasts`: how long (s) an undisturbed run of each kind takes."""
    draw = random.Random(seed)
    kinds = [k for k in lasts for _ in range(1 if k == "building" else 3)]
    for i in range(number):
        kind = kinds[i % len(kinds)]
        first = draw.uniform(0.0, 1.05 * lasts[kind])
        second = first + draw.uniform(0.0, 0.3)
        yield Case(kind, (first, second) if draw.random() < 0.25 else (first,))


class Attack:
    """Cases in a folder of their own."""

    def __init__(self, folder: Path, duration: float) -> None:
        hear_interrupts()
        self._folder, self._out = folder, folder / "out"
        self._temporary, self._cache = folder / "temporary", folder / "cache"
        self._temporary.mkdir()
        self._duration = ["--set", f"duration={duration}"]
        self._environment = os.environ | {
            "TMPDIR": str(self._temporary),
            "HAPTICLINK_CACHE": str(self._cache),
            MARK: str(folder),
        }
        self.lasts = {}
        for kind in ("building", "in process", "isolated"):
            begin = time.monotonic()
            process = self._started(kind, fresh=kind == "building")
            said = process.communicate(timeout=PATIENCE)[1]
            assert process.returncode == 0, said.decode()
            self.lasts[kind] = time.monotonic() - begin
        shutil.copytree(self._out, folder / "earlier")

    def _started(self, kind: str, fresh: bool) -> subprocess.Popen[bytes]:
        if fresh:
            shutil.rmtree(self._cache, ignore_errors=True)
        command = [*COMMAND, "--out", str(self._out), *self._duration, *KINDS[kind]]
        return subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            env=self._environment, start_new_session=True,
        )  # fmt: skip

    def made(self, case: Case) -> tuple[str, str]:
        """One of OUTCOMES, and what was wrong."""
        shutil.rmtree(self._out)
        shutil.copytree(self._folder / "earlier", self._out)
        begin = time.monotonic()
        process = self._started(case.kind, fresh=case.kind == "building")
        for instant in case.instants:
            time.sleep(max(0.0, begin + instant - time.monotonic()))
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        try:
            said = process.communicate(timeout=PATIENCE)[1].decode()
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return "hung", f"no end after {PATIENCE:g} s"
        if _python_itself(process.returncode, said):
            return "before", ""
        if process.returncode not in (0, 1) or "Traceback" in said or "Fatal" in said:
            return "crashed", f"status {process.returncode}: {said[-500:]}"
        if wrong := [*self._untrue(process.returncode, said), *self._left_behind()]:
            return "lost", f"status {process.returncode}: {'; '.join(wrong)}: {said[-300:]}"
        return "told" if process.returncode else "done", ""

    def _untrue(self, status: int, said: str) -> Iterator[str]:
        if status and "interrupted" not in said:
            yield "not told as interrupted"
        story = (self._out / "run.json").read_bytes()
        if story == (self._folder / "earlier" / "run.json").read_bytes():
            if status == 0:
                yield "done, without results"
            for path in (self._folder / "earlier").iterdir():
                if path.read_bytes() != (self._out / path.name).read_bytes():
                    yield f"{path.name} of the earlier run has changed"
            return
        end = json.loads(story)["end"]
        if end["reason"] not in (("duration",) if status == 0 else ("duration", "interrupted")):
            yield f"run.json says {end['reason']}"
        elif tables.load(self._out).haptics["time"][-1] != end["time"]:
            yield "run.json says another end than the rows"
        there, listed = {p.name for p in self._out.iterdir()}, set(json.loads(story)["files"])
        if status == 0 and there != listed:
            yield f"run.json lists other files: {', '.join(sorted(there ^ listed))}"

    def _left_behind(self) -> Iterator[str]:
        until = time.monotonic() + 10.0
        while (found := marked(self._folder)) and time.monotonic() < until:
            time.sleep(0.05)
        if found:
            yield f"processes {', '.join(found)}"
        if folders := [p.name for p in self._temporary.iterdir()]:
            yield f"folders {', '.join(folders)}"
            shutil.rmtree(self._temporary)
            self._temporary.mkdir()
        if unfinished := [p.name for p in self._out.glob(".*")]:
            yield f"files {', '.join(unfinished)}"


def _python_itself(status: int, said: str) -> bool:
    """Whether the signal came before the first line of this project was read."""
    return status == -signal.SIGINT or ("KeyboardInterrupt" in said and "hapticlink" not in said)


def attack(number: int, seed: int, duration: float = 0.2) -> Iterator[Made]:
    """Each case that is made."""
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        made = Attack(Path(folder), duration)
        for case in cases(number, seed, made.lasts):
            yield Made(case.kind, str(case.instants), *made.made(case))


if __name__ == "__main__":
    command("signals", "Ctrl-C at random instants of a run.", attack, 300, OUTCOMES)
