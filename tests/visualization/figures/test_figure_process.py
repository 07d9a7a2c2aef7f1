"""The process that draws a run's figures: it draws the same, may fail, and ends with the run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import hapticlink as hl
from tests.orchestrator.run.test_interrupt import alive, waited_for

MAIN = "from hapticlink.__main__ import main; main()"
FAILING = (
    "from hapticlink.orchestrator.results import figures_beside\n"
    "figures_beside.__name__ = 'nowhere'\n"
)

SLOW = (b"waiting for another process that builds", b"Matplotlib is building the font cache")
"""What is told where other tests build the same FMU, or use Matplotlib for the first time."""


def command(*arguments: object, before: str = "") -> list[str]:
    return [sys.executable, "-c", before + MAIN, *map(str, arguments)]


def pngs(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.png")}


@pytest.mark.parametrize("before", ["", FAILING])
def test_it_draws_what_a_run_from_python_draws(bar: Path, tmp_path: Path, before: str) -> None:
    """Or where it fails, the run's own process does."""
    hl.run(bar, out=tmp_path / "here")
    line = command("run", bar, "--out", tmp_path / "beside", before=before)
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert ("No module named" in done.stderr) == bool(before)
    assert pngs(tmp_path / "beside") == pngs(tmp_path / "here") != {}


def test_what_is_wrong_with_a_drawing_is_told(bar: Path, tmp_path: Path) -> None:
    before = (
        "from hapticlink.orchestrator.results import figures\n"
        "figures.drawings = lambda _: {'wrong': lambda: 1 / 0}\n"
    ) + FAILING
    line = command("run", bar, "--out", tmp_path, before=before)
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr


def content(path: Path) -> bytes:
    """A file of /proc; nothing if its thread or process has just ended."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def drawing(pid: int) -> list[int]:
    """The IDs of the process that draws for a run."""
    children = (task / "children" for task in Path(f"/proc/{pid}/task").iterdir())
    found = [int(child) for file in children for child in content(file).split()]
    return [n for n in found if b"figures_beside" in content(Path(f"/proc/{n}/cmdline"))]


@pytest.mark.skipif(sys.platform != "linux", reason="finds the processes of a process in /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_it_ends_with_the_run(bar: Path, tmp_path: Path, number: signal.Signals) -> None:
    """As in a terminal, the signal goes to the whole group."""
    line = command("run", bar, "--out", tmp_path / "out", "--set", "duration=1000")
    with subprocess.Popen(line, stderr=subprocess.PIPE, start_new_session=True) as running:
        waited_for(lambda: drawing(running.pid) and (tmp_path / "out" / "run.json").exists())
        (process,) = drawing(running.pid)
        os.killpg(running.pid, number)
        _, said = running.communicate(timeout=60)
    waited_for(lambda: not alive(process))
    told = [line for line in said.splitlines() if not line.startswith(SLOW)]
    assert len(told) == (number == signal.SIGINT), said
