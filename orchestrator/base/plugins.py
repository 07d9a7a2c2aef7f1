"""Plugins: modules that register a user's own integrators, forces, blocks, holds, schemes, ...

A module is named by `--plugin`, or by an installed distribution under [project.entry-points]
"hapticlink.plugins"; importing it registers its parts.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from hapticlink.components import registry
from hapticlink.orchestrator.base.errors import InputFault, shorten

GROUP = "hapticlink.plugins"
PACKAGE = f"{Path(registry.__file__).parent.parent}{os.sep}"
"""Folder of this package; an error in a plugin is reported at the last line outside of it."""


def load(modules: Iterable[str]) -> None:
    """Import modules: installed ones or files of the current folder. Raises InputFault for one that
    does not exist, fails, or registers nothing."""
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # last, so that no file here hides an installed module
    for module in modules:
        _load(module, f"--plugin {module}")


@cache
def load_installed() -> None:
    """Import the modules that installed distributions declare. Raises InputFault as `load` does."""
    from importlib.metadata import entry_points  # slow to load

    for point in entry_points(group=GROUP):
        _load(point.module, f"plugin {point.name} of {point.dist.name if point.dist else GROUP}")


def list_plugins() -> dict[str, dict[str, str | None]]:
    """Each module that has registered a part, with its version (None where it has none) and the
    SHA-256 of its sources."""
    from hapticlink.fmus.cache import source  # loads all of `fmus`

    return {
        name: {"version": _version(name), "sha256": source(name)} for name in registry.origins()
    }


def blame_plugin(error: BaseException) -> str | None:
    """What to tell of an error that a plugin has raised, with its last line in the traceback; None
    for an error in which no plugin takes part."""
    modules = registry.origins()
    for frame, line in reversed([*traceback.walk_tb(error.__traceback__)]):
        name = str(frame.f_globals.get("__name__"))
        if any(f"{name}.".startswith(f"{module.partition('.')[0]}.") for module in modules):
            place = f"{frame.f_code.co_filename}, line {line}"
            return f"plugin {name}: {place}: {type(error).__name__}: {error}"
    return None


def _load(module: str, what: str) -> None:
    if not all(part.isidentifier() for part in module.split(".")):
        hint = ": give its name, without .py" if module.endswith(".py") else ""
        raise InputFault(f"{shorten(what)}: this is no name of a module{hint}")
    try:
        with _goes_on():
            importlib.import_module(module)
    except ModuleNotFoundError as error:
        if not f"{module}.".startswith(f"{error.name}."):
            text = f"it imports {error.name!r}, which is not there{_hint(error)}"
            raise InputFault(f"{what}: {text}") from error
        hint = "give its name, without .py" if module.endswith(".py") else "is it installed?"
        raise InputFault(f"{what}: no such module, nor a file in {os.getcwd()}; {hint}") from error
    except SyntaxError as error:
        place = f"{error.filename}, line {error.lineno}"
        raise InputFault(f"{what}: {place}: SyntaxError: {error.msg}") from error
    except BaseException as error:  # whatever a user's module can do; signals wait
        frames = traceback.extract_tb(error.__traceback__)
        own = [f for f in frames if not f.filename.startswith((PACKAGE, "<"))]
        place = f"{own[-1].filename}, line {own[-1].lineno}: " if own else ""
        try:
            text = str(error)
        except Exception:
            text = "its message cannot be read"
        text = f"{place}{type(error).__name__}: {text}{_hint(error)}"
        raise InputFault(f"{what}: {text}") from error
    package = module.partition(".")[0]
    if package not in {name.partition(".")[0] for name in registry.origins()}:
        file = getattr(sys.modules[module], "__file__", None)
        raise InputFault(f"{what}: {file} registers no part (docs/extending.md)")


def _hint(error: BaseException) -> str:
    """The remedy for a name of this package that is not, or no longer, there."""
    ours = isinstance(error, ImportError) and str(error.name).startswith("hapticlink.")
    return "; docs/extending.md has a complete example of each part" if ours else ""


@contextmanager
def _goes_on() -> Iterator[None]:
    """Within the context os._exit raises SystemExit: an import ends no command without a word."""
    exit_at_once = os._exit

    def refused(status: int) -> None:
        raise SystemExit(f"os._exit({status})")

    os._exit = refused  # type: ignore[assignment]
    try:
        yield
    finally:
        os._exit = exit_at_once


@cache  # it looks through all that is installed, and each run asks
def _version(module: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    package = module.partition(".")[0]
    with suppress(PackageNotFoundError):
        return str(getattr(sys.modules[package], "__version__", None) or version(package))
    return None
