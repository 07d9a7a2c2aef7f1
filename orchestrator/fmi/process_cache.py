"""What a process that runs many scenes keeps of their FMUs: descriptions, and those of this project
unpacked. Files of others are unpacked for each run, which may write beside its resources."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from fmpy import extract, platform

from hapticlink.orchestrator.fmi.description import Description, describe

MAX_UNPACKED = 32
"""Number of FMUs that are kept from one run to the next."""
File = tuple[Path, int, int]
"""A path with time of change (ns) and size of what is there."""

_folders: dict[File, str] | None = None


def described(path: Path) -> Description:
    """The description of an FMU, read once as long as the file does not change. Raises InputFault
    as `describe` does."""
    try:
        file = _file(path)
    except OSError:
        return describe(path)  # which raises an InputFault with the reason
    return _described(file)


@lru_cache(MAX_UNPACKED)
def _described(file: File) -> Description:
    return describe(file[0])


def _file(path: Path) -> File:
    stat = path.stat()
    return path, stat.st_mtime_ns, stat.st_size


@contextmanager
def unpacked_once() -> Iterator[None]:
    """Within the context, FMUs of this project stay unpacked until `trim` drops them."""
    global _folders
    _folders = {}
    try:
        yield
    finally:
        trim(0)
        _folders = None


def unpack(description: Description, folder: str) -> str:
    """Unpacks an FMU into `folder`, which is empty; or removes that, and returns the folder in
    which it is unpacked already."""
    if description.block is None:
        extract(description.path, folder)
        return folder
    if _folders is None:
        extract(description.path, folder, _is_needed)
        return folder
    file = _file(description.path)
    unpacked = _folders.pop(file, None)
    if unpacked is None:
        extract(description.path, folder, _is_needed)
        unpacked = folder
    else:
        os.rmdir(folder)
    _folders[file] = unpacked  # the newest
    return unpacked


def _is_needed(entry: str) -> bool:
    """Whether a run needs an entry of an FMU of this project: no binary of another platform, which
    is a third of a Python FMU."""
    return entry.startswith(("modelDescription.xml", "resources/", f"binaries/{platform}/"))


def leave(folder: str) -> None:
    """Removes the folder of an FMU that is closed, unless it is kept."""
    if _folders is None or folder not in _folders.values():
        shutil.rmtree(folder, ignore_errors=True)


def trim(most: int = MAX_UNPACKED) -> None:
    """Removes the folders that were used longest ago, so that `most` are left. No FMU may be open
    in them."""
    for file in list(_folders or ())[: max(len(_folders or ()) - most, 0)]:
        assert _folders is not None
        shutil.rmtree(_folders.pop(file), ignore_errors=True)
