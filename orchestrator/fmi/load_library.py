"""Loads the library of an FMU as FMPy does, without a change of the current directory: all threads
share that, and one of them could be left in a folder that is removed."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

from fmpy import platform, platform_tuple, sharedLibraryExtension

from hapticlink.orchestrator.fmi import python_libraries
from hapticlink.orchestrator.fmi.status import require_success

PLATFORMS = {"2": platform, "3": platform_tuple}
"""The folder of this platform in binaries/, by FMI version."""


def loaded(kind: Any, fmi: str, guid: str, identifier: str, folder: str, name: str) -> Any:
    """An instance of FMPy's class `kind` for the FMU of that guid and model identifier, unpacked in
    `folder`; `name` is that of the instance. Raises OSError where the library cannot be loaded, and
    AttributeError where it lacks a function of FMI."""
    slave = kind.__new__(kind)
    slave.guid, slave.modelIdentifier, slave.instanceName = guid, identifier, name
    slave.unzipDirectory, slave.requireFunctions, slave.fmiCallLogger = folder, True, None
    slave.component = slave.callbacks = None
    slave._functions = {}
    library = Path(folder, "binaries", PLATFORMS[fmi], f"{identifier}{sharedLibraryExtension}")
    slave.dll = ctypes.CDLL(str(python_libraries.shared(Path(folder), library) or library))
    slave._loadFunctions()
    require_success(slave)
    return slave
