"""Finds the compiled loop: built with the package, or compiled at its first use and cached."""

from __future__ import annotations

import ctypes
import os
import subprocess
from functools import cache
from pathlib import Path

from hapticlink.fmus import cache as fmu_cache
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.run.compiled import build

CHOICE = "HAPTICLINK_LOOP"
"""Environment variable: with the value "python" no compiled loop is used."""


class Unavailable(Exception):
    """There is no compiled loop here; the text says why."""


def load() -> ctypes.CDLL:
    """The library. Raises Unavailable where it is switched off, or can neither be found nor be
    compiled."""
    if os.environ.get(CHOICE) == "python":
        raise Unavailable(f"{CHOICE}=python")
    return loaded()


@cache
def loaded() -> ctypes.CDLL:
    """The library, whatever CHOICE says. Raises Unavailable where it can neither be found nor
    be compiled."""
    built = build.HERE / build.name()
    library = ctypes.CDLL(str(built if built.exists() else _compiled()))
    pointer, integer, number = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    for name, arguments in {
        "events": (pointer, pointer),
        "block": (pointer, pointer, integer),
        "push": (pointer, pointer, integer, integer),
        "value": (pointer, pointer, integer, number, pointer),
        "change_rate": (pointer, pointer),
        "change_hold": (pointer, integer, pointer, integer),
        "watch": (ctypes.c_int,),
        "guard": (ctypes.c_int,),
        "now": (),
        "wait": (integer,),
        "python": (pointer,) * 3,
    }.items():
        function = library[f"hapticlink_{name}"]
        function.argtypes = arguments
        setattr(library, name, function)
    library.now.restype = integer
    api = ctypes.pythonapi
    calls = (api.PyGILState_Ensure, api.PyErr_Occurred, api.PyGILState_Release)
    library.python(*(ctypes.cast(call, pointer) for call in calls))
    return library


def _compiled() -> Path:
    root = fmu_cache.folder()
    if root is None:
        raise Unavailable("it is not built, and there is no cache folder to compile it to")
    library = root / build.name()
    if library.exists():
        return library
    why = f"it is not built, and there is no C compiler: {install_command('native')}"
    for compiler in build.compilers():
        try:
            fmu_cache.private(root)
            build.compile_loop(library, compiler)
        except subprocess.CalledProcessError as error:
            said = error.stderr.decode(errors="replace")
            why = f"{compiler.command[0]} could not compile it: {said}"
        except OSError as error:
            why = f"it could not be compiled: {error}"
        else:
            return library
    raise Unavailable(why)
