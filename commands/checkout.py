"""The studies and benchmarks of a checkout, which are not part of the installed package."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault

COMPARED = {".py", ".toml", ".c", ".cpp", ".h"}
"""Endings of the files in which an installed package and a checkout have to be equal."""


def folder(command: str) -> Path:
    """The checkout, from which `benchmarks` and `studies` can be imported after the call: the one
    that is installed as editable, or the current folder. Raises InputFault if there is none, and
    if another state of the current folder is installed."""
    import hapticlink.components

    package = Path(next(iter(hapticlink.components.__path__))).resolve().parent
    root = next((p for p in (package, Path.cwd()) if (p / "benchmarks/__init__.py").exists()), None)
    if root is None:
        raise InputFault(
            f"`hapticlink {command}` needs a checkout of the project, whose benchmarks and studies "
            "are not in the installed package: change to its folder"
        )
    if root != package and (other := _differs(package, root)):
        raise InputFault(
            f"`hapticlink {command}`: another state of this checkout is installed ({other} "
            "differs): `pip install .` here first"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return root


def _differs(package: Path, root: Path) -> Path | None:
    """The first file of an installed package that the checkout has not, or otherwise."""
    for path in sorted(p for p in package.rglob("*") if p.suffix in COMPARED):
        inside = path.relative_to(package)
        source = root / inside if len(inside.parts) > 1 else root / "package_root" / inside
        if not source.exists() or source.read_bytes() != path.read_bytes():
            return inside
    return None


def function(command: str, name: str) -> Any:
    """A function `module:name` of the checkout. Raises InputFault as `folder`."""
    folder(command)
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
