"""All signals of a run in one vector: outputs by clock and FMU, then held values, then the energies
that the far sides of springs have put in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from hapticlink.orchestrator.fmi.variables import WRITTEN
from hapticlink.orchestrator.system.system import Connection, Fmu, System


class SignalVector:
    """The vector `values` of the signals of a `system` and the index of each in it. asked: outputs
    whose indices were asked for, by FMU and name."""

    def __init__(self, system: System) -> None:
        self.system, self.asked = system, set[tuple[str, str]]()
        self._of_fmu: dict[str, slice] = {}
        self._of_clock: dict[str, slice] = {}
        self._of_hold: dict[str, slice] = {}
        self._of_scalar: dict[tuple[str, str], int] = {}
        end = 0
        for clock in system.timeline.clocks:
            first = end
            for unit in (u for u in system.fmus if u.clock == clock.name):
                outputs = unit.description.outputs
                self._of_fmu[unit.name] = slice(end, end + len(outputs))
                names = ((unit.name, s.name) for s in outputs)
                self._of_scalar |= {name: end + i for i, name in enumerate(names)}
                end += len(outputs)
            self._of_clock[clock.name] = slice(first, end)
        for connection in system.connections:
            if connection.hold:
                self._of_hold[connection.name] = slice(end, end + len(connection.inputs))
                end += len(connection.inputs)
        self._credits = end
        self.values = np.zeros(end + len(system.energy.springs))

    def fmu(self, name: str) -> slice:
        return self._of_fmu[name]

    def clock(self, name: str) -> slice:
        return self._of_clock[name]

    def hold(self, connection: str) -> slice:
        return self._of_hold[connection]

    def credit(self, spring: int) -> int:
        """Index of the energy that the far side of a spring has put into it."""
        return self._credits + spring

    def scalar(self, fmu: str, variable: str) -> int:
        self.asked.add((fmu, variable))
        return self._of_scalar[fmu, variable]

    def port(self, unit: Fmu, name: str) -> list[int]:
        return [self.scalar(unit.name, s.name) for s in unit.description.port(name, "output")]

    def sources(self, connection: Connection) -> list[int]:
        return [self.scalar(connection.source, s.name) for s in connection.outputs]

    def places(self, connection: Connection) -> list[int]:
        """Indices of the values that a connection's target reads: the held ones, or the source's
        outputs."""
        if connection.hold:
            held = self.hold(connection.name)
            return list(range(held.start, held.stop))
        return self.sources(connection)

    def texts(self, recorded: Iterable[str] | None) -> dict[int, str]:
        """By the places in a row of those recorded columns that are texts, their FMI types."""
        columns, types = enumerate(recorded or (), 1), self._texts
        return {place: types[name] for place, name in columns if name in types}

    @cached_property
    def _texts(self) -> dict[str, str]:
        """The FMI types of outputs that are texts."""
        every = ((u.name, s) for u in self.system.fmus for s in u.description.outputs)
        return {f"{name}.{s.name}": s.type for name, s in every if s.type in WRITTEN}

    @cached_property
    def _columns(self) -> dict[str, int]:
        return {f"{f}.{v}": i for (f, v), i in self._of_scalar.items()}

    def text_values(self) -> Iterator[tuple[str, float]]:
        """The names and numbers of all texts, put out and held."""
        yield from ((name, self.values[self._columns[name]]) for name in self._texts)
        for c in self.system.connections:
            if c.hold and c.outputs[0].type in WRITTEN:
                yield from ((c.name, number) for number in self.values[self.hold(c.name)])

    def recorded(self, table: str) -> dict[str, int] | None:
        """The columns `fmu.variable` of a table with their indices, None where there are none."""
        recording = self.system.recording
        of = recording.slower.get(table)
        span, written = self.clock(of.clock if of else table), of.outputs if of else recording.whole
        columns = {n: i for n, i in self._columns.items() if span.start <= i < span.stop}
        if written is None:
            return columns
        return {n: columns[n] for n in written if n in columns} or None
