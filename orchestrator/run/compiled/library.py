"""Finds the compiled loop: built with the package, or compiled at its first use and cached."""

from __future__ import annotations

import ctypes
import os
import platform
import subprocess
from functools import cache
from pathlib import Path

from hapticlink.fmus import cache as fmu_cache
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.run.compiled import build


@cache
def load() -> ctypes.CDLL:
    """The library. Raises Fault, with the remedy, where it can neither be found nor be compiled, or
    does not load."""
    if os.environ.get("HAPTICLINK_LOOP") == "python":
        raise Fault("HAPTICLINK_LOOP=python: there is no event loop in Python any more: unset it")
    built = build.HERE / build.name()
    path = built if built.exists() else _compiled()
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise _unavailable(f"{path} does not load: {error}") from error
    pointer, integer, number = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    for name, arguments in {
        "events": (pointer, pointer),
        "lanes": (pointer,),
        "block": (pointer, pointer, integer),
        "push": (pointer, pointer, integer, integer),
        "value": (pointer, pointer, integer, number, pointer),
        "change_rate": (pointer, pointer),
        "change_hold": (pointer, integer, pointer, integer),
        "credit": (pointer, pointer),
        "meter_start": (pointer, pointer),
        "meter_room": (pointer, integer),
        "energy": (pointer, pointer),
        "check_due": (pointer, pointer),
        "check": (pointer, pointer, pointer, number, number, ctypes.c_int),
        "watch": (ctypes.c_int,),
        "guard": (ctypes.c_int,),
        "now": (),
        "wait": (integer,),
        "python": (pointer,) * 3,
    }.items():
        function = library[f"hapticlink_{name}"]
        function.argtypes = arguments
        setattr(library, name, function)
    library.now.restype, library.credit.restype = integer, number
    api = ctypes.pythonapi
    calls = (api.PyGILState_Ensure, api.PyErr_Occurred, api.PyGILState_Release)
    library.python(*(ctypes.cast(call, pointer) for call in calls))
    return library


def _compiled() -> Path:
    root = fmu_cache.folder()
    if root is None:
        raise _unavailable("it is not built, and there is no cache folder to compile it to")
    library = root / build.name()
    if library.exists():
        return library
    why = "it is not built, and there is no C compiler"
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
    raise _unavailable(why)


def _unavailable(why: str) -> Fault:
    machine = f"{platform.system()} on {platform.machine()}"
    return Fault(
        f"the event loop, a library of C, is not there for {machine}: {why}; take a wheel for "
        f"this machine, or a C compiler: {install_command('native')}"
    )
