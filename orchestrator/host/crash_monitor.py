"""A process beside a run that loads foreign FMUs into its own, which records its crash."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hapticlink.orchestrator.base import interrupt

CLOSED = (
    "an FMU has closed files of this process that it had not opened; with isolate = true each FMU "
    "has a process of its own"
)


@contextmanager
def watch_for_crash(
    folder: Path, recording: str, guard_exit: Callable[[int], object]
) -> Iterator[None]:
    """Context in which a crash of this process is recorded in `folder`/run.json, by the module of
    the name `recording`.

    Within it os._exit, with which Python code of an FMU can end the process, changes exit status 0
    to 1, since 0 would mean a regular end of the run; and so does exit() of C, where `guard_exit`
    switches that on.
    """
    command = [sys.executable, "-P", "-m", recording, str(folder.resolve()), str(os.getpid())]
    # A session of its own keeps the terminal's Ctrl-C from it. Its standard input is closed by the
    # operating system when this process ends.
    process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
    interrupt.add(process.kill)
    exit_at_once = os._exit
    os._exit = lambda status: exit_at_once(status or 1)
    guard_exit(1)
    try:
        yield
    finally:
        guard_exit(0)
        os._exit = exit_at_once
        interrupt.remove(process.kill)
        process.kill()
        assert process.stdin is not None
        try:
            process.stdin.close()
        except OSError:
            logging.getLogger(__name__).warning(CLOSED)
        process.wait()
