"""The process that stands by while a board has torques: it takes them away if its host is killed.

    python -I -S stand_by.py PORT SHARED PRIORITY MESSAGE

PORT is the file descriptor of the board's port, SHARED that of memory with a mutex that the host
holds, -1 where there is none, and MESSAGE that of zero torque, hexadecimal. It needs the standard
library alone, so that it is there within some hundredths of a second.

The bytes of serial ports are passed on by workers of the kernel (Linux), which have the normal
priority: on a busy machine they wait for others. Where the user may, those that there are have
PRIORITY until this process ends, which it does however its host has ended. It prints what they
have.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress


def main(port: int, shared: int, priority: int, message: bytes) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority + 2))  # above the loop
    lock = ctypes.c_char.from_buffer(mmap.mmap(shared, 0)) if shared >= 0 else None
    with raise_workers(priority) if os.isatty(port) else nullcontext() as raised:
        print(f"SCHED_FIFO {priority}" if raised else "normal", flush=True)
        died = lock and ctypes.pythonapi.pthread_mutex_lock(ctypes.byref(lock))
        if died or os.read(0, 1) == b"":
            os.write(port, message)
            time.sleep(0.05)  # workers pass it on before they have the normal priority again


@contextmanager
def raise_workers(priority: int) -> Iterator[list[int]]:
    """Context in which the kernel's workers that belong to no core and had the normal priority have
    that one, as far as the user may; gives which."""
    raised = []
    names = os.listdir("/proc") if sys.platform == "linux" else ()
    for worker in map(int, filter(str.isdigit, names)):
        with suppress(OSError), open(f"/proc/{worker}/comm") as file:
            normal = not (os.sched_getscheduler(worker) or os.getpriority(os.PRIO_PROCESS, worker))
            if file.read().startswith("kworker/u") and normal:
                os.sched_setscheduler(worker, os.SCHED_FIFO, os.sched_param(priority))
                raised.append(worker)
    try:
        yield raised
    finally:
        for worker in raised:
            with suppress(OSError):  # it is gone
                os.sched_setscheduler(worker, os.SCHED_OTHER, os.sched_param(0))


if __name__ == "__main__":
    descriptor, memory, given = map(int, sys.argv[1:4])
    main(descriptor, memory, given, bytes.fromhex(sys.argv[4]))
