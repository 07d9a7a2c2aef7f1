"""SIGINT and SIGTERM at random instants of every command, once or twice, in a new folder or in that
of an earlier case: it ends by itself, with a message where its status is 1, leaves no process and
no temporary file, and changes nothing in the folder of a run that it reads. Only a signal that
comes before the project hears any is Python's."""

from __future__ import annotations

import random
import shutil
import signal
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from fuzz.cases import Made, seeded
from fuzz.processes import PATIENCE, Room, own_folder
from fuzz.signals import python_itself

LATEST = (1.0, 3.0, 12.0)
"""Seconds after the start at which the first signal comes at the latest, in turn by chance."""
READ = "first"
"""The folder of a run, with what `fit` needs."""
RUN = ["run", "closed-loop-ideal", "--set", "duration=0.5"]
COMMANDS = {
    "run": [*RUN, "--out", "out"],
    "view": ["view", "closed-loop-ideal", "--no-browser", "--port", "0", "--out", "view"],
    "new": ["new", "mine"],
    "compare": ["compare", READ, READ],
    "report": ["report", READ, "--out", "report.html"],
    "build": ["build", "closed-loop-ideal", "--out", "fmus"],
    "export": ["export", "closed-loop-ideal", "--out", "ssp"],
    "info": ["info", "closed-loop-ideal"],
    "schema": ["schema"],
    "stability": ["stability", "closed-loop-ideal"],
    "advise": ["advise", "closed-loop-direct", "--out", "advised"],
    "transparency": ["transparency", "closed-loop-ideal", "--out", "felt"],
    "fit": ["fit", READ, "--out", "fitted"],
    "tune": ["tune", "closed-loop-ideal", "--set", "sensing=encoders", "--out", "tuned"],
    "sweep": ["sweep", "pendulum", "--vary", "duration=0.1,0.2,0.3", "--out", "swept"],
    "study": ["study", "--out", "studied"],
    "bench": ["bench", "master", "--quick", "--out", "benched"],
    "doctor": ["doctor"],
    "recover": ["recover", READ],
    "reproduce": ["reproduce", "--out", "reproduced"],
}


def _heard(process: int) -> bool:
    """Whether it has a handler of SIGTERM, or ignores it, as the project does at its end."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return True  # it has ended
    masks = [int(line.split()[1], 16) for line in lines if line.startswith(("SigCgt", "SigIgn"))]
    return any(mask >> signal.SIGTERM - 1 & 1 for mask in masks)


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def _case(name: str, room: Room, read: dict[str, bytes], draw: random.Random) -> tuple[str, str]:
    """`read`: what the folder of the earlier run has."""
    here = room.folder / "here"
    number = draw.choice((signal.SIGINT, signal.SIGTERM))
    if draw.random() < 0.5:
        _removed(path for path in here.iterdir() if path.name != READ)
    process = room.started(COMMANDS[name], "here")
    time.sleep(draw.uniform(0.0, draw.choice(LATEST)))
    for _ in range(draw.choice((1, 1, 2))):
        heard = _heard(process.number)
        process.signal(number, group=number == signal.SIGINT)
        time.sleep(draw.uniform(0.0, 0.3))
    status, said = process.ended()
    left = [*room.left(), *_removed(here.rglob(".*"))]
    if _contents(here / READ) != read:
        return "lost", f"the folder of the earlier run has changed: {said[-300:]}"
    if status is None:  # Python's own start may lose a signal, such as in a callback of its imports
        return ("hung" if heard else "before"), f"no end after {PATIENCE:g} s: {said[-300:]}"
    if not heard and (status == -number or python_itself(status, said)):
        return "before", ""
    broken = any(mark in said for mark in ("Traceback", "Exception ignored", "leaked", "Fatal"))
    if status not in (0, 1, 2) or broken:
        return "crashed", f"status {status}: {said[-500:]}"
    if left:
        return "lost", f"{'; '.join(left)}: {said[-300:]}"
    if status and "hapticlink: " not in said and "interrupted" not in said:
        return "crashed", f"status {status} without a word: {said[-300:]}"
    return "told" if status else "done", ""


def _removed(paths: Iterable[Path]) -> list[str]:
    """Their names."""
    found = [*paths]
    for path in found:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    return [path.name for path in found]


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` cases, the commands in turn."""
    with own_folder() as folder:
        (folder / "here").mkdir()
        room = Room(folder)
        status, said = room.started([*RUN, "--out", READ], "here").ended()
        assert status == 0, said
        read = _contents(folder / "here" / READ)
        for i, case, draw in seeded(number, seed):
            kind = [*COMMANDS][i % len(COMMANDS)]
            yield Made(kind, case, *_case(kind, room, read, draw))
