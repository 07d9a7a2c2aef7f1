"""Writes a file atomically: readers see it complete or not at all, even if the writer dies."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Gives the path of an unfinished file beside `target`, with the same suffix. At the end of the
    context it is renamed to `target`, or removed if an exception was raised."""
    unfinished = target.with_name(f".{target.stem}.{uuid.uuid4().hex}{target.suffix}")
    try:
        yield unfinished
        os.replace(unfinished, target)
    finally:
        unfinished.unlink(missing_ok=True)
