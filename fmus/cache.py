"""Cache of built FMUs, by a hash of everything that they are built from."""

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
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import hapticlink.components
from hapticlink.components import registry
from hapticlink.fmus import lock
from hapticlink.fmus.versions import find_versions

MAX_BUILD_TIME = 3600.0
"""Time (s) that no copy takes; unfinished files older than this were left by a killed process."""
VERSIONS = ("hapticlink", "casadi", "pythonfmu")
SOURCES = (".py", ".c", ".cpp", ".h", ".toml", ".png")


def folder() -> Path | None:
    """The cache folder: HAPTICLINK_CACHE, by default in the user's cache folder; None if
    HAPTICLINK_CACHE is "off", or if other users may put files there."""
    chosen = os.environ.get("HAPTICLINK_CACHE")
    if chosen == "off":
        return None
    root = Path(chosen) if chosen else user_folder()
    return root if is_own(root) else None


def user_folder() -> Path:
    """The folder of this package in the user's cache folder."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "hapticlink"


_told: set[Path] = set()


def is_own(folder: Path) -> bool:
    """Whether a folder of the cache, from which code is loaded, is this user's or root's, and not
    open to all; one that is not is logged once. True of what is not there."""
    try:
        status = folder.stat()
    except OSError:  # reported when it is used
        return True
    if os.name != "posix" or (_is_of_user(status) and not status.st_mode & 0o002):
        return True
    if folder not in _told:
        _told.add(folder)
        who = "everybody may write to it" if _is_of_user(status) else "it is another user's"
        logging.getLogger(__name__).warning(
            "the cache %s is not used, since %s and its files are run as code; name one of your "
            "own by HAPTICLINK_CACHE",
            folder, who,
        )  # fmt: skip
    return False


def _is_of_user(status: os.stat_result) -> bool:
    return sys.platform == "win32" or status.st_uid in (os.geteuid(), 0)


def private(folder: Path) -> None:
    """Creates a folder of the cache where it is missing, open to its user alone: what lies in it
    is loaded as code. Raises OSError."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)


def key(material: Mapping[str, Any]) -> str:
    """SHA-256 of the JSON `material`, the versions in VERSIONS and the sources of the equations,
    also those of plugins."""
    plugins = registry.origins("block", "force", "integrator")
    package = sys.modules[__package__]  # this one, which imports this file
    whole = {
        "material": material,
        "versions": find_versions(VERSIONS),
        "sources": sources(hapticlink.components, package),
        "plugins": {name: source(name) for name in plugins},
    }
    return sha(json.dumps(whole, sort_keys=True))


def sha(text: str) -> str:
    """The SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def sources(*packages: ModuleType) -> str:
    """SHA-256 of the Python files, C files, scenes and icons of `packages`."""
    sha = hashlib.sha256()
    for package in packages:
        root = Path(next(iter(package.__path__)))
        for path in sorted(p for p in root.rglob("*") if p.suffix in SOURCES):
            sha.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()


@cache
def source(module: str) -> str:
    """SHA-256 of the package of an imported module, or of its file. A module without a file (in a
    notebook) has another hash in every process, since it cannot be known whether it has changed."""
    loaded = sys.modules[module]
    if loaded.__package__:
        return sources(sys.modules[loaded.__package__])
    file = getattr(loaded, "__file__", None)
    return hashlib.sha256(Path(file).read_bytes() if file else os.urandom(32)).hexdigest()


def find(key_material: Mapping[str, Any]) -> Path | None:
    """The cached FMU for `key_material`, if there is one that is whole."""
    root = folder()
    return root and _whole_file(root / key(key_material))


def get_or_build(
    key_material: Mapping[str, Any],
    build_function: Callable[[Path], Path],
    build_folder: Path,
    poll: Callable[[], object] = lambda: None,
) -> Path:
    """The cached FMU for `key_material`, built by `build_function(folder) -> path` if necessary.

    Threads and processes of a machine that need the same one wait for the first to build it, which
    is logged as a warning where it is another process; `poll` is called meanwhile. Those of several
    machines each build their own, and the last rename wins, with the same bytes. A damaged file in
    the cache is built again. It is built in `build_folder`, which the caller has to remove, and
    stays there if the cache is off or cannot be written; the latter is logged as a warning.
    """
    root = folder()
    if root is None:
        return _build(build_function, build_folder, None, Path())
    entry = root / key(key_material)
    if cached_file := _whole_file(entry):
        return cached_file
    with exclusively(entry, str(key_material.get("block", "the same FMU")), poll):
        return _whole_file(entry) or _build(build_function, build_folder, root, entry)


def _whole_file(entry: Path) -> Path | None:
    with suppress(OSError):  # it cannot be read: built, which tells whether it can be written
        for path in entry.glob("[!.]*.fmu"):
            stat = path.stat()
            if (
                _is_of_user(stat)
                and path.is_file()
                and is_whole(path, stat.st_mtime_ns, stat.st_size)
            ):
                return path
    return None


def forget(path: Path) -> None:
    """Removes a file that `get_or_build` gave, which nobody can use."""
    with suppress(OSError):
        path.unlink()
        _digest(path).unlink(missing_ok=True)
        path.parent.rmdir()


_held: set[Path] = set()


@contextmanager
def exclusively(entry: Path, name: str, poll: Callable[[], object]) -> Iterator[None]:
    """No other thread or process of this machine builds for `entry` within the context."""
    warned = False

    def wait() -> None:
        nonlocal warned
        if not warned and path not in _held:  # which another thread of this process holds
            logging.getLogger(__name__).warning("waiting for another process that builds %s", name)
        warned = True
        poll()

    path = entry.parent / "locks" / f"{entry.name}.lock"
    with ExitStack() as stack:
        with suppress(OSError):  # a cache that cannot be written: reported when it is
            private(entry.parent)
            private(path.parent)
            stack.enter_context(lock.hold_lock(path, wait))
            _held.add(path)
        try:
            yield
        finally:
            with suppress(OSError):
                path.unlink()
            _held.discard(path)


def remove_locks() -> None:
    """Removes the files of the locks that this process holds; for a process that ends at once."""
    while _held:
        with suppress(OSError):
            _held.pop().unlink()


def _build(
    build_function: Callable[[Path], Path], build_folder: Path, root: Path | None, entry: Path
) -> Path:
    build_folder.mkdir(parents=True, exist_ok=True)
    own_folder = Path(tempfile.mkdtemp(dir=build_folder))
    built = build_function(own_folder)
    if root is None:
        return built
    try:
        stored = _store(built, root, entry)
    except OSError as error:
        logging.getLogger(__name__).warning(
            "the cache %s cannot be used (%s): %s is not kept; name another by HAPTICLINK_CACHE",
            root, error.strerror or error, built.name,
        )  # fmt: skip
        return built
    shutil.rmtree(own_folder, ignore_errors=True)
    return stored


def _store(built: Path, root: Path, entry: Path) -> Path:
    """A copy of `built` in `entry`: from its first instant there it is whole."""
    private(root)
    _clear(root)
    unfinished = root / f".{uuid.uuid4().hex}"
    try:
        shutil.copyfile(built, unfinished)
        entry.mkdir(exist_ok=True)
        _digest(entry / built.name).write_text(hashlib.sha256(unfinished.read_bytes()).hexdigest())
        os.replace(unfinished, entry / built.name)
    finally:
        unfinished.unlink(missing_ok=True)
    return entry / built.name


def _clear(root: Path) -> None:
    """Removes unfinished copies of killed processes, also on other machines that share the
    cache."""
    for left in root.glob(".*"):
        with suppress(OSError):  # another process has removed it
            if time.time() - left.stat().st_mtime > MAX_BUILD_TIME:
                left.unlink()


def _digest(path: Path) -> Path:
    """Where the SHA-256 of a file of the cache is."""
    return path.with_name(f".{path.name}.sha256")


@lru_cache(64)
def is_whole(path: Path, changed_ns: int, size: int) -> bool:
    """Whether an archive has the bytes that were stored in the cache or, elsewhere, entries that
    can be read to their ends, which takes longer: asked once as long as the file does not change.
    """
    try:
        if (stored := _digest(path)).exists():
            return stored.read_text() == hashlib.sha256(path.read_bytes()).hexdigest()
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is None and bool(archive.namelist())
    except (OSError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError):
        return False
