"""Temporary folders named by machine and owner process, so that those of a crashed process can be
removed by another one."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from hapticlink.fmus.plain_folder import find_unpacking_folder


def _prefix() -> str:
    """`hapticlink-<machine>-`; on Linux each container counts as a machine, since it has its own
    process numbers."""
    machine = platform.node()
    with suppress(OSError):
        machine += os.readlink("/proc/self/ns/pid")
    return f"hapticlink-{zlib.crc32(machine.encode()):08x}-"


def make_folder() -> str:
    """Creates a temporary folder `hapticlink-<machine>-<process>-<random>`, which the caller has to
    remove, where FMUs can be unpacked."""
    _clear_once()
    return tempfile.mkdtemp(prefix=f"{_prefix()}{os.getpid()}-", dir=find_unpacking_folder())


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A temporary folder that exists within the context."""
    with folder_if_needed() as path:
        path.mkdir(mode=0o700)
        yield path


@contextmanager
def folder_if_needed() -> Iterator[Path]:
    """The path of a temporary folder, which whoever needs it creates within the context."""
    _clear_once()
    path = Path(tempfile.gettempdir(), f"{_prefix()}{os.getpid()}-{os.urandom(8).hex()}")
    try:
        yield path
    finally:
        if path.exists():
            shutil.rmtree(path, ignore_errors=True)


@cache
def _clear_once() -> None:
    """Before the first folder of a process, which may be a script without a command."""
    clear()


def clear(ended: int | None = None) -> None:
    """Removes temporary folders of processes that have ended, of this machine and user only.

    ended: a process to treat as ended even if its parent has not waited for it yet. On Windows,
    where asking whether a process exists may end it, nothing is removed.
    """
    if os.name != "posix":
        return
    ours = re.compile(rf"{_prefix()}(\d+)-\w+")
    for folder in {tempfile.gettempdir(), find_unpacking_folder()}:
        with suppress(OSError), os.scandir(folder) as entries:
            for entry in entries:
                match = ours.fullmatch(entry.name)
                if not match or not entry.is_dir(follow_symlinks=False):
                    continue
                owner, own = int(match[1]), entry.stat(follow_symlinks=False).st_uid == os.getuid()
                if own and (owner == ended or not lives(owner)):
                    shutil.rmtree(entry.path, ignore_errors=True)


UNFINISHED = re.compile(r"\..+\.(?:(?:rows|log)\.(\d+)|(\d+)\.[0-9a-f]{32}(?:\.\w+)?)")
"""The names of files that a process of that number writes: of `atomic_file`, rows, and a log."""


def clear_unfinished(folder: Path, ended: int | None = None) -> None:
    """Removes what processes that have ended were writing to a folder of results, whose lock is
    held; ended: as in `clear`."""
    if os.name != "posix":
        return
    for path in folder.iterdir():
        if match := UNFINISHED.fullmatch(path.name):
            owner = int(match[1] or match[2])
            if owner == ended or not lives(owner):
                with suppress(OSError):
                    path.unlink()


def lives(process: int) -> bool:
    """Whether a process exists. Not for Windows, where asking may end it."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # somebody else's
        pass
    return True
