"""Temporary folders that tell by their name whose they are, so that those of a process that has
crashed can be removed by another."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def _prefix() -> str:
    """hapticlink-<machine>-; on Linux a container is one, as process numbers are its own."""
    machine = platform.node()
    with suppress(OSError):
        machine += os.readlink("/proc/self/ns/pid")
    return f"hapticlink-{zlib.crc32(machine.encode()):08x}-"


def new() -> str:
    """A new temporary folder, the caller's to remove: hapticlink-<machine>-<process>-<random>."""
    return tempfile.mkdtemp(prefix=f"{_prefix()}{os.getpid()}-")


@contextmanager
def room() -> Iterator[Path]:
    """A temporary folder that is there within."""
    path = new()
    try:
        yield Path(path)
    finally:
        shutil.rmtree(path, ignore_errors=True)


def clear(gone: int | None = None) -> None:
    """Remove the folders of `new` whose process is gone: of this machine and this user only.

    gone: one that is, though it may not have been waited for. On Windows, which cannot be asked
    for a process without harm to it, they stay.
    """
    if os.name != "posix":
        return
    ours = re.compile(rf"{_prefix()}(\d+)-\w+")
    with suppress(OSError), os.scandir(tempfile.gettempdir()) as entries:
        for entry in entries:
            found = ours.fullmatch(entry.name)
            if not found or not entry.is_dir(follow_symlinks=False):
                continue
            owner, own = int(found[1]), entry.stat(follow_symlinks=False).st_uid == os.getuid()
            if own and (owner == gone or not _lives(owner)):
                shutil.rmtree(entry.path, ignore_errors=True)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # somebody else's
        pass
    return True
