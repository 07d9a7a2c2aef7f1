"""The end of a process whose FMUs have started threads of Python that still run. Python waits for
such threads before it ends, without a bound and, at the end of a command, with signals ignored."""

from __future__ import annotations

import atexit
import os
import sys
import threading
from contextlib import suppress


def leave_threads(status: int) -> None:
    """Calls the exit functions and ends the process with `status` if such threads run; else
    returns."""
    own = threading.current_thread()
    if all(thread.daemon or thread is own for thread in threading.enumerate()):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed by the FMU or the caller
            stream.flush()
    os._exit(status)
