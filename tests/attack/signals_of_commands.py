"""SIGINT and SIGTERM at random instants of every command, once or twice: it ends by itself, with a
message where its status is 1, and leaves no process and no temporary file. Only a signal that comes
before Python has read the first line of this project is Python's."""

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

from tests.attack.cases import Made, command
from tests.attack.signals import MARK, _marked, _python_itself

PATIENCE = 120.0
"""Seconds after which a process counts as hung, on a machine that is busy with other things."""
LATEST = 8.0
"""Seconds after the start at which the first signal comes at the latest."""
COMMANDS = {
    "run": ["run", "closed-loop", "--set", "duration=0.5", "--out", "out"],
    "view": ["view", "closed-loop", "--no-browser", "--port", "0", "--out", "view"],
    "new": ["new", "mine", "--out", "mine.toml"],
    "compare": ["compare", "first", "first"],
    "report": ["report", "first", "--out", "report.html"],
    "build": ["build", "closed-loop", "--out", "fmus"],
    "export": ["export", "closed-loop", "--out", "ssp"],
    "info": ["info", "closed-loop"],
    "schema": ["schema"],
    "stability": ["stability", "closed-loop"],
    "tune": ["tune", "closed-loop", "--out", "tuned"],
    "sweep": ["sweep", "pendulum", "--vary", "duration=0.1,0.2,0.3", "--out", "swept"],
    "study": ["study", "--out", "studied"],
    "doctor": ["doctor"],
    "recover": ["recover", "first"],
}


def _case(name: str, folder: Path, draw: random.Random) -> tuple[str, str]:
    temporary = folder / "temporary"
    environment = os.environ | {"TMPDIR": str(temporary), MARK: str(folder)}
    number = draw.choice((signal.SIGINT, signal.SIGTERM))
    process = subprocess.Popen(
        [sys.executable, "-m", "hapticlink", *COMMANDS[name]],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment, cwd=folder / "here",
        start_new_session=True,
    )  # fmt: skip
    time.sleep(draw.uniform(0.0, draw.choice((1.0, 3.0, LATEST))))
    for _ in range(draw.choice((1, 1, 2))):
        if process.poll() is None:
            os.killpg(process.pid, number) if number == signal.SIGINT else process.terminate()
        time.sleep(draw.uniform(0.0, 0.3))
    try:
        said = process.communicate(timeout=PATIENCE)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return "hung", f"no end after {PATIENCE:g} s"
    until = time.monotonic() + 10.0
    while (processes := _marked(str(folder))) and time.monotonic() < until:
        time.sleep(0.05)
    left = [p.name for p in temporary.iterdir()]
    hidden = [*(folder / "here").rglob(".*")]
    left += [str(path.relative_to(folder)) for path in hidden]
    shutil.rmtree(temporary)
    temporary.mkdir()
    for path in hidden:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    if process.returncode == -number or _python_itself(process.returncode, said):
        return "before", ""
    broken = any(mark in said for mark in ("Traceback", "Exception ignored", "leaked", "Fatal"))
    if process.returncode not in (0, 1, 2) or broken:
        return "crashed", f"status {process.returncode}: {said[-500:]}"
    if processes or left:
        return "lost", f"processes {processes}, temporary {left}: {said[-300:]}"
    return "told" if process.returncode else "done", ""


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` cases, the commands in turn."""
    with tempfile.TemporaryDirectory(prefix="attack-") as name:
        folder = Path(name)
        for each in ("here", "temporary"):
            (folder / each).mkdir()
        first = ["run", "pendulum", "--set", "duration=0.2", "--out", "first"]
        command = [sys.executable, "-m", "hapticlink", *first]
        subprocess.run(command, cwd=folder / "here", check=True, capture_output=True)
        for i in range(number):
            kind = [*COMMANDS][i % len(COMMANDS)]
            outcome, wrong = _case(kind, folder, random.Random(f"{seed} {i}"))
            yield Made(kind, f"number {i} of seed {seed}", outcome, wrong)


OUTCOMES = ("before", "done", "told", "lost", "crashed", "hung")

if __name__ == "__main__":
    command("signals_of_commands", "Signals at random instants of commands.", attack, 300, OUTCOMES)
