"""What a process keeps of FMUs: model descriptions, and of those of this project the unpacked
files, once for all instances, and instances that were reset. Foreign FMUs, which may write next to
their resources, are unpacked afresh for every instance."""

from __future__ import annotations

import shutil
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

from fmpy import extract

from hapticlink.fmus.atomic_file import name_in_errors
from hapticlink.orchestrator.base import shelf, temporary_folders
from hapticlink.orchestrator.fmi.description import PLATFORMS, Description, describe

MAX_UNPACKED = 32
"""Number of FMUs that are kept from one run to the next."""
File = tuple[Path, int, int]
"""A path with time of change (ns) and size of what is there."""


@dataclass(frozen=True)
class Idle:
    """An instance that nobody uses: its slave of FMPy, and the key of its messages."""

    slave: Any
    key: int


_unpacked: dict[File, str] = {}
"""The folders in which FMUs of this project are unpacked, the newest last."""
_instances: Counter[str] = Counter()
"""By folder: how many instances are open in it."""
_reset: dict[tuple[str, str], Idle] = {}
"""By folder and name: an instance that was reset after a run without a fault."""
_lock = Lock()


def describe_once(path: Path, interface: str | None = None) -> Description:
    """The description of an FMU by an interface, read once as long as the file does not change.
    Raises InputFault as `describe` does."""
    try:
        file = file_at(path)
    except OSError:
        return describe(path, interface=interface)  # which raises an InputFault with the reason
    return _describe(file, interface)


@lru_cache(MAX_UNPACKED)
def _describe(file: File, interface: str | None) -> Description:
    return describe(file[0], interface=interface)


def file_at(path: Path) -> File:
    """The file that is at a path now. Raises OSError where there is none."""
    stat = path.stat()
    return path, stat.st_mtime_ns, stat.st_size


@contextmanager
def keep_unpacked() -> Iterator[None]:
    """Until the last of the contexts that are open at the same time ends, in any thread, FMUs of
    this project stay unpacked until `trim` drops them, and native ones instantiated."""
    try:
        with shelf.keep():
            yield
    finally:
        trim(MAX_UNPACKED if shelf.is_keeping() else 0)


def unpack(description: Description, folder: str) -> str:
    """The folder in which an FMU is unpacked: `folder`, which is empty, a new one if that is "", or
    that of one of this project that is unpacked already.

    So all its instances have one library: of each its own the code of 64 would fill the caches.
    FMUs of others have a folder and a library each. What they keep in static variables would be
    common to their instances, in silence, and that they may be instantiated several times in a
    process (`canBeInstantiatedOnlyOncePerProcess`) is what they say where they say nothing.
    """
    own = description.block is not None
    if folder or not own:
        return _extract(description.path, folder, own)
    with _lock:
        file = file_at(description.path)
        _unpacked[file] = _unpacked.pop(file, "") or _extract(description.path, "", own)
        _instances[_unpacked[file]] += 1
        return _unpacked[file]


def _extract(path: Path, folder: str, own: bool) -> str:
    folder = folder or temporary_folders.make_folder()
    try:
        with name_in_errors(folder):
            extract(path, folder, _is_needed if own else None)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _is_needed(entry: str) -> bool:
    """Whether a run needs an entry of an FMU of this project: no binary of another platform, which
    is a third of a Python FMU, and no pythonfmu where one is imported, which Python takes in the
    place of any other."""
    if entry.startswith("resources/pythonfmu/") and "pythonfmu" in sys.modules:
        return False
    here = (f"binaries/{platform}/" for platform in PLATFORMS.values())
    return entry.startswith(("modelDescription.xml", "resources/", *here))


def keep_instance(folder: str, name: str, slave: Any, key: int) -> bool:
    """Keep an instance as it is after fmi2Reset, for the next of that name; False where none are
    kept."""
    with _lock:
        if not shelf.is_keeping() or (folder, name) in _reset:
            return False
        _reset[folder, name] = Idle(slave, key)
        return True


def take_instance(folder: str, name: str) -> Idle | None:
    """An instance that was kept, which is the caller's from now on."""
    with _lock:
        return _reset.pop((folder, name), None) if shelf.is_keeping() else None


def count_instances() -> int:
    """The instances of FMUs of this project that there are in this process, in use or kept."""
    return sum(_instances.values()) + len(_reset)


def _remove(file: File) -> None:
    """Removes an unpacked FMU in which no instance is in use."""
    folder = _unpacked.pop(file)
    _instances.pop(folder, None)
    for place in [place for place in _reset if place[0] == folder]:
        _reset.pop(place).slave.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)


def leave(folder: str) -> bool:
    """One instance of those in a folder is closed; it is removed with the last one, unless it is
    kept. Returns whether others are open."""
    with _lock:
        file = next((f for f, unpacked in _unpacked.items() if unpacked == folder), None)
        if file is None:
            shutil.rmtree(folder, ignore_errors=True)
            return False
        _instances[folder] -= 1
        if not _instances[folder] and not shelf.is_keeping():
            _remove(file)
        return _instances[folder] > 0


def trim(most: int = MAX_UNPACKED) -> None:
    """Removes the folders that were used longest ago and in which no FMU is open, so that `most`
    are left."""
    with _lock:
        closed = [file for file, folder in _unpacked.items() if not _instances[folder]]
        for file in closed[: max(len(_unpacked) - most, 0)]:
            _remove(file)
