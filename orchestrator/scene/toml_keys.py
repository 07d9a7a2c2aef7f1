"""The keys of a TOML file: the names of a dotted one, and the line on which each stands."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Set
from dataclasses import fields
from typing import Any

from hapticlink.orchestrator.scene.records import Latency

Path = tuple[str | int, ...]
Problem = tuple[Path, str]
"""A path of keys, and what is wrong there with its remedy."""
Place = tuple[str, int]
"""File ("" for the scene itself) and line."""

_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'  # multi-line strings may hold anything
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*"
    r"|[\[\]{}\n]",
    re.DOTALL,
)
ASSIGNMENT = re.compile(r"""\s*((?:[\w-]|"(?:\\.|[^"\\])*"|'[^']*'|\s*\.\s*)+)\s*=""")


def _statements(text: str) -> list[tuple[int, str]]:
    """(line number, text) of each header or assignment, values over several lines in one."""
    found, start, depth = [], 0, 0
    for token in _TOKEN.finditer(text + "\n"):
        if token[0] in "[{":
            depth += 1
        elif token[0] in "]}":
            depth -= 1
        elif token[0] == "\n" and depth <= 0:
            found.append((text.count("\n", 0, start) + 1, text[start : token.start()]))
            start, depth = token.end(), 0
    return found


def parts(dotted: str) -> tuple[str, ...]:
    """The names of a dotted key, quoted ones too. Raises tomllib.TOMLDecodeError."""
    node = tomllib.loads(f"{dotted} = 0")
    names = []
    while isinstance(node, dict):
        name, node = next(iter(node.items()))
        names.append(name)
    return tuple(names)


def key_lines(text: str) -> dict[Path, int]:
    """Line numbers by path; entries of [[arrays]] of tables have their index in the path.

    `text` has been parsed as TOML without an error.
    """
    lines: dict[Path, int] = {}
    counts: dict[Path, int] = {}
    table: Path = ()

    def resolve(names: tuple[str, ...]) -> Path:
        path: Path = ()
        for name in names:
            path = (*path, name)
            if path in counts:
                path = (*path, counts[path] - 1)
        return path

    for number, statement in _statements(text):
        stripped = statement.split("\n")[0].strip()
        if stripped.startswith("[["):
            names = parts(stripped[2 : stripped.index("]]")])
            array = (*resolve(names[:-1]), names[-1])
            counts[array] = counts.get(array, 0) + 1
            table = (*array, counts[array] - 1)
            lines.setdefault(array, number)
            lines[table] = number
        elif stripped.startswith("["):
            table = resolve(parts(stripped[1 : stripped.rindex("]")]))
            lines.setdefault(table, number)
        elif match := ASSIGNMENT.match(statement):
            path = table
            for name in parts(match[1]):
                path = (*path, name)
                lines.setdefault(path, number)
    return lines


def place_of(path: Path, places: Mapping[Path, Place]) -> Place:
    """Where `path` stands, or the nearest table that holds it; line 0 where none does."""
    while path:
        if path in places:
            return places[path]
        path = path[:-1]
    return "", 0


NAMED = ("holds", "delays", "kinds")


LATENCY = {f.name for f in fields(Latency)}


def flat(
    table: Mapping[str, Any], leaves: Set[str] = frozenset(), prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """The entries of a table under their whole names; a value with one of the keys `leaves`, or
    under a whole name, is a table of its own."""
    for key, value in table.items():
        inside = isinstance(value, dict) and value
        if inside and not (leaves and ("." in key or value.keys() & leaves)):
            yield from flat(value, leaves, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def flatten(data: dict[str, Any]) -> None:
    """Writes the scene's own such tables under whole names."""
    for table in NAMED:
        if isinstance(data.get(table), dict):
            data[table] = dict(flat(data[table], LATENCY if table == "delays" else frozenset()))


def whole(names: tuple[Any, ...]) -> tuple[Any, ...]:
    """The path of the names of a dotted key, in the tables that `flatten` has written."""
    if names[0] not in NAMED or len(names) < 3 or "." in names[1]:
        return names
    end = len(names) - (names[0] == "delays" and names[-1] in LATENCY)
    return (names[0], ".".join(names[1:end]), *names[end:])


def value(data: Any, path: Path) -> Any:
    """What stands at `path`, None where nothing does."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data
