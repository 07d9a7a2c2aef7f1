"""Imports run one way: from room to room in the order below, and between files without a ring.

Imports inside functions and those for type checking count too, and so do modules that are named in
a string.
"""

from __future__ import annotations

import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from docs import draw_buildings
from docs.draw_buildings import BUILDINGS, FILES, ROOT, Module

FREE = ("fmus",)
"""Buildings whose rooms may import each other both ways."""
OUTSIDE = ("studies", "benchmarks", "fuzz", "tests", "docs")
"""Folders of the checkout that the package does not import."""

BY_NAME = {("commands", "checkout"), ("orchestrator", "base", "plugins")}
"""Files that import by name: benchmarks and studies of a checkout, a user's own modules."""


@cache
def imports(path: Path) -> list[Module]:
    return [*draw_buildings.imports(path)]


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
