"""TOML of bounded size and depth, which is read in a time in proportion to its length; its keys:
names of dotted keys, and the line of each key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import fields
from functools import lru_cache
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.plain_data import plain
from hapticlink.orchestrator.scene.scene_tables import Latency

LARGEST = 2**23
"""Bytes of a scene; a recorded trace of frames is a file of its own."""
DEEPEST = 32
"""Brackets within one another, and names of a dotted key."""

TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"""(?:"{0,2})|\Z)'  # multi-line strings may hold anything
    r"|'''.*?(?:'''(?:'{0,2})|\Z)"
    r'|"(?:\\.|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*"
    r"|[\[\]{}\n]",
    re.DOTALL,
)
"""Strings, comments, brackets and ends of lines. What is not closed goes to its end: looked at
once, as all else."""
_APART = re.compile("[=,]")


def loads(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises ValueError, for what is too deep too."""
    _require_shallow(text)
    return tomllib.loads(text)


def _require_shallow(text: str) -> None:
    """Because tomllib recurses into brackets and takes the square of a dotted key's length."""
    begin = names = 0
    around: list[int] = []  # names before each bracket that is open
    for token in TOKEN.finditer(text + "\n"):
        for i, part in enumerate(_APART.split(text[begin : token.start()])):
            names = part.count(".") + (0 if i else names)
            if names + sum(around) + len(around) >= DEEPEST:
                line = text.count("\n", 0, begin) + 1
                raise ValueError(f"more than {DEEPEST} names or brackets deep (at line {line})")
        begin = token.end()
        if token[0] in ("[", "{"):
            around.append(names)
        elif token[0] in ("]", "}"):
            names = around.pop() if around else 0
        if token[0] in ("[", "{", "\n"):
            names = 0


Path = tuple[str | int, ...]
Problem = tuple[Path, str]
"""A path of keys, and a message that says what is wrong there, with a remedy."""
Place = tuple[str, int]
"""File ("" for the scene itself) and line."""

_NAME = r"""(?:[\w-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+')"""
ASSIGNMENT = re.compile(rf"\s*+({_NAME}(?:\s*+\.\s*+{_NAME})*+)\s*+=")


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Line number and text of each table header or assignment, which may span several lines."""
    start, line, depth = 0, 1, 0
    for token in TOKEN.finditer(text + "\n"):
        if token[0] in "[{":
            depth += 1
        elif token[0] in "]}":
            depth -= 1
        elif token[0] == "\n" and depth <= 0:
            yield line, text[start : token.start()]
            line += text.count("\n", start, token.end())
            start, depth = token.end(), 0


@lru_cache(1024)  # the same keys in each scene that is read
def parts(dotted: str) -> tuple[str, ...]:
    """The names of a dotted key, quoted ones too. Raises ValueError."""
    node = loads(f"{dotted} = 0")
    names = []
    while isinstance(node, dict):
        name, node = next(iter(node.items()))
        names.append(name)
    return tuple(names)


def read_document(text: str) -> tuple[dict[str, Any], Mapping[Path, int]]:
    """The tables of a TOML text, and the line number of each path; entries of arrays of tables have
    their index in the path. Raises ValueError."""
    tables, lines = _read_once(text)
    return plain(tables), lines


@lru_cache(64)  # the same files in each variant of a scene
def _read_once(text: str) -> tuple[dict[str, Any], dict[Path, int]]:
    return loads(text), _key_lines(text)


def _key_lines(text: str) -> dict[Path, int]:
    """Of a text that is valid TOML."""
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


def written_path(path: Path, moved: Mapping[Path, int]) -> Path:
    """Where a scene's file has what is at `path` of tables with an FMU, or entries of `at`, for
    each connection from a signal; `moved`: by the place of each of them, and of the connections
    that are left, and of the start value that is the first text of a table, the index of the
    connection."""
    if (i := moved.get(path[:4])) is not None:
        return ("connection", i, "from", "table")
    if (i := moved.get(path[:2])) is None:
        return path
    rest = {"fmu": ("from", *path[3:]), "at": ("from", "table"), "connection": path[2:]}
    return ("connection", i, *rest[str(path[0])])


def place_of(path: Path, places: Mapping[Path, Place]) -> Place:
    """File and line of `path`, or of the nearest table around it; line 0 where there is none."""
    while path:
        if path in places:
            return places[path]
        path = path[:-1]
    return "", 0


@contextmanager
def collect_problem(problems: list[Problem], path: Path) -> Iterator[None]:
    """A ValueError or InputFault ends the context, and becomes a problem at `path`."""
    try:
        yield
    except (ValueError, InputFault) as error:
        problems.append((path, str(error)))


NAMED = ("holds", "delays", "kinds")
"""Tables whose keys are names of connections, which contain dots."""

LATENCY = {f.name for f in fields(Latency)}
LEAVES: dict[str, Set[str]] = {"delays": LATENCY, "holds": {"type"}}
"""Of these tables, the keys by which a table of theirs is a value."""


def flat(
    table: Mapping[str, Any], leaves: Set[str] = frozenset(), prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """The entries of nested tables under dotted names, `{"a": {"b": 1}}` as `a.b`. With `leaves`, a
    table that has one of these keys, or whose own key contains a dot, is a value."""
    for key, value in table.items():
        inside = isinstance(value, dict) and value
        if inside and not (leaves and ("." in key or value.keys() & leaves)):
            yield from flat(value, leaves, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def flatten(data: dict[str, Any]) -> None:
    """Replaces nested tables of `NAMED` in a scene's `data` by entries with dotted names."""
    for table in NAMED:
        if isinstance(data.get(table), dict):
            data[table] = dict(flat(data[table], LEAVES.get(table, frozenset())))


def flatten_path(names: tuple[Any, ...]) -> tuple[Any, ...]:
    """The path of a dotted key in the tables as `flatten` leaves them: the name of a connection is
    one part."""
    if names[0] not in NAMED or len(names) < 3 or "." in names[1]:
        return names
    end = len(names) - (names[0] == "delays" and names[-1] in LATENCY)
    return (names[0], ".".join(names[1:end]), *names[end:])


def value(data: Any, path: Path) -> Any:
    """The value at `path` of nested tables and arrays; None where there is none."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def entries(data: Any, *path: str) -> list[Any]:
    """The entries of an array of nested tables; none where there is no array."""
    found = value(data, path)
    return found if isinstance(found, list) else []


def path_of_user(table: str, user: str) -> Path:
    """Where a scene has a table of a user: [device], or [devices.NAME] of a further one."""
    return (f"{table}s", user) if user else (table,)


def tables_of_users(data: Any, table: str) -> list[tuple[Path, Any]]:
    """Path and content of what a scene has in the place of such tables."""
    further = value(data, (f"{table}s",))
    users = ("", *(further if isinstance(further, dict) else ()))
    return [(path, value(data, path)) for path in (path_of_user(table, user) for user in users)]
