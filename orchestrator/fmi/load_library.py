"""Loads the library of an FMU as FMPy does, without a change of the current directory: all threads
share that, and one of them could be left in a folder that is removed."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from fmpy import sharedLibraryExtension

from hapticlink.orchestrator.fmi import python_libraries
from hapticlink.orchestrator.fmi.description import PLATFORMS
from hapticlink.orchestrator.fmi.status import require_success


def load_slave(kind: Any, fmi: str, guid: str, identifier: str, folder: str, name: str) -> Any:
    """An instance of FMPy's class `kind` for the FMU of that guid and model identifier, unpacked in
    `folder`; `name` is that of the instance. Raises OSError where the library cannot be loaded, and
    AttributeError where it lacks a function of FMI."""
    slave = kind.__new__(kind)
    slave.guid, slave.modelIdentifier, slave.instanceName = guid, identifier, name
    slave.unzipDirectory, slave.requireFunctions, slave.fmiCallLogger = folder, True, None
    slave.component = slave.callbacks = None
    slave._functions = {}
    library = Path(folder, "binaries", PLATFORMS[fmi], f"{identifier}{sharedLibraryExtension}")
    slave.dll = ctypes.CDLL(
        str(python_libraries.find_shared_library(Path(folder), library) or library)
    )
    for function, declared in _declared(kind).items():
        slave._functions[function] = called = getattr(slave.dll, function)
        called.argnames, called.argtypes, called.restype = declared
    require_success(slave)
    return slave


@cache
def _declared(kind: Any) -> dict[str, tuple[Any, Any, Any]]:
    """The names and types of the arguments of each FMI function of FMPy's class `kind`, and the
    type of its result, which FMPy reads from the signatures of its methods for each library."""
    recording = kind.__new__(kind)
    recording.modelIdentifier, recording.dll, recording._functions = "", _Recorded(), {}
    recording._loadFunctions()
    return {
        name: (called.argnames, called.argtypes, called.restype)
        for name, called in recording._functions.items()
    }


class _Recorded:
    """A library that has every function, and keeps what is declared of it."""

    def __getattr__(self, name: str) -> SimpleNamespace:
        return SimpleNamespace()
