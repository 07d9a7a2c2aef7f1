"""`--set key=value`: changes a scene's keys before it is checked."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import PurePath
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault, shorten, unknown
from hapticlink.orchestrator.scene.toml_keys import (
    ASSIGNMENT,
    DEEPEST,
    Path,
    flatten_path,
    loads,
    parts,
)

Options = Mapping[str, Any] | Sequence[str]
"""Dotted keys with their Python values, or `key=value` as on the command line."""


def write_options(options: Options) -> tuple[str, ...]:
    """The options as `key=value` texts. Raises InputFault for a single text in place of a list, for
    what is no text in a list, and for a value that TOML cannot write."""
    if isinstance(options, str):
        raise InputFault(f"options {options!r}: give a mapping, or a list of key=value")
    if not isinstance(options, Mapping):
        for option in options:
            if not isinstance(option, str):
                raise InputFault(f"option {option!r}: write key=value, or give a mapping")
        return tuple(options)
    return tuple(f"{key}={text(value, key)}" for key, value in options.items())


def text(value: Any, key: str) -> str:
    """A Python value of `key` as text that `parse` reads back; quoted only where it must be. Raises
    InputFault for a value that TOML cannot write."""
    if isinstance(value, str):
        try:
            loads(f"value = {value}")
        except ValueError:
            if value == value.strip():
                return value
    return toml(value, key)


def toml(value: Any, key: str) -> str:
    """A Python value of `key` as TOML. Raises InputFault for one that TOML cannot write."""
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | PurePath):
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        entries = (f"{toml(str(k), key)} = {toml(v, key)}" for k, v in value.items())
        return f"{{ {', '.join(entries)} }}"
    if isinstance(value, list | tuple | range):
        return f"[{', '.join(toml(v, key) for v in value)}]"
    raise InputFault(f"{key}: {value!r} is no value of a scene; give a number, text, list or table")


def parse(option: str) -> tuple[tuple[str, ...], Any]:
    """The names of the dotted key, and the value as TOML or, where it is none, as text.

    Names in the key may be quoted, as in TOML: `holds."virtual_environment.P_c"=lead` is the same
    as `holds.virtual_environment.P_c=lead`. Raises InputFault where there is no `=` or no key.
    """
    names, equals, text = _key(option)
    shown = f"--set {shorten(option)}"
    if not equals or not all(names):
        raise InputFault(f"{shown}: write key=value, e.g. --set graphics.rate=10")
    if len(names) > DEEPEST:
        raise InputFault(f"{shown}: a key of {len(names)} names; none has more than {DEEPEST}")
    try:
        return names, loads(f"value = {text}")["value"]
    except ValueError:
        return names, text.strip()


def as_command_line(option: str) -> str:
    """The option as it is pasted into a shell; `--swap` for an FMU that replaces a block."""
    try:
        names, value = parse(option)
    except InputFault:
        names, value = (), None
    swaps = (["replaces", "path"], ["replaces", "engine"])
    if names == ("fmu", "+") and isinstance(value, dict) and [*value] in swaps:
        return f"--swap {shlex.quote('='.join(map(str, value.values())))}"
    return f"--set {shlex.quote(option)}"


def _key(option: str) -> tuple[tuple[str, ...], str, str]:
    """Names of the key, "=" or nothing, and text of the value."""
    if match := ASSIGNMENT.match(option):
        try:
            return parts(match[1].strip()), "=", option[match.end() :]
        except ValueError:
            pass  # a key that TOML does not allow, such as `fmu.plant.start.x[1]`
    key, equals, text = option.partition("=")
    return tuple(name.strip() for name in key.split(".")), equals, text


def apply(
    data: dict[str, Any], option: str, parsed: tuple[tuple[str, ...], Any] | None = None
) -> Path:
    """Set the key in `data`; returns the path of the key, or of the first table created for it.
    parsed: what `parse` gives for the option, if that is known.

    Entries of an array of tables are addressed by name or by index (from 0), and + appends one:
    `linkage.body.link1.mass=2`, `fmu.+={ name = "filter", path = "filter.fmu" }`.
    Raises InputFault where there is no such entry, or where a part of the key is no table.
    """
    names, value = parsed or parse(option)
    names = flatten_path(names)
    node: Any = data
    path: Path = ()
    new: Path | None = None
    for name, following in zip_longest(names, names[1:]):
        place: str | int = name
        if isinstance(node, list):
            place = _entry(node, name, option)
        elif not isinstance(node, dict):
            what = f"{'.'.join(map(str, path))} is {shorten(repr(node))}, not a table"
            raise InputFault(f"--set {shorten(option)}: {what}")
        path = (*path, place)
        if following is None:
            node[place] = value
        elif isinstance(node, dict) and not isinstance(node.get(name), dict | list):
            node[place] = [] if following == "+" else {}
            new = new or path
        node = node[place]
    return new or path


def _entry(entries: list[Any], name: str, option: str) -> int:
    if name == "+":
        entries.append({})
        return len(entries) - 1
    if re.fullmatch(r"[0-9]{1,9}", name) and int(name) < len(entries):
        return int(name)
    own = [
        e.get("name", e.get("replaces", i)) for i, e in enumerate(entries) if isinstance(e, dict)
    ]
    known = [str(entry) for entry in own]
    if name in known:
        return known.index(name)
    raise InputFault(f"--set {shorten(option)}: {unknown('entry', name, known)}")
