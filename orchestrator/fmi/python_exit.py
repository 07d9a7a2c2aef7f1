"""Releases the interpreter of Python FMUs before the destructors of their libraries run.

pythonfmu 0.7 and pythonfmu3 0.3 destroy the static that holds the interpreter and then, in the
library's destructor, drop it once more: memory is corrupted as the process ends. Dropped while
Python still runs, by the function that they export for it, it is null by then.
"""

from __future__ import annotations

import atexit
import ctypes
import os

_kept: dict[int, ctypes.CDLL] = {}
"""By handle: a reference of our own, so that FMPy's unloading leaves the library in its place."""


def release_at_exit(loaded: ctypes.CDLL) -> None:
    """Release the interpreter of a library that FMPy has loaded when this process ends, once;
    libraries without an interpreter are left alone."""
    if os.name != "posix" or not hasattr(loaded, "finalizePythonInterpreter"):
        return
    library = ctypes.CDLL(loaded._name, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
    if library._handle not in _kept:
        _kept[library._handle] = library
        atexit.register(library.finalizePythonInterpreter)
