"""SIGINT and SIGTERM at random instants of every command, once or twice, in a new folder or in that
of an earlier case: it ends by itself, with a message where its status is 1, leaves no process and
no temporary file, and changes nothing in the folder of a run that it reads. Only a signal that
comes before the project hears any is Python's."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.attack.cases import MARK, PATIENCE, Made, command, marked
from tests.attack.signals import _python_itself

LATEST = (1.0, 3.0, 12.0)
"""Seconds after the start at which the first signal comes at the latest, in turn by chance."""
READ = "first"
"""The folder of a run, with what `fit` needs."""
RUN = ["run", "closed-loop", "--set", "duration=0.5"]
COMMANDS = {
    "run": [*RUN, "--out", "out"],
    "view": ["view", "closed-loop", "--no-browser", "--port", "0", "--out", "view"],
    "new": ["new", "mine"],
    "compare": ["compare", READ, READ],
    "report": ["report", READ, "--out", "report.html"],
    "build": ["build", "closed-loop", "--out", "fmus"],
    "export": ["export", "closed-loop", "--out", "ssp"],
    "info": ["info", "closed-loop"],
    "schema": ["schema"],
    "stability": ["stability", "closed-loop"],
    "advise": ["advise", "closed-loop-direct", "--out", "advised"],
    "transparency": ["transparency", "closed-loop", "--out", "felt"],
    "fit": ["fit", READ, "--out", "fitted"],
    "tune": ["tune", "closed-loop", "--set", "sensing=encoders", "--out", "tuned"],
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


def _case(name: str, folder: Path, read: dict[str, bytes], draw: random.Random) -> tuple[str, str]:
    """`read`: what the folder of the earlier run has."""
    here, temporary = folder / "here", folder / "temporary"
    environment = os.environ | {"TMPDIR": str(temporary), MARK: str(folder)}
    number = draw.choice((signal.SIGINT, signal.SIGTERM))
    if draw.random() < 0.5:
        for path in here.iterdir():
            if path.name != READ:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
    process = subprocess.Popen(
        [sys.executable, "-m", "hapticlink", *COMMANDS[name]],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment, cwd=here,
        start_new_session=True,
    )  # fmt: skip
    time.sleep(draw.uniform(0.0, draw.choice(LATEST)))
    for _ in range(draw.choice((1, 1, 2))):
        heard = _heard(process.pid)
        if process.poll() is None:
            os.killpg(process.pid, number) if number == signal.SIGINT else process.terminate()
        time.sleep(draw.uniform(0.0, 0.3))
    hung = False
    try:
        said = process.communicate(timeout=PATIENCE)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said, hung = process.communicate()[0].decode(errors="replace"), True
    until = time.monotonic() + 10.0
    while (processes := marked(folder)) and time.monotonic() < until:
        time.sleep(0.05)
    left = [p.name for p in temporary.iterdir()]
    hidden = [*here.rglob(".*")]
    left += [str(path.relative_to(folder)) for path in hidden]
    shutil.rmtree(temporary)
    temporary.mkdir()
    for path in hidden:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    if _contents(here / READ) != read:
        return "lost", f"the folder of the earlier run has changed: {said[-300:]}"
    if hung:  # Python's own start may lose a signal, such as in a callback of its imports
        return ("hung" if heard else "before"), f"no end after {PATIENCE:g} s: {said[-300:]}"
    if not heard and (process.returncode == -number or _python_itself(process.returncode, said)):
        return "before", ""
    broken = any(mark in said for mark in ("Traceback", "Exception ignored", "leaked", "Fatal"))
    if process.returncode not in (0, 1, 2) or broken:
        return "crashed", f"status {process.returncode}: {said[-500:]}"
    if processes or left:
        return "lost", f"processes {processes}, temporary {left}: {said[-300:]}"
    if process.returncode and "hapticlink: " not in said and "interrupted" not in said:
        return "crashed", f"status {process.returncode} without a word: {said[-300:]}"
    return "told" if process.returncode else "done", ""


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` cases, the commands in turn."""
    with tempfile.TemporaryDirectory(prefix="attack-") as name:
        folder = Path(name)
        for each in ("here", "temporary"):
            (folder / each).mkdir()
        first = [sys.executable, "-m", "hapticlink", *RUN, "--out", READ]
        subprocess.run(first, cwd=folder / "here", check=True, capture_output=True)
        read = _contents(folder / "here" / READ)
        for i in range(number):
            kind = [*COMMANDS][i % len(COMMANDS)]
            outcome, wrong = _case(kind, folder, read, random.Random(f"{seed} {i}"))
            yield Made(kind, f"number {i} of seed {seed}", outcome, wrong)


OUTCOMES = ("before", "done", "told", "lost", "crashed", "hung")

if __name__ == "__main__":
    command("signals_of_commands", "Signals at random instants of commands.", attack, 300, OUTCOMES)
