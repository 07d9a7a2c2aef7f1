"""Module names of Python FMUs that clash.

Python FMUs of one process share an interpreter: of two modules with the same name, both FMUs would
silently use the one imported first. An FMU that would get another's module is isolated in a process
of its own.

pythonfmu and pythonfmu3 put an FMU's resources/ on sys.path; what can be imported from there
are its top-level modules and packages. Two are the same where their files have equal CRC-32s.
"""

from __future__ import annotations

import re
import sys
import zlib
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

import hapticlink.fmus
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.fmi.archive import open_archive
from hapticlink.orchestrator.system.system import Fmu

Modules = dict[str, dict[str, int]]
"""For each top-level module name, the CRC-32 of its files by their path in resources/."""

OURS = re.compile("hapticlink_[0-9a-f]{16}(_slave)?")
"""Names that contain a hash of the whole FMU: equal names are equal modules, also where the folder
that one was imported from is gone."""
SLAVE = Path(str(hapticlink.fmus.__file__)).with_name("python_slave.py")
_loaded: Modules = {}
"""Modules of all FMUs that this process has loaded; they stay imported when FMUs are freed."""


def find_bundled(path: Path) -> Modules:
    """The modules in the resources/ of a Python FMU, read once as long as the file does not change;
    {} for other FMUs, and for a file that cannot be read, which is reported when it is loaded."""
    try:
        return _find_bundled(process_cache.file_at(path))
    except (InputFault, OSError):
        return {}


@lru_cache(process_cache.MAX_UNPACKED)
def _find_bundled(at: process_cache.File) -> Modules:
    with open_archive(at[0], "FMU") as archive:
        crcs = {e.filename: e.CRC for e in archive.infolist()}
    modules: Modules = {}
    for file, crc in crcs.items() if "resources/slavemodule.txt" in crcs else ():
        place = file.removeprefix("resources/")
        if place != file and place.endswith(".py"):
            modules.setdefault(place.partition("/")[0].removesuffix(".py"), {})[place] = crc
    return modules


def clashes(fmus: Iterable[Fmu]) -> dict[str, str]:
    """The FMUs that have to be isolated although the scene does not say so, by name, with the
    reason. The modules of the others are recorded as loaded."""
    reasons = {}
    for fmu in fmus:
        if fmu.isolate:
            continue
        modules = find_bundled(fmu.description.path)
        other = next((n for n, files in modules.items() if not _is_mine(n, files)), None)
        if other is None:
            if "pythonfmu" in modules:
                _import_installed(modules["pythonfmu"])
            for name, files in modules.items():
                if OURS.fullmatch(name) and name not in sys.modules:
                    _import_slave(name, files)
                _loaded.setdefault(name, files)
        else:
            reasons[fmu.name] = f"another module {other!r} is loaded in this process"
    return reasons


def _import_installed(files: dict[str, int]) -> None:
    """Imports the installed pythonfmu where its `files` are those of an FMU: its own would be
    compiled in each process anew."""
    spec = find_spec("pythonfmu")
    if spec and _on_disk("pythonfmu", spec.origin or "") == files:
        import pythonfmu as pythonfmu


def _import_slave(name: str, files: dict[str, int]) -> None:
    """Imports the slave of an FMU under its `name` from this package, where its text is the same,
    and is compiled already."""
    spec = spec_from_file_location(name, SLAVE)
    if files == {f"{name}.py": _crc_of_slave()} and spec and spec.loader:
        sys.modules[name] = module = module_from_spec(spec)
        spec.loader.exec_module(module)


@cache
def _crc_of_slave() -> int:
    return _crc(SLAVE)


def _is_mine(name: str, files: dict[str, int]) -> bool:
    """Whether `import name` would give an FMU its own module."""
    known = _loaded.get(name)
    if OURS.fullmatch(name):
        return True
    if known is None:
        module = sys.modules.get(name)
        if module is None:
            return True
        known = _on_disk(name, getattr(module, "__file__", None) or "")
    return all(known.get(path, crc) == crc for path, crc in files.items()) and bool(
        known.keys() & files.keys()
    )


@cache
def _on_disk(name: str, file: str) -> dict[str, int]:
    """The files of a module of this process, by the path that they would have in resources/."""
    path = Path(file)
    if path.name != "__init__.py":
        return {f"{name}.py": _crc(path)} if path.is_file() else {}
    return {f"{name}/{p.name}": _crc(p) for p in path.parent.glob("*.py")}


def _crc(path: Path) -> int:
    return zlib.crc32(path.read_bytes())
