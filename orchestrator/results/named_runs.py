"""Several runs by the names that tell their folders apart."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.tables import Results, load


def named(folders: Sequence[Path | str]) -> dict[str, Results]:
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
