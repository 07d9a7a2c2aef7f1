"""The studies and benchmarks of a checkout, which are not part of the installed package."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault


def folder(command: str) -> Path:
    """The checkout, from which `benchmarks` and `studies` can be imported after the call. Raises
    InputFault if only the package is installed."""
    import hapticlink.components

    root = Path(next(iter(hapticlink.components.__path__))).resolve().parent
    if not (root / "benchmarks" / "__init__.py").exists():
        raise InputFault(
            f"`hapticlink {command}`: benchmarks and studies are not in the installed package; "
            "clone the project and install it with `pip install -e .[peers]`"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return root


def function(command: str, name: str) -> Any:
    """A function `module:name` of the checkout. Raises InputFault as `folder`."""
    folder(command)
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
