"""One energy meter per power connection, updated by the get, set and step calls of a run."""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.orchestrator.run.energy.bonds import bond, reader
from hapticlink.orchestrator.run.energy.meter import Energy, Mark, Meter
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import System

Call = Callable[[int], object]


class Meters:
    """One meter for each connection that carries power, of the efforts that its target gets."""

    def __init__(self, system: System, signals: SignalVector) -> None:
        self._meters: dict[str, Meter] = {}
        self._sources: dict[str, list[Meter]] = {}
        self._targets: dict[str, list[Meter]] = {}
        self._seconds = float(system.timeline.base)
        self._shares = {name: 1.0 / parts for name, parts in system.substeps.items()}
        for c in system.connections:
            found = bond(c, system, signals)
            if found is None:
                continue
            source, held = (
                reader(signals, found.of(places), found.factor, found.offset)
                for places in (signals.sources(c), signals.mean(c))
            )
            meter = Meter(source, held, reader(signals, found.moved, found.scale))
            self._meters[c.name] = meter
            self._sources.setdefault(c.source, []).append(meter)
            self._targets.setdefault(c.target, []).append(meter)

    def start(self) -> None:
        """Start all accounts at the initialised state."""
        for meter in self._meters.values():
            meter.sample(0)
            meter.move(0)

    def read(self, fmu: str, ahead: int, get: Callable[[], object]) -> Call:
        """The get call of an FMU, wrapped to update the meters of its outputs."""
        sampled = [m.sample for m in self._sources.get(fmu, [])]
        moved = [m.move for m in self._targets.get(fmu, [])]
        updates = sampled + moved
        if not updates:
            return lambda tick: get()
        if len(updates) == 1:
            (only,) = updates

            def read_one(tick: int) -> None:
                get()
                only(tick + ahead)

            return read_one

        def read(tick: int) -> None:
            get()
            for update in updates:
                update(tick + ahead)

        return read

    def fed(self, fmu: str, set_inputs: Call) -> Call:
        """The set call of an FMU, wrapped to update the meters of its inputs."""
        held = [m.hold for m in self._targets.get(fmu, [])]
        if not held:
            return set_inputs
        share = self._shares.get(fmu, 1.0)

        def feed(tick: int) -> None:
            set_inputs(tick)
            for hold in held:
                hold(share)

        return feed

    def checkpoint(self, deep: bool = False) -> list[Mark]:
        """Checkpoint of all meters for `rollback`; `deep` checkpoints may enclose others."""
        rows = 16 if deep else 4
        return [meter.checkpoint(rows) for meter in self._meters.values()]

    def rollback(self, marks: list[Mark]) -> None:
        """Remove what all meters recorded since the checkpoint `marks`."""
        for meter, mark in zip(self._meters.values(), marks, strict=True):
            meter.rollback(mark)

    def energies(self) -> dict[str, Energy]:
        """The energies (J) of each connection that carries power, by its name."""
        return {name: meter.energy(self._seconds) for name, meter in self._meters.items()}
