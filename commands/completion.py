"""What the shell offers where TAB is pressed: names of scenes, and keys of a scene.

`hapticlink --install-completion` writes the script for bash, zsh, fish or PowerShell, which asks
these functions; they import what they need when they are called.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
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
    from hapticlink.commands.json_schema import json_schema
    from hapticlink.orchestrator.plan.schemes import SCHEMES as SCHEMES  # a scene names them too

    schema = json_schema()
    return [f"{key}=" for key in dict.fromkeys(_leaves(schema, schema["$defs"], ""))]


def _leaves(node: dict[str, Any], defined: dict[str, Any], prefix: str) -> Iterator[str]:
    """Dotted keys of an object of a JSON schema; arrays and tables of free keys are leaves."""
    if "$ref" in node:
        node = defined[node["$ref"].rsplit("/", 1)[1]]
    if inner := node.get("properties"):
        for name, each in inner.items():
            yield from _leaves(each, defined, f"{prefix}.{name}" if prefix else name)
    elif choices := node.get("anyOf") or node.get("oneOf"):
        for choice in choices:
            yield from _leaves(choice, defined, prefix)
    else:
        yield prefix
