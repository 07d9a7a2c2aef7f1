"""Loads the library of an FMU as FMPy does, without a change of the current directory: all threads
share that, and one of them could be left in a folder that is removed.

Those of Python FMUs, of pythonfmu 0.7 and pythonfmu3 0.3, release the Python interpreter twice at
the end of the process, which corrupts memory. The function that they export for it,
`finalizePythonInterpreter`, is therefore called earlier, so that the second release finds a null
pointer. An FMU without its Python module crashes them at once.

Since they must stay loaded until then, FMUs whose libraries have the same bytes share one, under a
path that does not change from run to run: each path of its own would cost 0.3 MB and 8 memory maps
for the rest of the process.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import re
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, wraps
from inspect import getattr_static, isfunction
from numbers import Integral
from pathlib import Path
from traceback import extract_tb
from types import SimpleNamespace
from typing import Any

from fmpy import sharedLibraryExtension

from hapticlink.fmus import cache as fmu_cache
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.plain_folder import require_plain
from hapticlink.orchestrator.base import temporary_folders
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
    slave.dll = ctypes.CDLL(str(find_shared_library(Path(folder), library) or library))
    for function, declared in _declare_arguments(kind).items():
        slave._functions[function] = called = getattr(slave.dll, function)
        called.argnames, called.argtypes, called.restype = declared
    require_success(slave)
    return slave


@cache
def _declare_arguments(kind: Any) -> dict[str, tuple[Any, Any, Any]]:
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


_kept: dict[int, ctypes.CDLL] = {}
"""By handle: a reference of our own, so that FMPy's unloading leaves the library in its place."""


CALLED = re.compile(
    r"do_step|terminate|setup_experiment|(enter|exit)_\w+_mode"
    r"|([gs]et)_(real|integer|boolean|string|float\d+|u?int\d+)"
)
"""The methods of a slave that a library calls."""
INTEGERS = re.compile(r"get_(u?)int(eger|\d+)")
"""Those whose numbers it cuts to so many bits, 32 of an Integer, without a word."""


def is_python(loaded: ctypes.CDLL) -> bool:
    """Whether a library is that of a Python FMU."""
    return hasattr(loaded, "finalizePythonInterpreter")


def prepare(loaded: ctypes.CDLL, folder: str) -> str:
    """The Python module of an FMU whose library, loaded from its `folder`, holds an interpreter,
    which is then released when this process ends; "" for other FMUs. Raises ValueError where such a
    library would find no module, FmuError where it would not from this folder."""
    if not is_python(loaded):
        return ""
    if os.name == "posix":
        library = ctypes.CDLL(loaded._name, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
        if library._handle not in _kept:
            _kept[library._handle] = library
            atexit.register(library.finalizePythonInterpreter)
    resources = Path(folder, "resources")
    with suppress(OSError, ValueError):
        name = (resources / "slavemodule.txt").read_text(encoding="utf-8").strip()
        if (resources / f"{name}.py").is_file():
            require_plain(folder)
            return name
    raise ValueError("resources/slavemodule.txt names no module beside it; build the FMU again")


TELLS = "tells_exceptions"
"""The mark of a method that was replaced."""
_told: dict[tuple[str, str], Callable[[bytes], object]] = {}
"""By module and name of an instance, what is told of its exceptions."""


def tell_exceptions(module: str, instance: str, tell: Callable[[bytes], object]) -> None:
    """Have the instance of a Python FMU `tell` at which line of its own files an exception came up,
    of which its library logs the text alone. Instances may share the classes of their module, whose
    methods are replaced once."""
    _told[module, instance] = tell
    scope = vars(sys.modules[module]) if module in sys.modules else {}
    own_files = Path(scope.get("__file__") or "").parent
    for kind in [*scope.values()]:
        own = isinstance(kind, type) and kind.__module__ == module and not kind.__subclasses__()
        for name in filter(CALLED.fullmatch, dir(kind) if own else ()):
            method = getattr_static(kind, name)
            if isfunction(method) and TELLS not in vars(method):
                setattr(kind, name, _telling(method, module, own_files))


def _telling(method: Callable[..., Any], module: str, own_files: Path) -> Callable[..., Any]:
    limits = _find_limits(method.__name__)

    @wraps(method)
    def telling(slave: Any, *arguments: Any, **named: Any) -> Any:
        tell = _told.get((module, getattr(slave, "instance_name", "")), _tell_nobody)
        try:
            result = method(slave, *arguments, **named)
        except Exception as error:
            frames = extract_tb(error.__traceback__)
            last = ([f for f in frames if Path(f.filename).parent == own_files] or frames)[-1]
            where = f"{Path(last.filename).name}, line {last.lineno}, in {last.name}: {last.line}"
            tell(f"{where}: {type(error).__name__}: {error}".encode())
            raise
        if limits and (cut := _find_cut(slave, result, limits, *arguments)):
            tell(cut.encode())
            raise OverflowError(cut)
        return result

    vars(telling)[TELLS] = True
    return telling


def _tell_nobody(text: bytes) -> None:
    """For an instance of which nobody wants to know."""


def _find_limits(method: str) -> range | None:
    """The integers that a library passes on of what a method returns; None of one without."""
    if not (found := INTEGERS.fullmatch(method)):
        return None
    size = 2 ** (32 if found[2] == "eger" else int(found[2]))
    return range(size) if found[1] else range(-size // 2, size // 2)


def _find_cut(slave: Any, result: Any, limits: range, references: Sequence[int]) -> str:
    """Which integer a library would cut, as a message; "" if none. pythonfmu3 itself has cut those
    of 64 bits without a sign, which are therefore asked for."""
    if not isinstance(result, list):
        return ""  # which the library refuses
    if any(isinstance(value, ctypes.c_uint64) for value in result):
        every = (slave.vars[r].getter() for r in references)
        result = [v for each in every for v in (each if isinstance(each, list) else [each])]
    beyond = (i for i, v in enumerate(result) if isinstance(v, Integral) and int(v) not in limits)
    if (wrong := next(beyond, None)) is None:
        return ""
    scalars = len(result) == len(references) and hasattr(slave, "vars")
    name = slave.vars[references[wrong]].name if scalars else "an entry of an array"
    holds = f"its type holds {limits[0]} to {limits[-1]}"
    return f"{name} is {result[wrong]}: {holds}, and the FMU's library would cut it"


def find_shared_library(folder: Path, library: Path) -> Path | None:
    """The path from which to load the `library` of a Python FMU that is unpacked in `folder`: the
    same one for all libraries of the same bytes. None for other FMUs, and for a library that other
    files lie beside, which it may need."""
    if not (folder / "resources" / "slavemodule.txt").exists():
        return None
    if [*library.parent.iterdir()] != [library]:
        return None
    content = library.read_bytes()
    return _store(content, hashlib.sha256(content).hexdigest())


def _store(content: bytes, digest: str) -> Path:
    name = f"{digest}{sharedLibraryExtension}"
    path = _libraries(fmu_cache.folder()) / name
    with suppress(OSError):
        if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == digest:
            return path
    try:
        _write(path, content)
    except OSError:  # the cache is full, say
        path = _libraries(None) / name
        _write(path, content)
    return path


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)  # where the cache has been removed meanwhile
    with atomic_file(path) as unfinished:
        unfinished.write_bytes(content)


@cache
def _libraries(root: Path | None) -> Path:
    """In the cache of built FMUs, `root`; a folder of this process where there is none."""
    if root is not None:
        with suppress(OSError):
            folder = root / "libraries"
            fmu_cache.private(root)
            fmu_cache.private(folder)
            if os.access(folder, os.W_OK | os.X_OK):
                return folder
    folder = Path(temporary_folders.make_folder())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
