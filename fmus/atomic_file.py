"""A file that is there whole or not at all, whoever reads it and whenever the writer dies."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_file(target: Path) -> Iterator[Path]:
    """Within, the path of an unfinished file beside `target`, with the same suffix, to be written;
    at the end it is renamed to `target`, or removed where something was raised."""
    unfinished = target.with_name(f".{target.stem}.{uuid.uuid4().hex}{target.suffix}")
    try:
        yield unfinished
        os.replace(unfinished, target)
    finally:
        unfinished.unlink(missing_ok=True)
