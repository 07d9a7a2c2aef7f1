"""Haptic rendering of linkages: FMUs, co-simulated at separate rates.

    import hapticlink as hl

    r = hl.run("closed-loop", {"graphics.rate": 10})
    r["virtual_mechanism.x"], r.time("virtual_mechanism.x")

Scenes: `shipped`, `scene`, `explain`. Runs: `run`, `RealTime`, `sweep`, `load`, `compare`, `view`.
Files: `build`, `export`. Before a hand is on the device: `fit`, `stability`, `tune`.
Raised: `InputFault` for bad input, with all findings of a scene `SceneFault`; each is a `Fault`.
"""

# In a checkout this file is `package_root/__init__.py`; installed, it is the package's own. The
# names are listed once, with where they are, in `__init__.pyi`, which type checkers read.

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_MODULES = {
    name.name: str(line.module)
    for line in _STUB.body
    if isinstance(line, ast.ImportFrom)
    for name in line.names
}
"""By public name, the module that defines it."""
_GONE = {
    "export_results": 'a table writes itself: r.frame("haptics").to_parquet("haptics.parquet")',
}
"""Names of earlier versions, with what does their work now."""
__all__ = sorted([*_MODULES, "__version__"])


def __getattr__(name: str) -> Any:
    """Loads what is behind a name when it is first used: `hapticlink --help` needs none."""
    if name == "__version__":
        from importlib.metadata import version

        return version("hapticlink")
    if name not in _MODULES:
        remedy = f" any more: {_GONE[name]}" if name in _GONE else ""
        raise AttributeError(f"module 'hapticlink' has no attribute {name!r}{remedy}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return __all__
