"""What the libraries of pythonfmu 0.7 and pythonfmu3 0.3 need, so as not to crash the process, and
to say where an exception comes from.

At the end of the process they release the Python interpreter twice, which corrupts memory. The
function that they export for it, `finalizePythonInterpreter`, is therefore called earlier, so that
the second release finds a null pointer. An FMU without its Python module crashes them at once.

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
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from inspect import getattr_static, isfunction
from pathlib import Path
from traceback import extract_tb
from typing import Any

from fmpy import sharedLibraryExtension

from hapticlink.fmus import cache as fmu_cache
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base import temporary_folders

_kept: dict[int, ctypes.CDLL] = {}
"""By handle: a reference of our own, so that FMPy's unloading leaves the library in its place."""


CALLED = re.compile(
    r"do_step|terminate|setup_experiment|(enter|exit)_\w+_mode"
    r"|([gs]et)_(real|integer|boolean|string|float\d+|u?int\d+)"
)
"""The methods of a slave that a library calls."""


def is_python(loaded: ctypes.CDLL) -> bool:
    """Whether a library is one of these."""
    return hasattr(loaded, "finalizePythonInterpreter")


def prepare(loaded: ctypes.CDLL, folder: str) -> str:
    """The Python module of an FMU whose library, loaded from its `folder`, holds an interpreter,
    which is then released when this process ends; "" for other FMUs. Raises ValueError where such a
    library would find no module."""
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
    @wraps(method)
    def telling(slave: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return method(slave, *arguments, **named)
        except Exception as error:
            frames = extract_tb(error.__traceback__)
            last = ([f for f in frames if Path(f.filename).parent == own_files] or frames)[-1]
            where = f"{Path(last.filename).name}, line {last.lineno}, in {last.name}: {last.line}"
            if tell := _told.get((module, getattr(slave, "instance_name", ""))):
                tell(f"{where}: {type(error).__name__}: {error}".encode())
            raise

    vars(telling)[TELLS] = True
    return telling


def find_shared_library(folder: Path, library: Path) -> Path | None:
    """The path from which to load the `library` of a Python FMU that is unpacked in `folder`: the
    same one for all libraries of the same bytes. None for other FMUs, and for a library that other
    files lie beside, which it may need."""
    if not (folder / "resources" / "slavemodule.txt").exists():
        return None
    if [*library.parent.iterdir()] != [library]:
        return None
    content = library.read_bytes()
    return _stored(content, hashlib.sha256(content).hexdigest())


def _stored(content: bytes, digest: str) -> Path:
    path = _libraries(fmu_cache.folder()) / f"{digest}{sharedLibraryExtension}"
    with suppress(OSError):
        if hashlib.sha256(path.read_bytes()).hexdigest() == digest:
            return path
    path.parent.mkdir(parents=True, exist_ok=True)  # where the cache has been removed meanwhile
    with atomic_file(path) as unfinished:
        unfinished.write_bytes(content)
    return path


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
