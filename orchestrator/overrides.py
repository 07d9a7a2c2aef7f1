"""`--set key=value`: a scene's keys changed before it is checked."""

from __future__ import annotations

import difflib
import tomllib
from typing import Any

from hapticlink.orchestrator.faults import InputFault
from hapticlink.orchestrator.toml_lines import Path


def parse(option: str) -> tuple[tuple[str, ...], Any]:
    """The names of the dotted key, and the value as TOML or else as text.

    Raises InputFault where there is no `=` or no key.
    """
    key, equals, text = option.partition("=")
    names = tuple(name.strip() for name in key.split("."))
    if not equals or not all(names):
        raise InputFault(f"--set {option}: write key=value, e.g. --set graphics.rate=10")
    try:
        return names, tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return names, text.strip()


def apply(data: dict[str, Any], option: str) -> Path:
    """Set the key in `data`, and give the path of what is new: the key, or a table made for it.

    Entries of an array of tables go by their name or by their place (from 0):
    `linkage.body.link1.mass=2`. Raises InputFault where there is no such entry.
    """
    names, value = parse(option)
    node: Any = data
    path: Path = ()
    new: Path | None = None
    for name, last in zip(names, (*(False for _ in names[1:]), True), strict=True):
        place: str | int = name
        if isinstance(node, list):
            place = _entry(node, name, option)
        elif not isinstance(node, dict):
            raise InputFault(f"--set {option}: {'.'.join(map(str, path))} is {node!r}, not a table")
        path = (*path, place)
        if last:
            node[place] = value
        elif isinstance(node, dict) and not isinstance(node.get(name), dict | list):
            node[place] = {}
            new = new or path
        node = node[place]
    return new or path


def _entry(entries: list[Any], name: str, option: str) -> int:
    if name.isdigit() and int(name) < len(entries):
        return int(name)
    known = [str(e.get("name", i)) for i, e in enumerate(entries) if isinstance(e, dict)]
    if name in known:
        return known.index(name)
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
    raise InputFault(f"--set {option}: no entry {name!r}; {hint}")
