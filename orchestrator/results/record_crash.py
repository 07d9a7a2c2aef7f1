"""The process beside a run with foreign FMUs (`host/crash_monitor.py`): if one crashes the run, it
records a fault of kind `Crash` in run.json and removes the temporary folders."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault

POLL = 0.05
"""Time (s) between two looks whether the run's process has ended."""


def record_crash(folder: Path, process: int) -> None:
    """Records in run.json that the run with the given process ID has crashed, and removes its
    temporary folders. Without a row of that run, only prints a message."""
    from hapticlink.orchestrator.results.folder_lock import find_process  # slow to load
    from hapticlink.orchestrator.results.read_results import load
    from hapticlink.orchestrator.results.recover import recover
    from hapticlink.orchestrator.results.run_folder import LOG, unfinished_log

    temporary_folders.clear(process)
    with suppress(OSError):
        unfinished_log(folder, process).replace(folder / LOG)
    temporary_folders.clear_unfinished(folder, process)
    remedy = (
        "an FMU may have crashed it: with isolate = true each FMU has a process of its own, and "
        "the run names the one that crashes"
    )
    if find_process(folder) != process:  # the crashed run has written no row
        print(f"hapticlink: the process ended before its first row; {remedy}", file=sys.stderr)
        return
    message = f"the process of the run ended after t = {load(folder).last_time!r} s; {remedy}"
    recover(folder, "Crash", message, ended=True)
    print(f"hapticlink: {message}; results are in {folder}", file=sys.stderr)


def main() -> None:
    """Waits until the run's process ends. A run that ends regularly kills this process first."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.buffer.read()
    # An FMU may have closed the other end of it in a process that goes on.
    while os.name == "posix" and os.getppid() == int(sys.argv[2]):
        time.sleep(POLL)
    # A full disk, a folder that was removed, or one that another run writes to already.
    with suppress(OSError, InputFault):
        record_crash(Path(sys.argv[1]), int(sys.argv[2]))


if __name__ == "__main__":
    main()
