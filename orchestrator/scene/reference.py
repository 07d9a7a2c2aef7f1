"""The reference page of scenes, made from the records: every key of every table."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, is_dataclass
from typing import Any

from hapticlink.orchestrator.scene import key_descriptions, schema
from hapticlink.orchestrator.scene.scene import Scene

_INTRODUCTION = """# Scene reference

Every key of every table of a scene, made from its records by `hapticlink schema --markdown`.
[Scenes](scenes.md) tells how they go together. A number is finite and within its range; a default
of - is left out, and has no term in the equations, no input and no parameter. An editor that knows
JSON schemas tells the same while one writes: `hapticlink schema > scene.schema.json`, and
`#:schema scene.schema.json` as the first line of the scene.
"""
_HEAD = "| key | type | unit | range | default | meaning |\n|---|---|---|---|---|---|"


def page() -> str:
    """The page, as Markdown."""
    tables: dict[Any, list[str]] = {Scene: ["Top level"]}
    _tables(Scene, "", tables)
    sections = [_section(record, headings) for record, headings in tables.items()]
    return "\n".join([_INTRODUCTION, *sections])


def _tables(record: Any, path: str, found: dict[Any, list[str]]) -> None:
    """The headers under which a file writes each record, a table's own tables after it."""
    for key, hint in schema.hints(record).items():
        for table, header in _headers(hint, f"{path}{key}"):
            found.setdefault(table, []).append(header)
            if len(found[table]) == 1:
                _tables(table, f"{header.strip('[]')}.", found)


def _headers(hint: Any, path: str) -> Iterator[tuple[Any, str]]:
    for kind in schema.branches(hint):
        if is_dataclass(kind):
            yield kind, f"[{path}]"
        elif typing.get_origin(kind) is tuple and is_dataclass(typing.get_args(kind)[0]):
            yield typing.get_args(kind)[0], f"[[{path}]]"
        elif typing.get_origin(kind) is Mapping:
            yield from _headers(typing.get_args(kind)[1], f"{path}.NAME")


def _section(record: Any, headers: list[str]) -> str:
    title = ", ".join(h if h == "Top level" else f"`{h}`" for h in dict.fromkeys(headers))
    if len(types := schema.types(record)) == 1:
        title += f' with `type = "{types[0]}"`'
    rows = (_row(record, key, hint) for key, hint in schema.hints(record).items())
    return "\n".join([f"## {title}\n", f"{key_descriptions.about(record)}\n", _HEAD, *rows, ""])


def _row(record: Any, key: str, hint: Any) -> str:
    kind = key_descriptions.words(hint).removeprefix("a ")
    cells = [
        f"`{key}`",
        kind,
        key_descriptions.unit(hint),
        key_descriptions.limits(hint),
        _default(schema.default(record, key)),
        key_descriptions.meanings(record)[key],
    ]
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _default(value: Any) -> str:
    if value is MISSING:
        return "required"
    if value is None or value == () or value == {}:
        return "-"
    if is_dataclass(value):
        return "its defaults"
    if isinstance(value, tuple):
        return f"[{', '.join(_default(entry) for entry in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value).removesuffix(".0")
