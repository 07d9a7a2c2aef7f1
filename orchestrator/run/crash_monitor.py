"""A watchdog process for runs that load foreign FMUs into their own process: if such an FMU crashes
the run, it records that in run.json and removes the temporary folders."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hapticlink.orchestrator.base import interrupt, temporary_folders


@contextmanager
def beside(folder: Path) -> Iterator[None]:
    """Context in which a crash of this process is recorded in `folder`/run.json, and in which
    Python code that ends the process (os._exit) does not end it with 0, which is a good end."""
    command = [sys.executable, "-P", "-m", __name__, str(folder.resolve()), str(os.getpid())]
    # In a session of its own, so that it gets no Ctrl-C. Its stdin ends when this process ends.
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as process:
        interrupt.add(process.kill)
        leave = os._exit
        os._exit = lambda status: leave(status or 1)
        try:
            yield
        finally:
            os._exit = leave
            interrupt.remove(process.kill)
            process.kill()


def finish(folder: Path, process: int) -> None:
    """Completes run.json and removes the temporary folders of the run that died in `process`."""
    from hapticlink.orchestrator.results.files import write_json
    from hapticlink.orchestrator.results.tables import load

    temporary_folders.clear(process)
    for unfinished in folder.glob(f".*.{process}"):
        unfinished.unlink()
    remedy = (
        "an FMU may have crashed it: with isolate = true each FMU has a process of its own, and "
        "the run names the one that crashes"
    )
    if _process(folder) != process:  # that run has written no row
        print(f"hapticlink: the process ended before its first row; {remedy}", file=sys.stderr)
        return
    results = load(folder)
    story = dict(results.run)
    time = float(results.tables[story["rates"][0]]["time"][-1])
    message = f"the process of the run ended after t = {time!r} s; {remedy}"
    story |= {
        "end": {"reason": "fault", "time": time},
        "fault": {"kind": "Crash", "message": message},
    }
    write_json(folder / "run.json", story)
    print(f"hapticlink: {message}; results are in {folder}", file=sys.stderr)


def _process(folder: Path) -> int | None:
    """The process of the run in progress in `folder`, from its run.json; None without one."""
    try:
        end = json.loads((folder / "run.json").read_text(encoding="utf-8"))["end"]
        process: int | None = end.get("process")
    except (OSError, ValueError, KeyError):
        return None
    return process


def main() -> None:
    """Waits for the end of the run's process; a run that ends regularly kills this one first."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.buffer.read()
    with suppress(OSError):  # a full disk, or a folder that was removed
        finish(Path(sys.argv[1]), int(sys.argv[2]))


if __name__ == "__main__":
    main()
