"""Commands without a terminal: started with streams that are closed, or by one of few letters."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hapticlink.orchestrator.results import tables

RUN = f"{sys.executable} -m hapticlink run pendulum --set duration=0.01 --no-figures --out out"


@pytest.mark.skipif(os.name != "posix", reason="a shell's redirections")
@pytest.mark.parametrize(
    "closed", [">&-", "2>&-", "<&- >&- 2>&-", "--set isolate=true <&- >&- 2>&-"]
)
def test_a_closed_stream_is_no_fault(tmp_path: Path, closed: str) -> None:
    subprocess.run(f"{RUN} {closed}", shell=True, cwd=tmp_path, check=True)
    found = tables.load(tmp_path / "out")
    assert found.run["end"]["reason"] == "duration"
    assert len(found.haptics["time"]) == 6


def test_letters_that_the_terminal_lacks_are_escaped(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "hapticlink", "info", "pendulum", "--set", "title=λ"],
        env=os.environ | {"PYTHONIOENCODING": "ascii"}, capture_output=True, check=False,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout[:7]) == (0, b"\\u03bb\n")
