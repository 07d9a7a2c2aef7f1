"""A watchdog process for runs that load foreign FMUs into their own process.

If such an FMU crashes the process of the run, the watchdog records a fault of kind `Crash` in
run.json and removes the temporary folders.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hapticlink.orchestrator.base import interrupt, temporary_folders, text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.run.compiled import library


@contextmanager
def watched(folder: Path) -> Iterator[None]:
    """Context in which a crash of this process is recorded in `folder`/run.json.

    Within it os._exit, with which Python code of an FMU can end the process, changes exit status 0
    to 1, since 0 would mean a regular end of the run; and so does exit() of C, where there is a
    compiled loop.
    """
    command = [sys.executable, "-P", "-m", __name__, str(folder.resolve()), str(os.getpid())]
    # A session of its own keeps the terminal's Ctrl-C from it. Its standard input is closed by the
    # operating system when this process ends.
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as process:
        interrupt.add(process.kill)
        guard = library.load().guard  # against exit() of C: process_state.c
        exit_at_once = os._exit
        os._exit = lambda status: exit_at_once(status or 1)
        guard(1)
        try:
            yield
        finally:
            guard(0)
            os._exit = exit_at_once
            interrupt.remove(process.kill)
            process.kill()


def record_crash(folder: Path, process: int) -> None:
    """Records in run.json that the run with the given process ID has crashed, and removes its
    temporary folders. Without a row of that run, only prints a message."""
    from hapticlink.orchestrator.results.read_results import load
    from hapticlink.orchestrator.results.recover import recover

    temporary_folders.clear(process)
    for unfinished in folder.glob(f".*.{process}"):
        unfinished.unlink()
    remedy = (
        "an FMU may have crashed it: with isolate = true each FMU has a process of its own, and "
        "the run names the one that crashes"
    )
    if _process(folder) != process:  # the crashed run has written no row
        print(f"hapticlink: the process ended before its first row; {remedy}", file=sys.stderr)
        return
    results = load(folder)
    message = f"the process of the run ended after t = {results.last_time!r} s; {remedy}"
    recover(folder, "Crash", message, ended=True)
    print(f"hapticlink: {message}; results are in {folder}", file=sys.stderr)


def _process(folder: Path) -> int | None:
    """The process ID of the run in progress in `folder`, from its run.json; None without one."""
    try:
        end = text_files.read_json(folder / "run.json")["end"]
        process: int | None = end.get("process")
    except (InputFault, LookupError, TypeError, AttributeError):
        return None
    return process


def main() -> None:
    """Waits until the run's process ends. A run that ends regularly kills this process first."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.buffer.read()
    # A full disk, a folder that was removed, or one that another run writes to already.
    with suppress(OSError, InputFault):
        record_crash(Path(sys.argv[1]), int(sys.argv[2]))


if __name__ == "__main__":
    main()
