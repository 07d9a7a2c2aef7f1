"""Folders of results: the one that a command writes to, and several by the names that tell them
apart."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.read_results import Results, load
from hapticlink.orchestrator.results.write_files import write_json


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


def load_by_name(folders: Sequence[Path | str]) -> dict[str, Results]:
    """The runs of folders by the names that tell those apart. Raises InputFault as `load`, and for
    a folder that is named twice."""
    return dict(zip(names(folders), map(load, folders), strict=True))


def names(folders: Sequence[Path | str]) -> list[str]:
    """What tells folders apart: their last part, or all parts behind what they have in common.
    Raises InputFault for one that is named twice."""
    paths = [Path(folder).resolve() for folder in folders]
    if twice := next((f for i, f in enumerate(folders) if paths[i] in paths[:i]), None):
        raise InputFault(f"{twice}: is named twice")
    if len({path.name for path in paths}) == len(paths):
        return [path.name for path in paths]
    common = os.path.commonpath(paths)
    return [path.relative_to(common).as_posix() for path in paths]
