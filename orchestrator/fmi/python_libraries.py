"""What the libraries of pythonfmu 0.7 and pythonfmu3 0.3 need, so as not to crash the process.

They destroy the static that holds the interpreter and then, in the library's destructor, drop it
once more: memory is corrupted as the process ends. Dropped while Python still runs, by the function
that they export for it, it is null by then. An FMU without its Python module crashes them at once.
"""

from __future__ import annotations

import atexit
import ctypes
import os
from contextlib import suppress
from pathlib import Path

_kept: dict[int, ctypes.CDLL] = {}
"""By handle: a reference of our own, so that FMPy's unloading leaves the library in its place."""


def prepare(loaded: ctypes.CDLL, folder: str) -> bool:
    """Whether a library that FMPy has loaded from an FMU's `folder` holds a Python interpreter,
    which is then released when this process ends. Raises ValueError where such a library would find
    no module."""
    if not hasattr(loaded, "finalizePythonInterpreter"):
        return False
    if os.name == "posix":
        library = ctypes.CDLL(loaded._name, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
        if library._handle not in _kept:
            _kept[library._handle] = library
            atexit.register(library.finalizePythonInterpreter)
    resources = Path(folder, "resources")
    with suppress(OSError, ValueError):
        name = (resources / "slavemodule.txt").read_text(encoding="utf-8").strip()
        if (resources / f"{name}.py").is_file():
            return True
    raise ValueError("resources/slavemodule.txt names no module beside it; build the FMU again")
