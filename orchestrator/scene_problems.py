"""pydantic's findings as faults of the file: path, what is wrong, what to do."""

from __future__ import annotations

import copy
import difflib
import typing
from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator import scene_checks
from hapticlink.orchestrator.scene import Scene, adapter
from hapticlink.orchestrator.toml_lines import Path


def problems(errors: Sequence[Any], data: Any) -> list[tuple[Path, str]]:
    """pydantic's errors as (path in the file, message), unions folded into one each."""
    by_path: dict[Path, list[Any]] = {}
    for error in errors:
        path: Path = ()
        node = data
        for i, part in enumerate(error["loc"]):
            inside = isinstance(node, dict) and part in node
            inside |= isinstance(node, list) and isinstance(part, int) and part < len(node)
            if inside:
                node = node[part]
                path = (*path, part)
            elif error["type"] == "missing" and i == len(error["loc"]) - 1:
                path = (*path, part)
        by_path.setdefault(path, []).append(error)
    found = []
    for at, group in by_path.items():
        deeper = any(len(other) > len(at) and other[: len(at)] == at for other in by_path)
        if deeper and all(error["type"].endswith("_type") for error in group):
            continue  # the other branches of a union whose right branch says more below
        found.append((at, " or ".join(dict.fromkeys(_message(e, at) for e in group))))
    return found


def beyond(known: Sequence[tuple[Path, str]], data: Any) -> list[tuple[Path, str]]:
    """What the later checks find once every faulty value is taken out, or is 1 where one is
    needed; nothing where that makes no scene."""
    whole = copy.deepcopy(data)
    for filled in (None, 1.0):
        for path, _ in known:
            node = _at(whole, path[:-1])
            if isinstance(node, list):
                place = typing.cast("int", path[-1])
                node += [filled] * (place + 1 - len(node))  # too short a vector
                node[place] = filled
            elif isinstance(node, dict) and filled is None:
                node.pop(path[-1], None)
            elif isinstance(node, dict) and _is_needed(path):
                node[path[-1]] = filled
    try:
        document = to_json(whole, inf_nan_mode="constants")
        found = scene_checks.check(adapter().validate_json(document))
    except pydantic.ValidationError:
        return []
    told = {path for path, _ in known}
    return [problem for problem in found if problem[0] not in told]


def _at(data: Any, path: Path) -> Any:
    """What stands at `path`, None where nothing does (any more)."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _is_needed(path: Path) -> bool:
    """Whether the key at `path` has no default."""
    records = (kind for kind in _tables(path[:-1]) if is_dataclass(kind))
    return any(
        f.name.rstrip("_") == path[-1] and f.default is MISSING and f.default_factory is MISSING
        for kind in records
        for f in fields(kind)
    )


def _message(error: Any, path: Path) -> str:
    kind, value = error["type"], error["input"]
    if kind == "missing":
        return "is missing"
    if kind == "unexpected_keyword_argument":
        known = _keys(path[:-1])
        near = difflib.get_close_matches(str(path[-1]), known, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(sorted(known))}"
        return f"unknown key; {hint}"
    message = error["msg"].removeprefix("Input should be ").replace("an object", "a table")
    return f"{value!r} should be {message}" if message != error["msg"] else f"{value!r}: {message}"


def _keys(path: Path) -> set[str]:
    """The keys that the table at `path` may have, in any branch of a union."""
    kinds = (kind for kind in _tables(path) if is_dataclass(kind))
    return {f.name.rstrip("_") for kind in kinds for f in fields(kind)}  # `from_` is a keyword


def _tables(path: Path) -> list[Any]:
    """The types that the value at `path` may have."""
    kinds: list[Any] = [Scene]
    for part in path:
        below: list[Any] = []
        for kind in kinds:
            if is_dataclass(kind) and isinstance(part, str):
                hints = typing.get_type_hints(kind, include_extras=True)
                below += _branches(hints[part]) if part in hints else []
            elif isinstance(part, int):
                below += _branches(typing.get_args(kind)[0]) if typing.get_args(kind) else []
        kinds = below
    return kinds


def _branches(kind: Any) -> list[Any]:
    """The members of a union, annotations taken off."""
    if typing.get_origin(kind) is typing.Annotated:
        return _branches(typing.get_args(kind)[0])
    if is_dataclass(kind) or typing.get_origin(kind) is tuple:
        return [kind]
    return [branch for member in typing.get_args(kind) for branch in _branches(member)]
