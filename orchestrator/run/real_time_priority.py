"""Real-time priority of the thread that runs the haptic loop, as far as the user has the right.

On Linux: SCHED_FIFO (sched(7)), above every normal thread and below the kernel's own; memory that
is locked, so that no page is fetched in the middle of a step (mlockall(2)); and a core of its own
where the machine was started with `isolcpus`. Threads that take steps beside the loop have the
priority below it: one that the machine stops while it holds the interpreter would stop the loop.
Other threads, and processes that the loop starts, keep the normal priority.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

PRIORITY = 20
"""Below the kernel's interrupt threads (50), above all that is not real time."""
_ISOLATED = Path("/sys/devices/system/cpu/isolated")
_CURRENT, _FUTURE = 1, 2  # MCL_CURRENT, MCL_FUTURE of mlockall(2)


@contextmanager
def raise_priority() -> Iterator[dict[str, str]]:
    """A context in which the calling thread has what the user may have of it. Gives what that is,
    and for what was refused the reason: `scheduler`, `memory`, `core`. What the thread had before,
    as under `chrt`, is not lowered, and is there again afterwards."""
    if sys.platform != "linux":
        yield {"scheduler": "normal: real-time priority is for Linux only"}
        return
    with ExitStack() as undo:
        yield {"scheduler": _scheduler(undo), "memory": _memory(undo), "core": _core(undo)}


def raise_beside() -> None:
    """Give a thread beside the loop the priority below it, where the user may, and where it has
    none yet, as under `chrt`."""
    if sys.platform == "linux" and not os.sched_getparam(0).sched_priority:
        with suppress(OSError):
            lower = os.sched_param(PRIORITY - 1)
            os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, lower)


def _scheduler(undo: ExitStack) -> str:
    policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
    if before.sched_priority >= PRIORITY:
        return f"priority {before.sched_priority}, as it was before"
    wanted = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        os.sched_setscheduler(0, wanted, os.sched_param(PRIORITY))
    except PermissionError:
        return f"normal: no right to SCHED_FIFO (ulimit -r {PRIORITY})"
    except OSError as error:
        return f"normal: {error.strerror}"
    # Only a privileged process may take the second flag back.
    undo.callback(os.sched_setscheduler, 0, policy | os.SCHED_RESET_ON_FORK, before)
    return f"SCHED_FIFO {PRIORITY}"


def _memory(undo: ExitStack) -> str:
    import resource  # not on Windows

    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
    # With a limit, memory that is asked for later would be refused once it is reached.
    wanted = _CURRENT | _FUTURE if unlimited or os.geteuid() == 0 else _CURRENT
    library = ctypes.CDLL(None, use_errno=True)
    if library.mlockall(wanted):
        return f"not locked: {os.strerror(ctypes.get_errno())} (ulimit -l unlimited)"
    undo.callback(library.munlockall)
    return "locked"


def _core(undo: ExitStack) -> str:
    """Move the thread to the first isolated core."""
    text = _ISOLATED.read_text().strip() if _ISOLATED.exists() else ""
    if not text:
        return "shared: none is isolated (isolcpus)"
    core, before = int(text.replace("-", ",").split(",")[0]), os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {core})
    except OSError as error:  # a container may be kept from it
        return f"shared: {core} is isolated, and cannot be had: {error.strerror}"
    undo.callback(os.sched_setaffinity, 0, before)
    return f"{core}, isolated"
