"""The Python module of an FMU made by pythonfmu or pythonfmu3, whose libraries crash the process
where it is missing (pythonfmu 0.7, pythonfmu3 0.3)."""

from __future__ import annotations

import ctypes
from contextlib import suppress
from pathlib import Path


def require_slave_module(loaded: ctypes.CDLL, folder: str) -> None:
    """Raises ValueError where a library that holds a Python interpreter finds no module in the
    FMU's `folder`."""
    if not hasattr(loaded, "finalizePythonInterpreter"):
        return
    resources = Path(folder, "resources")
    with suppress(OSError, ValueError):
        name = (resources / "slavemodule.txt").read_text(encoding="utf-8").strip()
        if (resources / f"{name}.py").is_file():
            return
    raise ValueError("resources/slavemodule.txt names no module beside it; build the FMU again")
