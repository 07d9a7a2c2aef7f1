"""How a process of this package begins and ends, whoever has started it."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import threading
from contextlib import suppress
from io import TextIOWrapper

from hapticlink.orchestrator.base.errors import InputFault


def count_processes(jobs: int | None) -> int:
    """The number of processes that an option `jobs` asks for, one per processor by default."""
    if jobs is not None and jobs < 1:
        raise InputFault(f"--jobs {jobs}: give 1 or more")
    return jobs or os.cpu_count() or 1


def open_streams() -> None:
    """Opens those of the three standard streams that are closed as the null device, so that no file
    of a run gets their numbers, to which FMUs may write; and makes characters that the terminal's
    encoding lacks escapes."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # it takes the lowest free number
    sys.stdout = sys.stdout or open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def raise_gc_threshold() -> None:
    """Modules and figures are many objects that stay: searching them for cycles takes 5 % of a run,
    and as much again three times as the process ends, without `freeze_gc`."""
    gc.set_threshold(200_000)


def freeze_gc() -> None:
    """The objects that there are now are left out of every search for cycles."""
    gc.freeze()


def leave_threads(status: int) -> None:
    """Calls the exit functions and ends the process with `status` if an FMU has started threads of
    Python that still run: Python waits for these before it ends, without a bound and, at the end of
    a command, with signals ignored. Else returns."""
    own = threading.current_thread()
    if all(thread.daemon or thread is own for thread in threading.enumerate()):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed by the FMU or the caller
            stream.flush()
    os._exit(status)
