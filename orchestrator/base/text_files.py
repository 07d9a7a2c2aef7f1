"""Text files from anywhere, read whole: only what is a file, and of bounded size."""

from __future__ import annotations

import os
from pathlib import Path

from hapticlink.orchestrator.base.errors import InputFault


def exists(path: str | Path) -> bool:
    """Whether `path` is a file; a name that no file can have is none."""
    return os.path.isfile(path)  # Path.is_file raises for one that is too long


def read(path: Path, what: str, most: int, encoding: str = "utf-8") -> str:
    """The text of a file that is `what` ("a scene"), of at most `most` bytes. Raises InputFault: a
    device or a pipe may have no end."""
    why = f"{path}: cannot be read as {what}"
    if not exists(path):
        raise InputFault(f"{why}: it is no file")
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise InputFault(f"{why}: it has more than {most} bytes")
        return content.decode(encoding)
    except (OSError, UnicodeDecodeError) as error:
        raise InputFault(f"{why}: {error}") from error
