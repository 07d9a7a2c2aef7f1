"""Built FMUs, kept by what they were made from."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import hapticlink.components
import hapticlink.fmus
from hapticlink.components import registry
from hapticlink.fmus.atomic_file import atomic_file

LONGEST = 3600.0
"""Seconds that no build takes."""
VERSIONS = ("hapticlink", "casadi", "pythonfmu")


def folder() -> Path | None:
    """HAPTICLINK_CACHE, or the user's cache folder; None where HAPTICLINK_CACHE is "off"."""
    chosen = os.environ.get("HAPTICLINK_CACHE")
    if chosen == "off":
        return None
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "hapticlink"


def key(material: Mapping[str, Any]) -> str:
    """sha256 of the JSON `material`, the versions in VERSIONS and the sources of the equations,
    those of plugins too."""
    plugins = registry.origins("block", "force", "integrator")
    whole = {
        "material": material,
        "versions": {name: version(name) for name in VERSIONS},
        "sources": sources(hapticlink.components, hapticlink.fmus),
        "plugins": {name: source(name) for name in plugins},
    }
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


@cache
def sources(*packages: ModuleType) -> str:
    """sha256 of the Python and C files of `packages`, and of the icons."""
    sha = hashlib.sha256()
    for package in packages:
        root = Path(next(iter(package.__path__)))
        for path in sorted(p for p in root.rglob("*") if p.suffix in (".py", ".c", ".png")):
            sha.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()


@cache
def source(module: str) -> str:
    """sha256 of the package that an imported module is in, or of its own file. One without a file
    (a notebook) is another in every process, since nobody knows whether it has changed."""
    found = sys.modules[module]
    if found.__package__:
        return sources(sys.modules[found.__package__])
    file = getattr(found, "__file__", None)
    return hashlib.sha256(Path(file).read_bytes() if file else os.urandom(32)).hexdigest()


def cached(
    key_material: Mapping[str, Any],
    build_function: Callable[[Path], Path],
    room: Path | None = None,
) -> Path:
    """The FMU for `key_material`, made by `build_function(folder) -> path` if it is not there.

    Runs that race build each their own, and the last rename wins: the bytes are the same. A
    cached file that is damaged is built again. It is built in `room`, which is the caller's to
    remove, beside its final place where there is none. With the cache off, the FMU lands in a new
    temporary folder, which is the caller's to remove.
    """
    root = folder()
    if root is None:
        return build_function(Path(tempfile.mkdtemp(prefix="hapticlink-")))
    place = root / key(key_material)
    for path in place.glob("[!.]*.fmu"):
        if _is_whole(path):
            return path
    place.mkdir(parents=True, exist_ok=True)
    _clear(place)
    room = room or place
    room.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=room, prefix=".") as making:
        built = build_function(Path(making))
        with atomic_file(place / built.name) as beside:
            shutil.copyfile(built, beside)
    return place / built.name


def _clear(place: Path) -> None:
    """Remove what a build left that was killed, on whichever machine that shares the cache."""
    for left in place.glob(".*"):
        with suppress(OSError):  # another build removes its own
            if time.time() - left.stat().st_mtime < LONGEST:
                continue
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink()


def _is_whole(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is None and "modelDescription.xml" in archive.namelist()
    except (OSError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError):
        return False
