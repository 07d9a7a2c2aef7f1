"""One run at a time writes to a result folder."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hapticlink.fmus import lock
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import folders

_holders: dict[tuple[int, int], int] = {}
"""The thread that holds the lock of a folder of this process, by device and inode."""


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Within the context no other run, of this process or another one of this machine, writes to
    `folder`, which is created if necessary and removed again if it stays empty. The lock ends with
    the process, and leaves no file. A thread may enter the context again.

    Raises InputFault at once where another run holds the lock, or where the folder cannot be
    written to.
    """
    missing = [p for p in (folder, *folder.parents) if not os.path.exists(p)]
    folders.ensure(folder)
    status = folder.stat()
    key = status.st_dev, status.st_ino
    if _holders.get(key) == threading.get_ident():
        yield
        return
    try:
        with _try_lock(folder) as locked:
            if not locked:
                raise InputFault(
                    f"--out {folder}: another run writes there{_process(folder)}; wait for its "
                    "end, or name another folder"
                )
            _holders[key] = threading.get_ident()
            try:
                yield
            finally:
                del _holders[key]
    finally:
        with suppress(OSError):  # it has results
            for path in missing:
                path.rmdir()


@contextmanager
def _try_lock(folder: Path) -> Iterator[bool]:
    """Whether the lock is held within the context: that of the folder itself; on Windows, where a
    folder has none, of a file in it. A file system without locks gives it to everyone."""
    if sys.platform == "win32":
        path = folder / ".run.lock"
        with lock.try_lock(path) as locked:
            yield locked
        if locked:
            path.unlink(missing_ok=True)
        return
    import fcntl

    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        except OSError:
            pass
        try:
            yield True
        finally:
            with suppress(OSError):  # forked processes may have the folder open, too
                fcntl.flock(number, fcntl.LOCK_UN)
    finally:
        os.close(number)


def _process(folder: Path) -> str:
    """Which process the run in `folder` belongs to, as far as its run.json says so."""
    with suppress(InputFault, ValueError, LookupError, TypeError, AttributeError):
        end = text_files.read_json(folder / "run.json")["end"]
        return f", in process {int(end['process'])}"
    return ""
