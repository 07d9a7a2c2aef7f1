"""Draws the buildings of the package, their rooms and imports to docs/figures/buildings.svg:

python docs/draw_buildings.py

`tests/test_rooms.py` holds the imports to the order given here, and the drawing to the imports.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
PATH = ROOT / "docs" / "figures" / "buildings.svg"
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
    "fmus": (".", "native", "engine"),
    "orchestrator": (
        "base",
        "host",
        "fmi",
        "boards",
        "holds",
        "scene",
        "system",
        "network",
        "plan",
        "results",
        "run",
        "ssp",
        ".",
    ),
    "programs": (".",),
    "analysis": (
        "findings",
        "sweep",
        "search",
        "stability",
        "maps",
        "tune",
        "transparency",
        "advise",
        "fit",
        "trials",
    ),
    "visualization": (
        ".",
        "mechanism",
        "figures",
        "browser_code",
        "live_and_standalone",
        "live_page",
        "standalone",
        "replay",
        "compare",
    ),
    "api": (".",),
    "commands": (".",),
}
"""Buildings in the order in which they may import each other, with their rooms, each of which may
import those before it; "." are loose files."""
PURPOSES = {
    "components": "equations, without FMI, files or clocks",
    "fmus": "components as FMUs",
    "orchestrator": "co-simulation of FMUs",
    "programs": "a scene as one FMU",
    "analysis": "what is computed about a scene or a run",
    "visualization": "what is drawn",
    "api": "import hapticlink",
    "commands": "the command line",
}
CODE = {".py", ".c", ".cpp", ".h", ".js", ".css", ".html"}
COLORS = ("#777777", "#997700", "#0077bb", "#009988", "#cc3311", "#ee7733", "#aa3377", "#333333")
"""Of the buildings and of the arrows that leave them."""
WIDTH, LEFT, ROW, LETTER = 840, 250, 30, 7.6
"""Of a building, of its name, height of a row of rooms, width of a letter (px)."""
LANE, GAP, HEAD = 22, 18, 8
"""Distance of the vertical lines, of the buildings, length of an arrow head (px)."""

Module = tuple[str, ...]


def _files() -> dict[Module, Path]:
    files = {}
    for building in BUILDINGS:
        for path in (ROOT / building).rglob("*.py"):
            module = path.relative_to(ROOT).with_suffix("").parts
            files[module[:-1] if module[-1] == "__init__" else module] = path
    return files


FILES = _files()
"""The files of the package by their module, `("fmus", "native", "compile")`."""


@cache
def imports(path: Path) -> list[Module]:
    """The modules of the project that a file imports anywhere in it, by either statement, or names
    in a string; () or a module of one name that is no building is the API."""
    return [*_imports(path)]


def _imports(path: Path) -> Iterator[Module]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
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


def arrows() -> dict[str, set[str]]:
    """By building, the other buildings that its files import."""
    targets: dict[str, set[str]] = {building: set() for building in BUILDINGS}
    for (building, *_), path in FILES.items():
        for module in imports(path):
            target = module[0] if module and module[0] in BUILDINGS else "api"
            if module[:1] != ("scenes",) and target != building:
                targets[building].add(target)
    return targets


def lines() -> dict[str, dict[str, int]]:
    """By building and room, the number of lines of code."""
    counts = {building: dict.fromkeys(rooms, 0) for building, rooms in BUILDINGS.items()}
    for building, rooms in counts.items():
        for path in (ROOT / building).rglob("*"):
            parts = path.relative_to(ROOT / building).parts
            if path.suffix in CODE:
                room = parts[0] if len(parts) > 1 else "."
                rooms.setdefault(room, 0)
                rooms[room] += path.read_bytes().count(b"\n")
    return counts


def _chips(building: str, rooms: dict[str, int], y: float) -> tuple[list[str], float]:
    """The rooms as SVG in rows from y on, and where the last row ends."""
    shapes, x = [], float(LEFT)
    for room, count in rooms.items():
        name = {".": "(loose files)", "browser_code": "browser_code (JavaScript)"}.get(room, room)
        text = f"{name} {count:,}"
        width = LETTER * len(text) + 14
        if x + width > WIDTH - 8:
            x, y = float(LEFT), y + ROW
        shapes.append(
            f'<rect x="{x:g}" y="{y:g}" width="{width:.0f}" height="{ROW - 6}" rx="4" '
            f'fill="white" stroke="#bbbbbb"/>'
            f'<text id="{building}/{room}" x="{x + 7:g}" y="{y + 16:g}">{escape(text)}</text>'
        )
        x += width + 6
    return shapes, y + ROW


def drawing() -> str:
    """The drawing as SVG: commands at the top, and for each building a line to those that it
    imports."""
    counts, order = lines(), [*reversed(BUILDINGS)]
    shapes, places, y = [], {}, 10.0
    for building in order:
        if len(counts[building]) > 1:
            chips, end = _chips(building, counts[building], y + 8)
        else:
            chips, end = [], y + 8 + ROW
        end = max(end, y + 62)
        color = COLORS[[*BUILDINGS].index(building)]
        total = sum(counts[building].values())
        shapes += [
            f'<rect x="10" y="{y:g}" width="{WIDTH - 10}" height="{end - y:g}" rx="6" '
            f'fill="#f6f6f4" stroke="{color}" stroke-width="2"/>',
            f'<text id="{building}" x="22" y="{y + 22:g}" font-weight="bold" font-size="15" '
            f'fill="{color}">{building} {total:,}</text>',
            f'<text x="22" y="{y + 40:g}" fill="#555555">',
            *_wrapped(PURPOSES[building]),
            "</text>",
            *chips,
        ]
        places[building] = (y, end)
        y = end + GAP
    for source, targets in arrows().items():
        index = [*BUILDINGS].index(source)
        color, lane = COLORS[index], WIDTH + LANE * index
        start = places[source][1] - 10
        for target in sorted(targets, key=[*BUILDINGS].index):
            end = places[target][0] + 8 * index
            shapes.append(
                f'<path id="{source} imports {target}" fill="none" stroke="{color}" '
                f'stroke-width="1.6" d="M{WIDTH} {start:g}H{lane}V{end:g}H{WIDTH + HEAD}"/>'
                f'<path fill="{color}" d="M{WIDTH} {end:g}l{HEAD} -4v8z"/>'
            )
    shapes.append(
        f'<text x="12" y="{y + 8:g}" fill="#555555">Boxes are buildings with their rooms and lines '
        "of code; a line leads from a building to those that it imports.</text>"
    )
    size = f'width="{WIDTH + LANE * len(BUILDINGS)}" height="{y + 20:g}"'
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" '
        'font-size="12.5" fill="#222222">',
        "<!-- python docs/draw_buildings.py -->",
        '<rect width="100%" height="100%" fill="white"/>',
        *shapes,
        "</svg>\n",
    ])  # fmt: skip


def _wrapped(text: str) -> list[str]:
    """A text of one or two lines, below each other."""
    words = text.split()
    first = " ".join(words[: len(words) // 2 + 1]) if len(text) > 30 else text
    rest = text[len(first) :].strip()
    second = [f'<tspan x="22" dy="15">{escape(rest)}</tspan>'] if rest else []
    return [f"<tspan>{escape(first)}</tspan>", *second]


if __name__ == "__main__":
    PATH.write_text(drawing(), encoding="utf-8")
    print(PATH)
