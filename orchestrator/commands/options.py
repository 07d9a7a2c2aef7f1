"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Scene = Annotated[str, Parameter(help="Name of a shipped scene, or path of a scene file or SSP.")]
Set = Annotated[
    list[str] | None,
    Parameter(
        name="--set",
        consume_multiple=False,
        negative="",
        help="key=value, a dotted key of the scene file; repeatable.",
    ),
]
Out = Annotated[Path | None, Parameter(help="Folder to write to.")]


def default_folder(root: str, scene: str) -> Path:
    """`runs/<scene>` for a name or a path."""
    known = scene.endswith((".toml", ".ssp"))
    return Path(root) / (Path(scene).stem if known else Path(scene).name)
