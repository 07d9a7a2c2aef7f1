"""JSON files of results, which somebody may have changed: only regular files of bounded size."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault

MAX_BYTES = 1 << 28
"""A run.json names its outputs, of which there are a million at most."""


def read(path: Path, what: str = "run.json") -> Any:
    """The content of `path`. Raises InputFault for what is no file, too large, or no JSON."""
    text = text_files.read(path, what, MAX_BYTES)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:  # the latter of 100,000 brackets
        raise InputFault(f"{path}: cannot be read as {what}: {error}") from error
