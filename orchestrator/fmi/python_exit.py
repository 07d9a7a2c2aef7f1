"""Libraries of Python FMUs let go of their interpreter before their own destructors run.

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
    """Have a library that FMPy has loaded let go at the end of this process, once; nothing to do
    for one that holds no interpreter."""
    if os.name != "posix" or not hasattr(loaded, "finalizePythonInterpreter"):
        return
    library = ctypes.CDLL(loaded._name, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
    if library._handle not in _kept:
        _kept[library._handle] = library
        atexit.register(library.finalizePythonInterpreter)
