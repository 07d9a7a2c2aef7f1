"""Writes a file atomically: readers see it complete or not at all, even if the writer dies."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_unfinished: set[Path] = set()


@contextmanager
def name_in_errors(path: Path | str) -> Iterator[None]:
    """OSErrors within the context that name no file, as of a full disk, name this one."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = str(path)
        raise


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Gives the path of an unfinished file beside `target`, with the same suffix. At the end of the
    context it is renamed to `target`, or removed if an exception was raised."""
    own = f"{os.getpid()}.{uuid.uuid4().hex}"  # of a killed process: `clear_unfinished`
    unfinished = target.with_name(f".{target.stem}.{own}{target.suffix}")
    _unfinished.add(unfinished)
    try:
        with name_in_errors(target):
            yield unfinished
            os.replace(unfinished, target)
    except OSError as error:
        if error.filename == str(unfinished):  # which nobody knows
            error.filename, error.filename2 = str(target), None
        raise
    finally:
        unfinished.unlink(missing_ok=True)
        _unfinished.discard(unfinished)


def remove_unfinished() -> None:
    """Removes the unfinished files of a process that is about to end within such contexts."""
    for path in tuple(_unfinished):
        path.unlink(missing_ok=True)
