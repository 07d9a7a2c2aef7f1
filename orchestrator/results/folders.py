"""The output folder of a command."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.files import write_json


def ensure(folder: Path | str, option: str = "--out") -> Path:
    """The folder, created if it does not exist. Raises InputFault if it cannot be created or
    written to; `option` is what has named it."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        why = "is a file"
    except (OSError, ValueError) as error:  # the latter of a name with a null character
        why = f"cannot be created ({getattr(error, 'strerror', None) or error})"
    else:
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
        why = "may not be written to"
    raise InputFault(f"{option} {folder}: {why}; name a folder that can be written to")


def add(
    folder: Path, names: Iterable[str], more: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, Any]:
    """Adds files of a run to the list in its run.json, and `more` keys; returns the new content."""
    run: dict[str, Any] = text_files.read_json(folder / "run.json")
    run["files"] = list(dict.fromkeys([*run["files"], *names]))
    run |= more
    write_json(folder / "run.json", run)
    return run
