"""Locks between processes of a machine, which end with the process that holds them."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

POLL = 0.05
"""Time (s) between two attempts to take a lock."""


@contextmanager
def try_lock(path: Path) -> Iterator[bool]:
    """Whether the lock of the file `path`, which is made if necessary, is held within the context:
    not if it is held already, by another process or another call in this one. Raises OSError where
    the file cannot be opened."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as file:
        yield _take(file)


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


def _take(file: IO[bytes]) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
