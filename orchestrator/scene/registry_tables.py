"""Tables whose keys are defined by a part of a registry: `settings` of an [[fmu]] with a `block`,
and the entries of [[linkage.force]]."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import field, make_dataclass
from functools import cache
from typing import Any

from hapticlink.components.blocks import BLOCKS
from hapticlink.orchestrator.scene.toml_keys import Path, value


def tables(data: Any) -> Iterator[tuple[Path, Any]]:
    """Path and content of every such table in a scene's `data`; missing settings are added as an
    empty table."""
    for i, fmu in enumerate(_list(data, "fmu")):
        if isinstance(fmu, dict) and "block" in fmu:
            yield ("fmu", i, "settings"), fmu.setdefault("settings", {})
    for i, force in enumerate(_list(data, "linkage", "force")):
        yield ("linkage", "force", i), force


def _list(data: Any, *path: str) -> list[Any]:
    entries = value(data, path)
    return entries if isinstance(entries, list) else []


def record_of(path: Path, data: Any) -> Any:
    """The record that defines the table at `path` of a scene's `data`; None where the registry has
    no part of that name, and for any other table."""
    match path:
        case ("fmu", int(), "settings"):
            name = value(data, (*path[:2], "block"))
            return _arguments(BLOCKS[name]) if name in tuple(BLOCKS) else None
        case ("linkage", "force", int()) if (name := value(data, (*path, "type"))) is not None:
            from hapticlink.components.forces import FORCES  # loads CasADi

            return FORCES[name] if name in tuple(FORCES) else None
    return None


@cache
def _arguments(block: Callable[..., Any]) -> Any:
    """A record of a block's arguments."""
    arguments = inspect.signature(block).parameters.values()
    named = [(a.name, a.annotation, field(**_default(a))) for a in arguments]
    record = make_dataclass("Settings", named, kw_only=True)
    # Resolves annotations that are texts; from Python 3.12 on make_dataclass sets it by itself.
    record.__module__ = block.__module__
    return record


def _default(argument: inspect.Parameter) -> dict[str, Any]:
    given = argument.default
    return {} if given is argument.empty else {"default_factory": lambda: given}
