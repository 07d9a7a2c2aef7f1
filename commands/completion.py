"""What the shell offers where TAB is pressed: names of scenes, and keys of a scene.

`hapticlink --install-completion` writes the script for bash, zsh, fish or PowerShell, which asks
these functions; they import what they need when they are called.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cyclopts.completion._engine import CompletionContext


def scenes(context: CompletionContext | None = None) -> dict[str, str]:
    """Shipped scenes with their titles, and the scene files and SSPs of this folder."""
    import hapticlink as hl

    written = [p for p in Path().glob("*.toml") if p.name != "pyproject.toml"]
    files = sorted(p.name for p in [*written, *Path().glob("*.ssp")])
    return {**dict.fromkeys(files, ""), **hl.shipped()}


def keys(context: CompletionContext | None = None) -> list[str]:
    """Dotted keys of a scene, each followed by `=`."""
    from hapticlink.orchestrator.plan.schemes import SCHEMES as SCHEMES  # a scene names them too
    from hapticlink.orchestrator.scene.scene import Scene

    return [f"{key}=" for key in dict.fromkeys(_leaves(Scene, ""))]


def _leaves(record: Any, prefix: str) -> Iterator[str]:
    """Dotted keys of a record; arrays and tables of free keys are leaves."""
    from hapticlink.orchestrator.scene import types_of_keys

    for key, hint in types_of_keys.hints(record).items():
        for kind in types_of_keys.branches(hint):
            if is_dataclass(kind):
                yield from _leaves(kind, f"{prefix}{key}.")
            elif kind is not NoneType:
                yield f"{prefix}{key}"
