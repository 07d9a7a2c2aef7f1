"""Locks between processes of a machine, which end with the process that holds them."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

POLL = 0.05
"""Time (s) between two attempts to take a lock."""


@contextmanager
def try_lock(path: Path) -> Iterator[bool]:
    """Whether the lock of a folder, or of a file, which is made if necessary, is held within the
    context: not if it is held already, by another process or another call in this one. A file
    system without locks gives it to everyone; on Windows folders have none. Raises OSError where it
    cannot be opened."""
    path.parent.mkdir(parents=True, exist_ok=True)
    number = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR | os.O_CREAT)
    try:
        yield _take(number)
    finally:
        if sys.platform != "win32":
            with suppress(OSError):  # forked processes may have it open, too
                fcntl.flock(number, fcntl.LOCK_UN)
        with suppress(OSError):  # an FMU may have closed it
            os.close(number)


@contextmanager
def hold_lock(path: Path, poll: Callable[[], object]) -> Iterator[None]:
    """Holds the lock of the file `path`; calls `poll` from time to time while waiting for it."""
    while True:
        with try_lock(path) as taken:
            if taken:
                yield
                return
        poll()
        time.sleep(POLL)


def _take(number: int) -> bool:
    try:
        if sys.platform == "win32":
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return sys.platform != "win32" and not isinstance(error, BlockingIOError)
    return True
