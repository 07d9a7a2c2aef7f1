"""The version of the code that finished rows belong to; rows of another one are measured again."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

import benchmarks
import hapticlink.components
import hapticlink.fmus.native
from hapticlink.fmus.cache import sources

PACKAGES = (
    "hapticlink", "casadi", "ziglang", "numpy", "scipy", "mujoco", "pin", "exudyn", "fmpy",
    "pythonfmu", "libcosimpy", "ecospy",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Of the packages that take part, those that are installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def begin(out: Path, rows: tuple[str, ...], *further: ModuleType) -> None:
    """Keep the files `rows` in `out` only if they were made by these sources, those of the packages
    `further` among them, and versions."""
    path = out / "state.json"
    made_by = sources(hapticlink.components, hapticlink.fmus.native, benchmarks, *further)
    now = {"sources": made_by, "versions": versions()}
    if not path.exists() or json.loads(path.read_text()) != now:
        for name in rows:
            (out / name).unlink(missing_ok=True)
        out.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(now, indent=1) + "\n")
