"""Writes a file atomically: readers see it complete or not at all, even if the writer dies."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_unfinished: set[Path] = set()


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Gives the path of an unfinished file beside `target`, with the same suffix. At the end of the
    context it is renamed to `target`, or removed if an exception was raised."""
    unfinished = target.with_name(f".{target.stem}.{uuid.uuid4().hex}{target.suffix}")
    _unfinished.add(unfinished)
    try:
        yield unfinished
        os.replace(unfinished, target)
    finally:
        unfinished.unlink(missing_ok=True)
        _unfinished.discard(unfinished)


def remove_unfinished() -> None:
    """Removes the unfinished files of a process that is about to end within such contexts."""
    for path in tuple(_unfinished):
        path.unlink(missing_ok=True)
