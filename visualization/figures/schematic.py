"""Schematics of the insides of blocks: the parts that their components declare, with equations, and
the signals between them; as the report's figures 3.2, 3.5, 4.3, 4.4 and B.3, for the scene at hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from textwrap import wrap
from typing import TYPE_CHECKING

from hapticlink.fmus.blocks import component
from hapticlink.orchestrator.base.signal_names import CONTROLLER, DEVICE, ENVIRONMENT, MECHANISM
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization.figures import diagonal_chart
from hapticlink.visualization.figures.block_diagram import label
from hapticlink.visualization.figures.diagonal_chart import LETTER, SIDE, Box, Chart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hapticlink.components.component import Component, Variable
    from hapticlink.components.schematic_parts import BlockPart
    from hapticlink.orchestrator.system.system import System

WIDTH = 2.2
"""Of a column (in)."""
LETTERS = int(SIDE * WIDTH / LETTER)
"""Of a line in a box."""
NOTE = (
    "what a part gives leaves to the side, what it reads enters from above or below; "
    "the last line is its place in the report"
)

TOGETHER = {"device": (CONTROLLER, DEVICE), "simulation": (MECHANISM, ENVIRONMENT)}
"""Blocks that the report draws in one figure: 4.3, and 4.4 or B.3."""


def figures(scene: Scene, system: System) -> dict[str, Figure]:
    """By the name of its file, the inside of each block of the scene that is built from a component
    with parts; and of the blocks of TOGETHER where the scene has them, without parts that give only
    what no block reads."""
    components = {plan.name: component(plan.block, plan.settings) for plan in blocks(scene).built}
    drawn = {name: found for name, found in components.items() if found.parts}
    figures = {
        f"inside-{name.replace('_', '-')}": figure({name: found}, system, f"Inside of {name}")
        for name, found in drawn.items()
    }
    for name, both in TOGETHER.items():
        if all(block in drawn for block in both):
            of = {block: _without_unread(drawn[block], block, system) for block in both}
            figures[name] = figure(
                of, system, f"Inside of {' and '.join(both)}, without what no block reads"
            )
    return figures


def _without_unread(of: Component, block: str, system: System) -> Component:
    """The component with the parts that other blocks depend on, and the outputs that they read."""
    read = {c.source_port for c in system.connections if c.source == block}
    needed = set(read)
    count = -1
    while count < len(needed):
        count = len(needed)
        for part in of.parts:
            if needed & {*part.gives}:
                needed |= {*part.reads}
    outputs = tuple(v for v in of.outputs if v.name in read)
    parts = tuple(part for part in of.parts if needed & {*part.gives})
    return replace(of, outputs=outputs, parts=parts)


def figure(of: Mapping[str, Component], system: System, title: str) -> Figure:
    """The parts of the components, by block of the system, each block in a colour."""
    return diagonal_chart.draw(_Wires(of, system).chart(), title, NOTE, WIDTH)


class _Wires:
    """Who gives what to whom, within the components and from outside."""

    def __init__(self, of: Mapping[str, Component], system: System) -> None:
        self._of, self._system = of, system
        self._parts = [(block, part) for block, found in of.items() for part in found.parts]
        self._giver = {(b, n): i for i, (b, part) in enumerate(self._parts) for n in part.gives}
        self._feeds = {(c.target, c.target_port): c for c in system.connections}

    def chart(self) -> Chart:
        cells: dict[tuple[int, int], list[str]] = {}
        outside: dict[int, dict[str, list[str]]] = {}
        for j, (block, part) in enumerate(self._parts):
            inputs = {v.name for v in self._of[block].inputs}
            for name in part.reads:
                fed = self._feeds.get((block, name))
                giver = self._giver.get((fed.source, fed.source_port) if fed else (block, name))
                text = label(fed) if fed else name
                if giver is not None and giver != j:
                    cells.setdefault((giver, j), []).append(text)
                elif giver is None and (fed or name in inputs):
                    source = f"from {fed.source}:" if fed else "not connected:"
                    outside.setdefault(j, {}).setdefault(source, []).append(text)
        incoming = {
            j: [line for source, names in of.items() for line in (source, *names)]
            for j, of in outside.items()
        }
        groups = list(self._of)
        boxes = [Box(p.name, tuple(self._lines(b, p)), groups.index(b)) for b, p in self._parts]
        return Chart(boxes, cells, incoming, dict(self._leaving()))

    def _lines(self, block: str, part: BlockPart) -> Iterator[str]:
        """The equation, the gains, and the source."""
        yield from part.equation.split("\n")
        values = {v.name: v for v in self._of[block].parameters}
        for name in part.reads:
            if name in values:
                yield from wrap(_value(values[name]), LETTERS)
        if part.source:
            yield part.source

    def _leaving(self) -> Iterator[tuple[int, list[str]]]:
        """By part, the outputs that other blocks read, and those that nothing reads."""
        read = {(c.source, c.source_port) for c in self._system.connections}
        for i, (block, part) in enumerate(self._parts):
            outputs = {v.name for v in self._of[block].outputs}
            lines = [*self._read_outside(block, part)]
            lines += [n for n in part.gives if n in outputs and (block, n) not in read]
            if lines:
                yield i, lines

    def _read_outside(self, block: str, part: BlockPart) -> Iterator[str]:
        for name in part.gives:
            readers = [
                c.target
                for c in self._system.connections
                if (c.source, c.source_port) == (block, name) and c.target not in self._of
            ]
            if readers:
                yield f"{name} \N{RIGHTWARDS ARROW} {', '.join(dict.fromkeys(readers))}"


def _value(variable: Variable) -> str:
    """`K_g = 1000, 1000, 1e+04`, `k_D = 100 1/s`: units where all entries have one."""
    numbers = ", ".join(f"{value:.4g}" for value in variable.starts)
    units = {unit for unit in variable.units if unit != "1"}
    return f"{variable.name} = {numbers} {units.pop() if len(units) == 1 else ''}".rstrip()
