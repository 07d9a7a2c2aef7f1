"""Built FMUs, kept by what they were made from."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import sys
import tempfile
import time
import uuid
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

LONGEST = 3600.0
"""Seconds that no copy takes."""
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
    key_material: Mapping[str, Any], build_function: Callable[[Path], Path], room: Path
) -> Path:
    """The FMU for `key_material`, made by `build_function(folder) -> path` if it is not there.

    Runs that race build each their own, and the last rename wins: the bytes are the same. A
    cached file that is damaged is built again. It is built in `room`, which is the caller's to
    remove, and stays there where the cache is off or cannot be written, which is told.
    """
    root = folder()
    if root is not None:
        place = root / key(key_material)
        for path in place.glob("[!.]*.fmu"):
            if _is_whole(path):
                return path
    room.mkdir(parents=True, exist_ok=True)
    making = Path(tempfile.mkdtemp(dir=room))
    built = build_function(making)
    if root is None:
        return built
    try:
        kept = _kept(built, root, place)
    except OSError as error:
        logging.getLogger(__name__).warning(
            "the cache %s cannot be written (%s): %s is not kept; name another by HAPTICLINK_CACHE",
            root, error.strerror or error, built.name,
        )  # fmt: skip
        return built
    shutil.rmtree(making, ignore_errors=True)
    return kept


def _kept(built: Path, root: Path, place: Path) -> Path:
    """A copy of `built` in `place`: from its first instant there it is whole."""
    root.mkdir(parents=True, exist_ok=True)
    _clear(root)
    beside = root / f".{uuid.uuid4().hex}"
    try:
        shutil.copyfile(built, beside)
        place.mkdir(exist_ok=True)
        os.replace(beside, place / built.name)
    finally:
        beside.unlink(missing_ok=True)
    return place / built.name


def _clear(root: Path) -> None:
    """Remove what was left of a copy by a process that was killed, on whichever machine that shares
    the cache."""
    for left in root.glob(".*"):
        with suppress(OSError):  # another process removes its own
            if time.time() - left.stat().st_mtime > LONGEST:
                left.unlink()


def _is_whole(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is None and "modelDescription.xml" in archive.namelist()
    except (OSError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError):
        return False
