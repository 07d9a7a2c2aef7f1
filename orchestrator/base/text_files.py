"""Text files from anywhere, and JSON files of results, which somebody may have changed, read whole:
only what is a file, and of bounded size."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault

LARGEST_JSON = 1 << 28
"""Bytes: a run.json names its outputs, of which there are a million at most."""


def exists(path: str | Path) -> bool:
    """Whether `path` is a file; a name that no file can have is none."""
    return os.path.isfile(path)  # Path.is_file raises for one that is too long


def read_text(path: Path, what: str, most: int, encoding: str = "utf-8") -> str:
    """The text of a file that is `what` ("a scene"), of at most `most` bytes. Raises InputFault: a
    device or a pipe may have no end."""
    why = f"{path}: cannot be read as {what}"
    if not exists(path):
        raise InputFault(f"{why}: not a regular file")
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise InputFault(f"{why}: it has more than {most} bytes")
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise InputFault(f"{why}: it is not UTF-8 ({error.reason}); save it as UTF-8") from error
    except OSError as error:
        raise InputFault(f"{why}: {error}") from error


def read_json(path: Path, what: str = "run.json") -> Any:
    """The content of `path`. Raises InputFault for what is not a regular file, too large, or no
    JSON."""
    text = read_text(path, what, LARGEST_JSON)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:  # the latter of 100,000 brackets
        raise InputFault(f"{path}: cannot be read as {what}: {error}") from error
