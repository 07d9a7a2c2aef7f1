"""One `hapticlink` command in a process of its own, and what became of it.

The process is forked from this one, which has its imports, and has bounds: of processor time, of
time, of memory. A run that has rows and goes on is ended by one SIGINT, as somebody at the terminal
would; what gets no row and no end is hung.
"""

from __future__ import annotations

import filecmp
import json
import math
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from fuzz.processes import PATIENCE, Room
from hapticlink import commands
from hapticlink.commands import internal_error
from hapticlink.commands import run as run
from hapticlink.orchestrator import experiment as experiment
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization.figures import run_figures as run_figures

ENOUGH = 0.5
"""Seconds from a run's first row on after which it is ended."""
WORK = 5.0
"""Seconds after which a sweep is ended, whose runs may be 100,000 or long."""
PROCESSOR_TIME = 30
"""Seconds of a processor after which a command is hung."""
MEMORY = 6 << 30
"""Bytes of address space."""
CRASHED = ("Traceback", "Fatal Python error", internal_error.PREFIX)
MESSAGE = 20_000
"""Characters of a message that somebody may read."""


class Place(Room):
    """A folder for the cases: an earlier run's results in `out`, a temporary folder of its own."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        adapter(Scene)  # once, not in each process
        self.out, self.earlier, self.here = (folder / name for name in ("out", "earlier", "here"))
        self.here.mkdir()
        status, said = self.forked(["run", "pendulum", "--out", str(self.earlier)])
        assert status == 0, said

    def made(self, arguments: Sequence[str]) -> tuple[str, str]:
        """One of OUTCOMES, and what was wrong; the command may write to `out`."""
        self.renew()
        status, said = self.forked(arguments)
        if bad := self.broken(status, said):
            return bad
        assert status is not None
        if wrong := [*self._lost(status)]:
            return "lost", f"status {status}: {'; '.join(wrong)}: {said[-500:]}"
        ended = status == 0 or "interrupted" in said
        return ("done" if ended else "told" if status == 1 else "refused"), ""

    def renew(self) -> None:
        """The earlier run is in `out` again."""
        shutil.rmtree(self.out, ignore_errors=True)
        shutil.copytree(self.earlier, self.out)

    def broken(self, status: int | None, said: str) -> tuple[str, str] | None:
        """hung or crashed, and what was wrong; None for a command that has ended as it should."""
        if status is None or -status in (signal.SIGXCPU, signal.SIGKILL):
            return "hung", said[-500:]
        if status not in (0, 1, 2) or any(mark in said for mark in CRASHED):
            return "crashed", f"status {status}: {said[-300:]}{self.reports()}"
        if status and "hapticlink: " not in said and "╭" not in said:
            return "crashed", f"status {status} without a word: {said[-500:]}"
        if len(said) > MESSAGE:
            return "crashed", f"a message of {len(said)} characters: {said[:500]}"
        return None

    def reports(self) -> str:
        """The ends of the reports of errors of ours."""
        found = ""
        for path in self.temporary.glob("hapticlink-error-*"):
            found += path.read_text("utf-8")[-700:]
            path.unlink()
        return found

    def _lost(self, status: int) -> Iterator[str]:
        story = self.out / "run.json"
        if status == 2 or not story.exists() or _same(story, self.earlier / "run.json"):
            for path in self.earlier.iterdir():
                if not (self.out / path.name).exists() or not _same(path, self.out / path.name):
                    yield f"{path.name} of the earlier run has changed or is gone"
        elif json.loads(story.read_text("utf-8"))["end"].get("reason") in (None, "running"):
            yield "run.json has no end"
        yield from self.hidden(self.out)
        if left := self.left_files():
            yield f"temporary {', '.join(left)}"

    def forked(self, arguments: Sequence[str]) -> tuple[int | None, str]:
        """Status (negative: the signal; None: no end within PATIENCE) and what it said."""
        said, rows = self.folder / "said.txt", self.out / "run.json"
        earlier = rows.stat().st_ino if rows.exists() else None
        process = os.fork()
        if process == 0:
            os.chdir(self.here)
            _child(lambda: commands.main(arguments), said, self.temporary)
        status = None
        try:
            patience = WORK if arguments[:1] == ["sweep"] else math.inf
            status = self._ended(process, rows, earlier, patience)
        finally:
            if status is None:
                os.killpg(process, signal.SIGKILL)
                os.waitpid(process, 0)
        return status, said.read_text("utf-8", errors="replace")

    def _ended(self, process: int, rows: Path, earlier: int | None, patience: float) -> int | None:
        """Its status, None where it takes longer than PATIENCE; it is interrupted after `patience`
        (s), or when it has rows and goes on."""
        begin, began = time.monotonic(), None
        while not (found := os.waitpid(process, os.WNOHANG))[0]:
            now = time.monotonic()
            if began is None and earlier and rows.exists() and rows.stat().st_ino != earlier:
                began = now
            if began is None and now > begin + patience:
                began = now
            if began is not None and now > began + ENOUGH:
                os.kill(process, signal.SIGINT)
                began = math.inf
            if now > begin + PATIENCE:
                return None
            time.sleep(0.002)
        return os.waitstatus_to_exitcode(found[1])


def _same(a: Path, b: Path) -> bool:
    return filecmp.cmp(a, b, shallow=False)


def _child(call: Callable[[], object], said: Path, temporary: Path) -> None:
    """Never returns."""
    status = 70
    try:
        os.setsid()
        file = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(file, stream)
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", closefd=False, errors="backslashreplace")  # noqa: SIM115
        resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_TIME, PROCESSOR_TIME + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        tempfile.tempdir = os.environ["TMPDIR"] = str(temporary)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        call()
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 70
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):  # closed by a plugin
                stream.flush()
        os._exit(status)
