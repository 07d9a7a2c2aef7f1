"""Imports run one way: from room to room in the order below, and between files without a ring; the
buildings stay small, a capability in its room, and a class and a scene key have their reason.

Imports inside functions and those for type checking count too, and so do modules that are named in
a string.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import is_dataclass
from graphlib import CycleError, TopologicalSorter
from typing import get_args

import pytest

from docs import draw_buildings
from docs.draw_buildings import BUILDINGS, FILES, ROOT, Module, imports
from hapticlink.components.forces import FORCES as FORCES  # a scene names its parts
from hapticlink.orchestrator.plan.schemes import SCHEMES as SCHEMES
from hapticlink.orchestrator.scene import types_of_keys
from hapticlink.orchestrator.scene.scene import Scene

FREE = ("fmus",)
"""Buildings whose rooms may import each other both ways."""
OUTSIDE = ("studies", "benchmarks", "fuzz", "tests", "docs")
"""Folders of the checkout that the package does not import."""

CODE_LINES = {
    "components": 7509,
    "fmus": 2995,
    "orchestrator": 16914,
    "programs": 1047,
    "analysis": 9216,
    "visualization": 3852,
    "api": 637,
    "commands": 1640,
}
"""The most lines of Python that a building may have, without blank lines, comments, docstrings and
imports. A number is raised only in a commit that says why."""

CAPABILITIES = {
    "network": (("orchestrator", "network"), 14),
    "engine": (("fmus", "engine"), 16),
    "spring": (("components",), 48),
    "program": (("programs",), 6),
}
"""Words of a capability: where it lives, and the most files outside of it that name it."""

PAGES = [
    *(ROOT / "scenes").rglob("*.toml"),
    *(p for folder in ("studies", "benchmarks") for p in (ROOT / folder).rglob("*.py")),
    *(p for p in (ROOT / "docs").glob("*.md") if p.stem not in ("scene-reference", "api")),
]
"""What sets the keys of scenes: shipped scenes, studies, benchmarks, and the pages of the guide."""

BY_NAME = {("commands", "checkout"), ("orchestrator", "base", "plugins")}
"""Files that import by name: benchmarks and studies of a checkout, a user's own modules."""


def _room(module: Module) -> str:
    path = FILES[module].relative_to(ROOT).parts
    return path[1] if len(path) > 2 else "."


def test_buildings_import_one_way() -> None:
    order = list(BUILDINGS)
    for module, path in FILES.items():
        for imported in imports(path):
            package = imported[0] if imported else ""
            if package == "scenes":  # which hold no code
                continue
            if package not in order:  # the API's own names, which commands alone use
                assert module[0] == "commands", f"{module} imports the API, which imports it"
                continue
            assert order.index(package) <= order.index(module[0]), f"{module} {imported}"


def test_nothing_outside_is_imported() -> None:
    for module, path in FILES.items():
        assert not re.search(
            rf"^\s*(from|import)\s+({'|'.join(OUTSIDE)})\b", path.read_text(), re.M
        ), module


@pytest.mark.parametrize("package", [name for name in BUILDINGS if name not in FREE])
def test_rooms_import_those_before_them(package: str) -> None:
    order = BUILDINGS[package]
    rooms = {_room(module) for module in FILES if module[0] == package and module != (package,)}
    assert rooms == set(order)
    against = [
        f"{'.'.join(module)} imports {'.'.join(imported)}"
        for module, path in FILES.items()
        for imported in imports(path)
        if module[0] == package and imported[:1] == (package,) != imported
        if order.index(_room(imported)) > order.index(_room(module))
    ]
    assert not against


def test_files_import_each_other_in_no_ring() -> None:
    graph = {m: {i for i in imports(p) if i in FILES and i != m} for m, p in FILES.items()}
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as ring:
        pytest.fail(" -> ".join(".".join(module) for module in ring.args[1]))


def test_no_import_is_hidden_in_a_string() -> None:
    """Processes are started by module name, commands are imported when they are called (cyclopts);
    a user's own modules are named by the user."""
    for module, path in FILES.items():
        text = path.read_text()
        if module in BY_NAME:
            continue
        assert "import_module" not in text, path
        assert "__import__" not in text, path


def test_the_drawing_of_the_buildings_is_current() -> None:
    """The same buildings, rooms and arrows; lines of code within a sixth, or a hundred."""
    drawn, current = draw_buildings.PATH.read_text(encoding="utf-8"), draw_buildings.drawing()
    redraw = "run `python docs/draw_buildings.py`"
    arrows = re.compile(r'id="(\w+ imports \w+)"')
    assert arrows.findall(drawn) == arrows.findall(current), redraw
    label = re.compile(r'<text id="(.+?)".*?>[^<]*? ([\d,]+)</text>')
    lines, now = (
        {name: int(count.replace(",", "")) for name, count in label.findall(text)}
        for text in (drawn, current)
    )
    assert lines.keys() == now.keys() >= {*BUILDINGS}, redraw
    assert lines == {n: pytest.approx(count, rel=1 / 6, abs=100) for n, count in now.items()}, (
        redraw
    )


def _code_lines(text: str) -> int:
    apart = set()
    for node in ast.walk(ast.parse(text)):
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if docstring or isinstance(node, ast.Import | ast.ImportFrom):
            apart.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return sum(1 for n, line in lines if line and line[0] != "#" and n not in apart)


def test_no_building_has_more_code_than_its_budget() -> None:
    found = Counter[str]()
    for (building, *_), path in FILES.items():
        found[building] += _code_lines(path.read_text(encoding="utf-8"))
    over = [
        f"{b} had {had} lines and has {found[b]}" for b, had in CODE_LINES.items() if found[b] > had
    ]
    said = "; ".join(over)
    assert not over, f"{said}: take out as much as you add, or say in the commit why it has to grow"


@pytest.mark.parametrize("word", CAPABILITIES)
def test_a_capability_is_named_in_few_files_outside_of_its_room(word: str) -> None:
    room, most = CAPABILITIES[word]
    outside = [
        ".".join(module)
        for module, path in FILES.items()
        if module[: len(room)] != room
        and re.search(rf"(?<![a-z]){word}", path.read_text(encoding="utf-8"), re.I)
    ]
    assert len(outside) <= most, outside


def test_a_class_has_a_name_of_its_own() -> None:
    files: dict[str, list[str]] = {}
    for module, path in FILES.items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                files.setdefault(node.name, []).append(".".join(module))
    twice = {name: where for name, where in files.items() if len(where) > 1}
    assert not twice


def test_every_scene_key_is_set_by_a_scene_a_study_or_a_page() -> None:
    """By its name: `key = value`, `"key": value`, `[table.key]`, or `key` as code of a page."""
    known = " ".join(path.read_text(encoding="utf-8") for path in PAGES)
    named = {*re.findall(r"(\w+)(?:[`\]]|[\"']?\s*[=:])", known), *re.findall(r"\[(\w+)\.", known)}
    keys = {(r.__name__, key) for r in _tables(Scene, set()) for key in types_of_keys.hints(r)}
    assert not sorted((record, key) for record, key in keys if key not in named)


def _tables(record: type, found: set[type]) -> set[type]:
    """A record of a scene and those of the tables within it."""
    if record not in found:
        found.add(record)
        kinds = [k for hint in types_of_keys.hints(record).values() for k in _parts(hint)]
        for kind in kinds:
            _tables(kind, found)
    return found


def _parts(hint: object) -> Iterator[type]:
    for kind in types_of_keys.branches(hint):
        if is_dataclass(kind):
            yield kind
        elif get_args(kind):
            yield from (part for inner in get_args(kind) for part in _parts(inner))
