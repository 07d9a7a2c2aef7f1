"""An N-squared chart: boxes on a diagonal, and what goes from one to another where the row of the
source meets the column of the target. What comes from outside enters the columns from above, and
what leaves goes to the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hapticlink.visualization.figure_axes import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0077bb", "#ee7733", "#009988", "#aa3377", "#777777")
"""Of groups of boxes, such as those of one clock; further ones take the last."""
LINE, GAP, LETTER = 0.15, 0.4, 0.06
"""Height of a line of text, distance of rows, width of a letter (in)."""
SIDE = 0.88
"""Width of a box over that of its column."""
HELD = "#fff3e6"
"""Of a cell with a hold."""


@dataclass(frozen=True)
class Box:
    """A box: a name, further lines, which may be formulae, and its group, by which it is
    coloured."""

    name: str
    lines: tuple[str, ...]
    group: int


@dataclass(frozen=True)
class Chart:
    """Lines of text by pair of boxes, and by box of what comes from outside and leaves."""

    boxes: Sequence[Box]
    cells: Mapping[tuple[int, int], list[str]]
    incoming: Mapping[int, list[str]]
    leaving: Mapping[int, list[str]]


def draw(chart: Chart, title: str, note: str, width: float) -> Figure:
    """The chart, with columns of `width` (in)."""
    from matplotlib.figure import Figure

    boxes, cells = chart.boxes, chart.cells
    tall = [_tall(box) for box in boxes]
    heights = [
        max([tall[i], *(LINE * len(v) for (row, _), v in cells.items() if row == i)]) + GAP
        for i in range(len(boxes))
    ]
    above = LINE * max((len(lines) for lines in chart.incoming.values()), default=0)
    above += 0.35 * bool(above)
    beside = LETTER * max((len(t) for lines in chart.leaving.values() for t in lines), default=0)
    beside += 0.35 * bool(beside)
    size = (max(width * len(boxes) + 0.2 + beside, 4.0), sum(heights) + 0.75 + above)
    figure = Figure(figsize=size)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, size[0]), ylim=(0, size[1]))
    axes.axis("off")
    axes.text(0.12, size[1] - 0.22, plain(title), va="center", fontsize="medium")
    axes.text(0.12, size[1] - 0.45, note, va="center", fontsize="small", color="0.4")
    top = size[1] - 0.65 - above
    rows = [top - sum(heights[:i]) - heights[i] / 2 for i in range(len(boxes))]
    columns = [0.1 + width * (i + 0.5) for i in range(len(boxes))]
    for i, lines in chart.incoming.items():
        edge = rows[i] + tall[i] / 2
        _arrow(axes, [(columns[i], top), (columns[i], edge)])
        axes.text(columns[i], top + 0.05, plain("\n".join(lines)), ha="center", fontsize=7.5)
    for i, lines in chart.leaving.items():
        end = size[0] - beside
        _arrow(axes, [(columns[i], rows[i]), (end, rows[i])])
        axes.text(end + 0.08, rows[i], plain("\n".join(lines)), va="center", fontsize=7.5)
    for (i, j), lines in cells.items():
        edge = rows[j] + tall[j] / 2 * (1 if rows[i] > rows[j] else -1)
        corner = columns[j], rows[i]
        _arrow(axes, [(columns[i], rows[i]), corner, (columns[j], edge)])
        held = any("," in line for line in lines)
        axes.text(
            *corner, plain("\n".join(lines)), ha="center", va="center", fontsize=7.5, zorder=3,
            bbox={"boxstyle": "round,pad=0.25", "fc": HELD if held else "w", "ec": "0.75"},
        )  # fmt: skip
    for i, box in enumerate(boxes):
        _draw_box(axes, (columns[i], rows[i]), (SIDE * width, tall[i]), box)
    return figure


def _height(line: str) -> float:
    """Of a line in a box (in)."""
    return LINE * (1.25 if "$" in line else 1.0)


def _tall(box: Box) -> float:
    """The height of a box (in)."""
    return max(3.4 * LINE, 1.9 * LINE + sum(map(_height, box.lines)))


def _arrow(axes: Axes, points: list[tuple[float, float]]) -> None:
    """A line through the points, with its head at the last one."""
    *before, last, end = points
    for a, b in zip([*before, last][:-1], [*before, last][1:], strict=True):
        axes.plot([a[0], b[0]], [a[1], b[1]], color="0.55", lw=1.0, zorder=1)
    style = {"arrowstyle": "-|>", "color": "0.55", "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, last, zorder=1, arrowprops=style)


def _draw_box(axes: Axes, center: tuple[float, float], size: tuple[float, float], box: Box) -> None:
    from matplotlib.patches import FancyBboxPatch

    (x, y), (width, height) = center, size
    shape = FancyBboxPatch(
        (x - width / 2, y - height / 2), width, height,
        boxstyle="round,pad=0,rounding_size=0.06", ec="none", zorder=2,
        fc=COLORS[min(box.group, len(COLORS) - 1)],
    )  # fmt: skip
    axes.add_patch(shape)
    heights = [LINE, *map(_height, box.lines)]
    level = y + sum(heights) / 2
    for line, tall in zip((box.name, *box.lines), heights, strict=True):
        text, size_pt = (
            (line, 8.5) if "$" in line else (plain(line), 8.5 if line is box.name else 7.5)
        )
        level -= tall
        axes.text(
            x, level + tall / 2, text, ha="center", va="center", color="w", fontsize=size_pt,
            fontweight="bold" if line is box.name else "normal", zorder=4,
        )  # fmt: skip
