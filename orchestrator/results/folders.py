"""The folder that a command writes to."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.results.files import write_json


def made(folder: Path | str) -> Path:
    """The folder, made where there is none. Raises InputFault where it cannot be written to."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        why = "is a file"
    except OSError as error:
        why = f"cannot be made ({error.strerror})"
    else:
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
        why = "may not be written to"
    raise InputFault(f"--out {folder}: {why}; name a folder that can be written to")


def add(folder: Path, names: Iterable[str]) -> dict[str, Any]:
    """List more files of a run in its run.json, and give that."""
    run: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    run["files"] = list(dict.fromkeys([*run["files"], *names]))
    write_json(folder / "run.json", run)
    return run
