"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene import overrides

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
Swap = Annotated[
    list[str] | None,
    Parameter(
        name="--swap",
        consume_multiple=False,
        negative="",
        help="block=file.fmu, an FMU that replaces a block of the haptic loop; repeatable.",
    ),
]
Out = Annotated[Path | None, Parameter(help="Folder to write to.")]


def options(set: Iterable[str] | None, swap: Iterable[str] | None) -> tuple[str, ...]:
    """The options of a scene: those of --set, and an [[fmu]] with `replaces` for each --swap.

    Raises InputFault for a swap that is not block=file.
    """
    return (*(set or ()), *map(_swap, swap or ()))


def _swap(given: str) -> str:
    block, equals, file = given.partition("=")
    if not (block and equals and file):
        raise InputFault(f"--swap {given}: write block=file.fmu, e.g. --swap controller=my.fmu")
    return (
        f"fmu.+={overrides.text({'replaces': block, 'path': str(Path(file).resolve())}, '--swap')}"
    )


def default_folder(root: str, scene: str) -> Path:
    """The default output folder, `<root>/<scene>`, for a scene's name or path."""
    known = scene.endswith((".toml", ".ssp"))
    return Path(root) / (Path(scene).stem if known else Path(scene).name)
