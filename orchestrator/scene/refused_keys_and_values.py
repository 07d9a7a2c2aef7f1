"""What is wrong with the keys and values of a scene: path in the file, fault and remedy, from the
errors of pydantic; and what no value of a scene may be, in a file, an option or an SSP."""

from __future__ import annotations

import copy
import re
import typing
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import COUNTED, near, shorten, unknown
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.scene import checks, key_descriptions, types_of_keys
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import DEEPEST, Path, Problem, value


def explain_errors(errors: Sequence[Any], data: Any) -> list[tuple[Path, str]]:
    """pydantic's errors as (path in the file, message), with one for all branches of a union; up to
    COUNTED of them."""
    by_path: dict[Path, list[Any]] = {}
    for error in errors:
        path = _path(error, data)
        if path is not None:
            by_path.setdefault(path, []).append(error)
    messages_by_path: list[tuple[Path, str]] = []
    above = {path[:i] for path in by_path for i in range(len(path))}
    for where, group in islice(by_path.items(), COUNTED):
        if where in above and all(e["type"].endswith(("_type", "literal_error")) for e in group):
            continue  # branches of a union that do not apply; the one that does has deeper errors
        limited = [e for e in group if e["type"] in _RANGE]
        messages = {_message(e, where, data) for e in limited or group}
        wanted = key_descriptions.describe_expected(where, data)
        expected = f"{_shown(group[0]['input'])} should be {wanted}"
        messages_by_path.append((where, messages.pop() if len(messages) == 1 else expected))
    return messages_by_path


_RANGE = {
    *("greater_than", "greater_than_equal", "less_than", "less_than_equal"),
    *("finite_number", "out_of_range"),
}


def _path(error: Any, data: Any) -> Path | None:
    """The path of an error in the file; None for a branch that the table's `type` excludes."""
    path: Path = ()
    node = data
    for i, part in enumerate(error["loc"]):
        inside = isinstance(node, dict) and part in node
        inside |= isinstance(node, list) and isinstance(part, int) and part < len(node)
        if inside:
            node = node[part]
            path = (*path, part)
        elif error["type"] == "missing" and i == len(error["loc"]) - 1:
            if isinstance(node, list) and part >= _wanted_length(path, data, node):
                return None
            path = (*path, part)
        else:
            kinds = types_of_keys.types_at(path, data)
            names = {k.__name__ for k in types_of_keys.choose_by_type(kinds, node)}
            if part in {k.__name__ for k in kinds} - names:
                return None
    return (*path, "type") if error["type"] == "union_tag_invalid" else path


def _wanted_length(path: Path, data: Any, node: list[Any]) -> int:
    """That of the shortest array that may be at `path` and has no fewer entries than `node`."""
    sizes = (len(typing.get_args(kind)) for kind in types_of_keys.types_at(path, data))
    return min(size for size in sizes if size >= len(node))


def find_further_problems(known: Sequence[tuple[Path, str]], data: Any) -> list[tuple[Path, str]]:
    """Semantic errors that remain when the schema errors `known` are removed from `data`.

    Faulty values are dropped, or replaced by a placeholder where one is required. Returns nothing
    where no valid scene results, as where a name is missing that other tables refer to.
    """
    whole, reported = copy.deepcopy(data), {path for path, _ in known}
    # A table of an unknown type is replaced as a whole.
    untyped = [path for path, _ in known if path[-1:] == ("type",) and _is_kind(path[:-1])]
    wrong = [path[:-1] if path in untyped else path for path, _ in known if path]
    for path in wrong:
        node = value(whole, path[:-1])
        if isinstance(node, dict):
            node.pop(path[-1], None)
    for path in wrong:
        node, filled = value(whole, path[:-1]), _placeholder(path)
        if isinstance(node, list):
            place = typing.cast("int", path[-1])
            node += [filled] * (place + 1 - len(node))  # too short a vector
            node[place] = filled
        elif isinstance(node, dict) and (
            (*path, "type") in untyped or types_of_keys.is_needed(path)
        ):
            node[path[-1]] = filled
    try:
        document = to_json(whole, inf_nan_mode="constants")
        faults = checks.check_scene(adapter(Scene).validate_json(document))
    except pydantic.ValidationError:
        return []
    return [problem for problem in faults if problem[0] not in reported]


def _is_kind(path: Path) -> bool:
    """Whether the record at `path` is one of several, selected by its `type`."""
    return sum(bool(types_of_keys.types(kind)) for kind in types_of_keys.types_at(path)) > 1


def _placeholder(path: Path) -> Any:
    """A value of the right type that causes no error elsewhere; None where there is none."""
    kinds = types_of_keys.types_at(path)
    if float in kinds or int in kinds:
        return 1
    if str in kinds:
        return "" if path[-1] not in ("name", "child") else None
    for kind in kinds:
        if types_of_keys.types(kind):
            needed = ((*path, key) for key in types_of_keys.keys([kind]))
            return {p[-1]: _placeholder(p) for p in needed if types_of_keys.is_needed(p, kind)}
        if typing.get_origin(kind) is tuple and Ellipsis not in typing.get_args(kind):
            return [_placeholder((*path, 0)) for _ in typing.get_args(kind)]
    return None


def _message(error: Any, path: Path, data: Any) -> str:
    kind, shown = error["type"], _shown(error["input"])
    if kind == "missing":
        return "is missing"
    if kind == "unexpected_keyword_argument":
        return _unknown_key(path, error["loc"], data)
    if kind == "value_error":  # an unknown name of a registry
        return str(error["ctx"]["error"])
    if kind == "union_tag_invalid":
        known = [t for k in types_of_keys.types_at(path[:-1]) for t in types_of_keys.types(k)]
        return unknown("type", error["ctx"]["tag"], known)
    if kind in _RANGE:
        finite = "" if shown.lstrip("-") not in ("inf", "nan") else "finite "
        return f"{shown} is out of range: give a {finite}{key_descriptions.number(path, data)}"
    if kind == "no_number":
        return f"{shown} should be {key_descriptions.describe_expected(path, data)}"
    if kind in ("tuple_type", "too_long") and (wanted := key_descriptions.vector(path, data)):
        return f"{shown} should be {wanted}"
    message = error["msg"].removeprefix("Input should be ").replace("an object", "a table")
    return f"{shown} should be {message}" if message != error["msg"] else f"{shown}: {message}"


def _shown(value: Any) -> str:
    return shorten(repr(value))


_GONE: dict[Path, str] = {
    ("step_control",): (
        "steps are as long as their rate says: take it out, with a higher rate or `substeps`"
    ),
    ("faults", "discard"): (
        "a step that an FMU discards ends the run: take it out, with a higher rate or `substeps`"
    ),
    ("contacts", "broad_phase"): (
        "pairs that can never touch are left out, to the same result: take it out"
    ),
    ("device", "sensing"): "is a key of the scene: write `sensing` outside of [device]",
}
"""Keys of earlier versions, with what to write instead."""


def _unknown_key(path: Path, loc: Sequence[Any], data: Any) -> str:
    """The message for an unknown key, or for one that belongs to another `type` of the table."""
    if path in _GONE:
        return _GONE[path]
    kinds, table, key = (
        types_of_keys.types_at(path[:-1], data),
        value(data, path[:-1]),
        str(path[-1]),
    )
    types = {name: k for k in kinds for name in types_of_keys.types(k)}
    branch = loc[-2] if len(loc) > 1 else None  # without a type, pydantic tried the default's
    this = table.get("type", branch) if isinstance(table, dict) else branch
    owners = [repr(name) for name, k in types.items() if key in types_of_keys.keys([k])]
    kind = types.get(this) if isinstance(this, str) else None
    if kind and owners:
        return f"`{key}` belongs to type {' or '.join(owners)}, not {this!r}"
    known = types_of_keys.keys([kind] if kind else kinds)
    return f"unknown key; {near(key, sorted(known))}"


def find_unrepresentable(value: Any, path: Path = ()) -> Iterator[Problem]:
    """What no scene can hold, and where: tables without end, whole numbers that no type of FMI
    can, dates, text that cannot be written to a file."""
    if len(path) > DEEPEST:
        yield path, f"more than {DEEPEST} tables or lists within one another: write it flatter"
    elif isinstance(value, dict | list):
        of_table = isinstance(value, dict)
        for key, inside in value.items() if isinstance(value, dict) else enumerate(value):
            if of_table and not (type(key) is str and key.isascii()) and not _is_unicode(key):
                yield (*path, ascii(key)), "is no Unicode text: write it in UTF-8"
            kind = type(inside)  # tells at once that most values are fine
            fine = kind is float or kind is bool or (kind is str and inside.isascii())
            if not fine or len(path) == DEEPEST:
                yield from find_unrepresentable(inside, (*path, str(key) if of_table else key))
    elif isinstance(value, str):
        if not _is_unicode(value):
            yield path, f"{value[:100]!a} is no Unicode text: write it in UTF-8"
    elif isinstance(value, int):
        if not -(2**63) <= value < 2**64:
            yield path, "a whole number of more than 64 bits: write it with a point, as 1.0e30"
    elif not isinstance(value, float | None):
        yield path, f"{value} should be a number, a text, true, false, a list or a table"


def _is_unicode(text: Any) -> bool:
    """False of what is no text, too, as a key of a state of a run may be that somebody changed."""
    return isinstance(text, str) and not _SURROGATES.search(text)


_SURROGATES = re.compile("[\ud800-\udfff]")
"""What no text of UTF-8 has."""
