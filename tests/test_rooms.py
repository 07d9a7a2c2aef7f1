"""Imports run one way: from room to room in the order below, and between files without a ring.

Imports inside functions and those for type checking count too, and so do modules that are named in
a string.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BUILDINGS = {
    "components": (
        ".",
        "integrators",
        "specs",
        "paths",
        "linkage",
        "forces",
        "dynamics",
        "contact",
        "control",
        "device",
        "blocks",
    ),
    "fmus": (".", "native"),
    "orchestrator": (
        "base",
        "fmi",
        "holds",
        "scene",
        "system",
        "plan",
        "results",
        "run",
        "ssp",
        ".",
    ),
    "programs": (".",),
    "analysis": ("findings", "stability", "sweep", "maps", "tune"),
    "visualization": (".", "mechanism", "figures", "live", "replay", "compare"),
    "api": (".",),
    "commands": (".",),
}
"""Buildings in the order in which they may import each other, with their rooms, each of which may
import those before it; "." are loose files."""
FREE = ("fmus",)
"""Buildings whose rooms may import each other both ways."""
OUTSIDE = ("studies", "benchmarks", "tests", "docs")
"""Folders of the checkout that the package does not import."""

Module = tuple[str, ...]
BY_NAME = {("commands", "checkout"), ("orchestrator", "base", "plugins")}
"""Files that import by name: benchmarks and studies of a checkout, a user's own modules."""


def _files() -> dict[Module, Path]:
    found = {}
    for package in BUILDINGS:
        for path in (ROOT / package).rglob("*.py"):
            module = path.relative_to(ROOT).with_suffix("").parts
            found[module[:-1] if module[-1] == "__init__" else module] = path
    return found


FILES = _files()


def _imports(path: Path) -> Iterator[Module]:
    """The modules of the project that a file imports anywhere in it, by either statement, or names
    in a string; () or a module of one name that is no package is the API."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            named = [tuple(name.name.split(".")) for name in node.names]
            yield from (module[1:] for module in named if module[0] == "hapticlink")
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: a relative import, which names no room"
            module = tuple((node.module or "").split("."))
            if module[0] == "hapticlink":
                for name in node.names:
                    inner = (*module[1:], name.name)
                    yield inner if inner in FILES or len(inner) == 1 else module[1:]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named_in_text = tuple(node.value.split("."))
            if named_in_text[0] == "hapticlink" and named_in_text[1:] in FILES:
                yield named_in_text[1:]


def _room(module: Module) -> str:
    path = FILES[module].relative_to(ROOT).parts
    return path[1] if len(path) > 2 else "."


def test_buildings_import_one_way() -> None:
    order = list(BUILDINGS)
    for module, path in FILES.items():
        for imported in _imports(path):
            package = imported[0] if imported else ""
            if package == "scenes":  # which hold no code
                continue
            if package not in order:  # the API's own names, which commands alone use
                assert module[0] == "commands", f"{module} imports the API, which imports it"
                continue
            assert order.index(package) <= order.index(module[0]), f"{module} {imported}"


def test_nothing_outside_is_imported() -> None:
    for module, path in FILES.items():
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            assert not {name.partition(".")[0] for name in names} & {*OUTSIDE}, module


@pytest.mark.parametrize("package", [name for name in BUILDINGS if name not in FREE])
def test_rooms_import_those_before_them(package: str) -> None:
    order = BUILDINGS[package]
    rooms = {_room(module) for module in FILES if module[0] == package and module != (package,)}
    assert rooms == set(order)
    against = [
        f"{'.'.join(module)} imports {'.'.join(imported)}"
        for module, path in FILES.items()
        for imported in _imports(path)
        if module[0] == package and imported[:1] == (package,) != imported
        if order.index(_room(imported)) > order.index(_room(module))
    ]
    assert not against


def test_files_import_each_other_in_no_ring() -> None:
    graph = {m: {i for i in _imports(p) if i in FILES and i != m} for m, p in FILES.items()}
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
