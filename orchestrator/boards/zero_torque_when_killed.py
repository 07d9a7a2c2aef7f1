"""A process that takes the torque off a board if this process is killed.

It (`stand_by.py`) waits for a lock that this process holds, and then writes the message of zero
torque to the board's port. On Linux the lock is a mutex that the kernel releases first of all when
a thread dies (robust, pthread_mutexattr_setrobust(3)): the end of a pipe comes only once all memory
is given back, which took some 30 ms, and stands in where there are none.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from hapticlink.orchestrator.boards import stand_by

WORKERS_PRIORITY = 19
"""Priority of the kernel's workers, below that of the haptic loop, where the user may."""
_SIZE = 256
"""Bytes of a mutex or of its attributes, and more."""
_SHARED, _ROBUST = 1, 1  # PTHREAD_PROCESS_SHARED, PTHREAD_MUTEX_ROBUST


@contextmanager
def write_if_killed(port: int, message: bytes) -> Iterator[str]:
    """Context in which a process stands by that writes `message` to the file descriptor `port` once
    this process, or the thread that has entered the context, has ended within it. Gives
    the priority of the kernel's workers that pass on the bytes of a serial port. POSIX only."""
    shared, release = _hold_mutex()
    numbers = map(str, (port, shared, WORKERS_PRIORITY))
    with subprocess.Popen(
        [sys.executable, "-I", "-S", stand_by.__file__, *numbers, message.hex()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=(port, shared) if shared >= 0 else (port,),
        start_new_session=True,  # what ends this one's group leaves it
    ) as process:
        assert process.stdin
        assert process.stdout
        workers = process.stdout.readline().decode().strip()
        try:
            yield workers
        finally:
            with suppress(OSError):
                process.stdin.write(b"0")
                process.stdin.close()
            release()


def _hold_mutex() -> tuple[int, Callable[[], object]]:
    """The file descriptor of shared memory with a mutex that the calling thread holds, and what
    releases it; -1 and nothing to release where there are no robust ones."""
    library = ctypes.CDLL(None)
    if not (hasattr(os, "memfd_create") and hasattr(library, "pthread_mutexattr_setrobust")):
        return -1, lambda: None
    shared, attributes = os.memfd_create("held"), ctypes.create_string_buffer(_SIZE)
    os.ftruncate(shared, _SIZE)
    memory = mmap.mmap(shared, _SIZE)
    mutex = ctypes.byref(ctypes.c_char.from_buffer(memory))
    library.pthread_mutexattr_init(attributes)
    library.pthread_mutexattr_setpshared(attributes, _SHARED)
    library.pthread_mutexattr_setrobust(attributes, _ROBUST)
    library.pthread_mutex_init(mutex, attributes)
    library.pthread_mutex_lock(mutex)

    def release() -> None:
        library.pthread_mutex_unlock(mutex)
        os.close(shared)

    return shared, release
