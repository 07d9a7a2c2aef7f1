"""The block diagram of a system: its FMUs on a diagonal, the signals from one to another where the
row of the source meets the column of the target (an N-squared chart)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hapticlink.visualization.figure_axes import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hapticlink.orchestrator.system.system import Connection, Fmu, System

COLORS = ("#0077bb", "#ee7733", "#009988", "#aa3377", "#777777")
"""Of the clocks, in the order of the timeline; further ones take the last."""
WIDTH, LINE, GAP = 1.75, 0.15, 0.5
"""Of a column, of a line of text, between rows (in)."""
BOX = 3.4
"""Height of an FMU's box in lines."""


def figure(system: System, title: str) -> Figure:
    """The FMUs with rate and timing, in the colour of their clock; each signal with the input that
    it leads to, if that has another name, and with its hold where one bridges two rates."""
    from matplotlib.figure import Figure

    names = [fmu.name for fmu in system.fmus]
    cells: dict[tuple[int, int], list[str]] = {}
    for connection in system.connections:
        pair = names.index(connection.source), names.index(connection.target)
        cells.setdefault(pair, []).append(_label(connection))
    heights = [
        LINE * max([BOX, *(len(lines) for (row, _), lines in cells.items() if row == i)]) + GAP
        for i in range(len(names))
    ]
    size = (max(WIDTH * len(names) + 0.2, 4.0), sum(heights) + 0.75)
    drawn = Figure(figsize=size)
    axes = drawn.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, size[0]), ylim=(0, size[1]))
    axes.axis("off")
    axes.text(0.12, size[1] - 0.22, plain(title), va="center", fontsize="medium")
    axes.text(
        0.12, size[1] - 0.45, "outputs leave to the side, inputs enter from above or below",
        va="center", fontsize="small", color="0.4",
    )  # fmt: skip
    top = size[1] - 0.65
    rows = [top - sum(heights[:i]) - heights[i] / 2 for i in range(len(names))]
    columns = [0.1 + WIDTH * (i + 0.5) for i in range(len(names))]
    for (i, j), lines in cells.items():
        _arrow(axes, (columns[i], rows[i]), (columns[j], rows[j]), lines)
    for i, fmu in enumerate(system.fmus):
        _box(axes, columns[i], rows[i], fmu, system)
    return drawn


def _label(connection: Connection) -> str:
    """`x -> x_S, zoh`, `x` where the input has the same name."""
    to = connection.target_port
    text = connection.source_port + (f" \N{RIGHTWARDS ARROW} {to}" * (to != connection.source_port))
    if connection.initial:
        return f"{text} (start)"
    return f"{text}, {connection.hold}" if connection.hold else text


def _arrow(
    axes: Axes, source: tuple[float, float], target: tuple[float, float], lines: list[str]
) -> None:
    """From the side of the source's box to the column of the target, and to its top or bottom."""
    (x, y), (to, end) = source, target
    edge = end + BOX / 2 * LINE * (1 if y > end else -1)
    axes.plot([x, to], [y, y], color="0.55", lw=1.0, zorder=1)
    axes.annotate(
        "", (to, edge), (to, y), zorder=1,
        arrowprops={"arrowstyle": "-|>", "color": "0.55", "lw": 1.0, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    held = any("," in line for line in lines)
    axes.text(
        to, y, plain("\n".join(lines)), ha="center", va="center", fontsize=7.5, zorder=3,
        bbox={"boxstyle": "round,pad=0.25", "fc": "#fff3e6" if held else "w", "ec": "0.75"},
    )  # fmt: skip


def _box(axes: Axes, x: float, y: float, fmu: Fmu, system: System) -> None:
    from matplotlib.patches import FancyBboxPatch

    clocks = [clock.name for clock in system.timeline.clocks]
    color = COLORS[min(clocks.index(fmu.clock), len(COLORS) - 1)]
    width, height = 0.86 * WIDTH, BOX * LINE
    shape = FancyBboxPatch(
        (x - width / 2, y - height / 2), width, height,
        boxstyle="round,pad=0,rounding_size=0.06", fc=color, ec="none", zorder=2,
    )  # fmt: skip
    axes.add_patch(shape)
    timing, steps = "sampled" if fmu.sampled else "plant", system.timeline.clock(fmu.clock).period
    rate = f"{1 / system.timeline.seconds(steps):.4g} Hz" if steps else "rate varies"
    axes.text(
        x, y, f"{fmu.name}\n{timing}, {rate}", ha="center", va="center", color="w",
        fontsize=8.5, zorder=4,
    )  # fmt: skip
