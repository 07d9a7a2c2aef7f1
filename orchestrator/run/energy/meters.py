"""One energy meter per power connection, updated by the gets and sets of a run (`instructions`)."""

from __future__ import annotations

from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.energy.meter import Mark, Meter
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import System


class Meters:
    """One meter for each connection that carries power, of the efforts that its target gets: `of`
    by the connection's name, of_source and of_target the names by FMU. shares: of a step, that a
    doStep of a plant with substeps takes."""

    def __init__(self, system: System, signals: SignalVector) -> None:
        self.of: dict[str, Meter] = {}
        self.of_source: dict[str, list[str]] = {}
        self.of_target: dict[str, list[str]] = {}
        self._seconds = float(system.timeline.base)
        self.shares = {name: 1.0 / parts for name, parts in system.coupling.substeps.items()}
        for c in system.connections:
            power = bond(c, system, signals)
            if power is None:
                continue
            source, held = (
                Reader(signals, power.of(places), power.factor, power.offset)
                for places in (signals.sources(c), signals.mean(c))
            )
            meter = Meter(source, held, Reader(signals, power.moved, power.scale))
            self.of[c.name] = meter
            self.of_source.setdefault(c.source, []).append(c.name)
            self.of_target.setdefault(c.target, []).append(c.name)

    def start(self) -> None:
        for meter in self.of.values():
            meter.sample(0)
            meter.move(0)

    def checkpoint(self) -> list[Mark]:
        """Checkpoint of all meters for `rollback`."""
        return [meter.checkpoint(4) for meter in self.of.values()]

    def rollback(self, marks: list[Mark]) -> None:
        """Remove what all meters recorded since the checkpoint `marks`."""
        for meter, mark in zip(self.of.values(), marks, strict=True):
            meter.rollback(mark)

    def energies(self) -> dict[str, Energy]:
        """The energies (J) of each connection that carries power, by its name."""
        return {name: meter.energy(self._seconds) for name, meter in self.of.items()}
