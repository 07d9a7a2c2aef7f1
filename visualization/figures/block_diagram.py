"""The block diagram of a system: its FMUs and the signals from one to another, as an N-squared
chart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hapticlink.visualization.figures import diagonal_chart
from hapticlink.visualization.figures.diagonal_chart import Box, Chart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hapticlink.orchestrator.system.system import Connection, Fmu, System

WIDTH = 1.75
"""Of a column (in)."""
TIMING = {"sampled": "sampled", "continuous": "plant", "frame": "frames"}
"""What a box says of its FMU."""


def figure(system: System, title: str) -> Figure:
    """The FMUs with rate and timing, in the colour of their clock; each signal with the input that
    it leads to, if that has another name, and with its hold where one bridges two rates."""
    names = [fmu.name for fmu in system.fmus]
    cells: dict[tuple[int, int], list[str]] = {}
    for connection in system.connections:
        pair = names.index(connection.source), names.index(connection.target)
        cells.setdefault(pair, []).append(label(connection))
    boxes = [_box(fmu, system) for fmu in system.fmus]
    note = "outputs leave to the side, inputs enter from above or below"
    return diagonal_chart.draw(Chart(boxes, cells, {}, {}), title, note, WIDTH)


def label(connection: Connection) -> str:
    """`x -> x_S, zoh`, `x` where the input has the same name."""
    to = connection.target_port
    text = connection.source_port + (f" \N{RIGHTWARDS ARROW} {to}" * (to != connection.source_port))
    if connection.initial:
        return f"{text} (start)"
    return f"{text}, {connection.hold}" if connection.hold else text


def _box(fmu: Fmu, system: System) -> Box:
    clocks = [clock.name for clock in system.timeline.clocks]
    timing, steps = TIMING[fmu.description.timing], system.timeline.clock(fmu.clock).period
    rate = f"{1 / system.timeline.seconds(steps):.4g} Hz" if steps else "rate varies"
    return Box(fmu.name, (f"{timing}, {rate}",), clocks.index(fmu.clock))
