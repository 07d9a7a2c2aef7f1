"""Resolves connections through the connectors of nested systems to connections from FMU to FMU.

A connector of a system passes its value on, so an input of an FMU is fed by a chain of connections,
y_0 -> y_1 -> ... -> y_k, each with y_i = a_i C_i(y_{i-1}) + b_i, where C_i converts the units
(SSP 1.0, section 5.4.2). The chain is one linear function of y_0. A connector without a unit has
that of the connectors inside its system. A connection of arrays (SSP 2.0) is one of each pair of
their entries, row by row. An entry of a signal dictionary is what an input of a reference to it
writes, and all outputs of that name read, in its unit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import SAME, Linear, Unit, conversion
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.ssp.tree import (
    Connector,
    Node,
    Place,
    SsdConnection,
    SsdElement,
    indices,
    join_place,
)

TAKES = ("input", "parameter", "structuralParameter")
Row = tuple[Node, Node, dict[str, Any]]
"""An output, the input that it feeds, and the keys of [[connection]] for what is done between."""


@dataclass(frozen=True)
class ReachedVariable:
    """A variable of an FMU that a connector of a system feeds: it gets `linear` of the connector's
    value in `unit`."""

    component: Place
    variable: str
    unit: Unit | None
    linear: Linear
    relative: bool


@dataclass
class Wires:
    """The connections of `root`. Raises InputFault for connections that do not join an output to an
    input, for inputs that are fed twice, and for circles without an FMU.

    rows: connections from FMU to FMU, in the order of the file, inner systems first. reach: for
    each connector of a system, the variables that it feeds; chains that begin at a connector, such
    as an input of the root system, have no row. variables: those of all FMUs.
    """

    path: Path
    root: SsdElement
    described: Mapping[Place, Description]
    rows: list[Row] = field(default_factory=list)
    reach: dict[Node, list[ReachedVariable]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._systems = {p.place: p for p in self.root if p.source is None}
        self._connectors = {(p.place, n): c for p in self.root for n, c in p.connectors.items()}
        self.variables = {
            (place, s.name): s
            for place, d in self.described.items()
            for s in (*d.scalars, *d.strings)
        }
        self._arrays: dict[Node, list[str]] = {}
        for place, d in self.described.items():
            for s in sorted(d.scalars, key=lambda s: s.indices):
                self._arrays.setdefault((place, s.port), []).append(s.name.removeprefix(s.port))
        fed: dict[Node, tuple[Node, SsdConnection]] = {}
        for source, sink, line in (*self._written(), *self._through_dictionaries()):
            if sink in fed:
                names = f"{join_place(*fed[sink][0])} and by {join_place(*source)}"
                raise InputFault(f"{self.path}: {join_place(*sink)} is fed by {names}; keep one")
            fed[sink] = source, line
        for sink in fed:
            if sink[0] in self.described:
                self._follow(sink, fed)

    def _written(self) -> Iterator[tuple[Node, Node, SsdConnection]]:
        """Source and sink of the connections of all systems."""
        for system in self._systems.values():
            for line in (entry for whole in system.lines for entry in self._entries(whole)):
                yield *self._directed(system, line), line

    def _through_dictionaries(self) -> Iterator[tuple[Node, Node, SsdConnection]]:
        """From the inputs of references to a signal dictionary to the outputs of the same name."""
        written: dict[tuple[Place | None, str], list[Node]] = {}
        read: list[tuple[Place | None, str, Node]] = []
        for part in (p for p in self._systems.values() if p.dictionary is not None):
            for name, connector in part.connectors.items():
                node = part.place, name
                if connector.kind in TAKES:
                    written.setdefault((part.dictionary, name), []).append(node)
                else:
                    read.append((part.dictionary, name, node))
        for dictionary, name, reader in read:
            for writer in written.get((dictionary, name), ()):
                for line in self._entries(SsdConnection((writer, reader), SAME, True)):
                    yield *line.ends, line

    def _entries(self, line: SsdConnection) -> Iterator[SsdConnection]:
        """The connection itself, or those of the entries of its arrays."""
        first, second = (self._indices(*end) for end in line.ends)
        first, second = first or second or [""], second or first or [""]
        if len(first) != len(second):
            names = " and ".join(join_place(*end) for end in line.ends)
            sizes = f"have {len(first)} and {len(second)} entries"
            raise InputFault(f"{self.path}: {names} are connected, and {sizes}; connect equal ones")
        (a, p), (b, q) = line.ends
        for i, j in zip(first, second, strict=True):
            yield replace(line, ends=((a, f"{p}{i}"), (b, f"{q}{j}")))

    def _indices(self, place: Place, name: str) -> list[str]:
        """The indices of all entries of an array of an FMU or a system, as `indices` gives
        them."""
        if (place, name) in self.variables:
            return [""]
        if entries := self._arrays.get((place, name)):
            return entries
        connector = self._connectors.get((place, name))
        return [""] if connector is None else indices(connector.sizes)

    def _connector(self, node: Node) -> Connector | None:
        """The connector of a node, which may be an entry of it."""
        place, name = node
        return self._connectors.get(node) or self._connectors.get((place, entry_of(name)[0]))

    def _directed(self, system: SsdElement, line: SsdConnection) -> tuple[Node, Node]:
        """The ends of a connection as (source, target), seen from inside `system`."""
        first, second = (self._is_source(end, system.place) for end in line.ends)
        if first == second:
            what = "outputs" if first else "inputs"
            names = " and ".join(join_place(*end) for end in line.ends)
            raise InputFault(f"{self.path}: {names} are connected, and both are {what}")
        return line.ends if first else (line.ends[1], line.ends[0])

    def _is_source(self, node: Node, inside: Place) -> bool:
        place, _ = node
        if variable := self.variables.get(node):
            return variable.causality not in TAKES
        if place in self._systems and (connector := self._connector(node)):
            # Seen from inside, a system's own input is a source.
            return (connector.kind in TAKES) == (place == inside)
        why = "does not exist, or is a clock that is not triggered"
        raise InputFault(f"{self.path}: a connection names {join_place(*node)}, which {why}")

    def _follow(self, sink: Node, fed: Mapping[Node, tuple[Node, SsdConnection]]) -> None:
        """Adds the chain that ends at an FMU's input to `rows` and `reach`."""
        nodes: list[Node] = [sink]
        lines: list[SsdConnection] = []
        while nodes[0] in fed:
            source, line = fed[nodes[0]]
            if source in nodes:
                names = " -> ".join(join_place(*n) for n in (source, *nodes))
                raise InputFault(
                    f"{self.path}: connections run in a circle without an FMU: {names}"
                )
            nodes.insert(0, source)
            lines.insert(0, line)
        units = self._units_along(nodes)
        relative = any(s.relative for n in nodes if (s := self.variables.get(n)))
        around = zip(lines, nodes, nodes[1:], units, units[1:], strict=False)
        steps = [self._step(relative, *step) for step in around]
        for i, node in enumerate(nodes):
            if node[0] in self._systems:
                sink_reach = ReachedVariable(*sink, units[i], _all(steps[i:]), relative)
                self.reach.setdefault(node, []).append(sink_reach)
        if nodes[0][0] in self.described:
            own = len(lines) == 1 and all(self._unit_is_of_fmu(n) for n in nodes)
            linear = lines[0].linear if own else _all(steps)
            how: dict[str, Any] = {} if own and lines[0].convert else {"convert": False}
            if linear != SAME:
                how |= {"factor": linear.factor, "offset": linear.offset}
            self.rows.append((nodes[0], sink, how))

    def _step(
        self, relative: bool, line: SsdConnection, a: Node, b: Node, u: Unit | None, v: Unit | None
    ) -> Linear:
        if not line.convert:
            return line.linear
        try:
            return line.linear.after(conversion(u, v, relative))
        except ValueError as error:
            names = f"{join_place(*a)} and {join_place(*b)}"
            raise InputFault(
                f"{self.path}: the units of {names} do not fit: {error}; connect quantities of one "
                "dimension, or set suppressUnitConversion"
            ) from None

    def _units_along(self, nodes: list[Node]) -> list[Unit | None]:
        """The unit of each node of a chain. A system's connector without a unit takes that of its
        source if it is an output, and that of its target if it is an input."""
        units = [self.unit(n) for n in nodes]
        takes = [
            (c := self._connector(n)) is not None and n[0] in self._systems and c.kind in TAKES
            for n in nodes
        ]
        for i, node in enumerate(nodes):
            if i and units[i] is None and node[0] in self._systems and not takes[i]:
                units[i] = units[i - 1]
        for i in reversed(range(len(nodes) - 1)):
            if units[i] is None and takes[i]:
                units[i] = units[i + 1]
        return units

    def unit(self, node: Node) -> Unit | None:
        """The unit of a node: the FMU's own, or else that of its connector."""
        variable, connector = self.variables.get(node), self._connector(node)
        if variable and variable.unit is not None:
            return self.described[node[0]].unit(variable)
        return connector.unit if connector else None

    def _unit_is_of_fmu(self, node: Node) -> bool:
        connector = self._connector(node)
        return self.variables[node].unit is not None or connector is None or connector.unit is None


def _all(steps: Sequence[Linear]) -> Linear:
    return reduce(lambda done, step: step.after(done), steps, SAME)
