"""Processes of an attack: `hapticlink` in a process group of its own, what it says, how it ends,
and what it leaves behind."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

PATIENCE = 120.0
"""Seconds after which a process counts as hung, on a machine that is busy with other things."""
MARK = "HAPTICLINK_ATTACK"
"""Variable of the environment by which the processes of an attack are known: its folder."""


@contextmanager
def own_folder() -> Iterator[Path]:
    """The folder of an attack, which is gone after it."""
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        yield Path(folder)


class Process:
    """`hapticlink` with arguments. What it says is kept in a file, which processes that outlive it
    cannot hold open as they could a pipe; what it prints to stdout is left out on demand."""

    def __init__(
        self,
        arguments: Sequence[str],
        folder: Path,
        environment: dict[str, str],
        stdout: bool = True,
    ) -> None:
        self._said = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        self.begin = time.monotonic()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hapticlink", *arguments],
            stdout=self._said if stdout else subprocess.DEVNULL, stderr=self._said,
            env=os.environ | environment, cwd=folder, start_new_session=True,
        )  # fmt: skip
        self.number = self._process.pid

    def signal(self, number: int, at: float = 0.0, group: bool = True) -> None:
        """Sends a signal `at` (s) after its start, to its group as a terminal does, if it runs."""
        time.sleep(max(0.0, self.begin + at - time.monotonic()))
        if self._process.poll() is None:
            (os.killpg if group else os.kill)(self.number, number)

    def ended(self, patience: float = PATIENCE, interrupts: int = 0) -> tuple[int | None, str]:
        """Its status, and what it has said. After `patience` (s) it is interrupted, so many times,
        and then killed: None."""
        status = None
        for _ in range(interrupts + 1):
            try:
                status = self._process.wait(patience)
                break
            except subprocess.TimeoutExpired:
                self.signal(signal.SIGINT)
        if status is None:
            self.signal(signal.SIGKILL)
            self._process.wait()
        self._said.seek(0)
        said = self._said.read().decode(errors="replace")
        self._said.close()
        return status, said


class Room:
    """A folder in which an attack's processes run, with a temporary folder of their own."""

    def __init__(self, folder: Path, **environment: str) -> None:
        self.folder, self.temporary = folder, folder / "temporary"
        self.temporary.mkdir()
        self._environment = {"TMPDIR": str(self.temporary), MARK: str(folder)} | environment

    def started(
        self, arguments: Sequence[str], folder: str = "", stdout: bool = True, **environment: str
    ) -> Process:
        return Process(arguments, self.folder / folder, self._environment | environment, stdout)

    def left(self, seconds: float = 10.0) -> Iterator[str]:
        """Processes that are there after `seconds`, which are killed, and temporary files, which
        are removed."""
        until = time.monotonic() + seconds
        while (processes := self._processes()) and time.monotonic() < until:
            time.sleep(0.05)
        if processes:
            yield f"processes {', '.join(processes)}"
            for process in processes:
                os.kill(int(process), signal.SIGKILL)
        if names := self.left_files():
            yield f"temporary {', '.join(names)}"

    @staticmethod
    def hidden(folder: Path) -> Iterator[str]:
        """Files that a run writes beside its results and removes."""
        if names := [path.name for path in folder.glob(".*")]:
            yield f"files {', '.join(names)}"

    def left_files(self) -> list[str]:
        """Names of temporary files, which are removed."""
        if names := [path.name for path in self.temporary.iterdir()]:
            shutil.rmtree(self.temporary)
            self.temporary.mkdir()
        return names

    def _processes(self) -> list[str]:
        mark, numbers = f"{MARK}={self.folder}".encode(), []
        for path in Path("/proc").glob("[0-9]*/environ"):
            with suppress(OSError):  # gone, or somebody else's
                if mark in path.read_bytes().split(b"\0"):
                    numbers.append(path.parent.name)
        return numbers
