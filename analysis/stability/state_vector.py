"""The state of a co-simulation as one vector of numbers, and back.

Between two events it consists of the states of all FMUs with the inputs that they hold, the signal
vector, and the blocks that holds and energy tanks keep. Times, counts and whatever else is no
floating-point number stay those of a template, an instant of the simulation itself.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.run.compiled.state import Saved
from hapticlink.orchestrator.run.run_state import state_blocks
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.system.system import Fmu, System

SIGNALS = "signals"


@dataclass(frozen=True)
class StateEntry:
    """An entry of the state: of an FMU, of the signals ("signal") or of a connection's hold
    ("hold"); `variable` is its name there. inert: an output of an FMU, which its steps write and do
    not read."""

    owner: str
    variable: str
    kind: str
    inert: bool = False

    def __str__(self) -> str:
        joint = ": " if self.kind == "hold" else "."
        return f"{self.owner}{joint}{self.variable}"


@dataclass(frozen=True)
class Template:
    """A saved state: of the FMUs in bytes, by name; the signals; of holds and tanks."""

    fmus: dict[str, bytes]
    signals: Vector
    holds: list[Saved]


class StateVector:
    """Reads and writes the state of `simulation`, or of its FMUs `fmus` and its holds and energy
    tanks `holds` alone. All its FMUs have a layout (`has_layout`).

    owners: the names of the FMUs, SIGNALS, and those of the holds, in the order of the numbers.
    """

    def __init__(
        self,
        simulation: Simulation,
        fmus: Container[str] | None = None,
        holds: Container[str] | None = None,
    ) -> None:
        self._simulation = simulation
        every = state_blocks(simulation, with_own=True)
        self._holds = {name: every[name] for name in every if holds is None or name in holds}
        self._fmus = [f for f in simulation.system.fmus if fmus is None or f.name in fmus]
        self._taken: dict[str, NDArray[np.intp]] = {}
        for fmu in self._fmus:
            self._taken[fmu.name] = np.array([i for i, *_ in _entries(fmu)], dtype=np.intp)
        self.owners = (*self._taken, SIGNALS, *self._holds)

    def save(self) -> Template:
        simulation = self._simulation
        return Template(
            {name: simulation.instances[name].serialized() for name in self._taken},
            simulation.signals.values.copy(),
            [block.save() for block in self._holds.values()],
        )

    def restore(self, template: Template) -> None:
        for name in self._taken:
            self._simulation.instances[name].deserialize(template.fmus[name])
        self._simulation.signals.values[:] = template.signals
        for block, saved in zip(self._holds.values(), template.holds, strict=True):
            block.restore(saved, saved.numbers)

    def put(self, template: Template, numbers: Vector) -> None:
        """Restores `template` with other numbers."""
        first = 0
        for name, taken in self._taken.items():
            head, values = template.fmus[name], doubles(template.fmus[name]).copy()
            values[taken] = numbers[first : first + len(taken)]
            state = head[: len(head) - values.nbytes] + values.tobytes()
            self._simulation.instances[name].deserialize(state)
            first += len(taken)
        signals = self._simulation.signals.values
        signals[:] = numbers[first : first + len(signals)]
        first += len(signals)
        for block, saved in zip(self._holds.values(), template.holds, strict=True):
            block.restore(saved, numbers[first : first + len(saved.numbers)])
            first += len(saved.numbers)

    def set_time(self, name: str, time: float) -> None:
        """Has an FMU of this project stand at a time (s), the number before all others of its
        serialised state; what others have there is not known."""
        instance = self._simulation.instances[name]
        about = instance.description
        if about.block is not None and about.states is not None:
            state = instance.serialized()
            values = doubles(state).copy()
            scalars = [s for s in about.scalars if s.causality != "independent"]
            values[-len(scalars) - len(about.states) - 1] = time
            instance.deserialize(state[: len(state) - values.nbytes] + values.tobytes())

    def now(self) -> Vector:
        """The numbers of the simulation as it is."""
        instances = self._simulation.instances
        parts = [
            doubles(instances[name].serialized())[taken] for name, taken in self._taken.items()
        ]
        parts.append(self._simulation.signals.values)
        parts += (block.numbers() for block in self._holds.values())
        return np.concatenate(parts)

    def integers(self) -> NDArray[np.int64]:
        """The whole numbers of holds and energy tanks as they are."""
        every = [block.integers() for block in self._holds.values()]
        return np.concatenate([np.zeros(0, np.int64), *every])

    def sizes(self) -> dict[str, int]:
        """How many numbers each owner has now."""
        template = self.save()
        return dict(zip(self.owners, map(len, self.parts(template)), strict=True))

    def numbers(self, template: Template) -> Vector:
        """The numbers of a saved state, in the order of `coordinates`."""
        return np.concatenate(self.parts(template))

    def parts(self, template: Template) -> list[Vector]:
        """The numbers of a saved state, by owner."""
        parts = [doubles(template.fmus[name])[taken] for name, taken in self._taken.items()]
        parts.append(template.signals)
        return [*parts, *(saved.numbers for saved in template.holds)]

    def coordinates(self, template: Template) -> list[StateEntry]:
        simulation = self._simulation
        system, signals = simulation.system, simulation.signals
        coordinates = [
            StateEntry(u.name, name, "fmu", inert)
            for u in self._fmus
            for _, name, inert in _entries(u)
        ]
        columns = [
            n for clock in system.timeline.clocks for n in signals.recorded(clock.name) or ()
        ]
        outputs = [_signal(name) for name in columns]
        further = range(len(outputs), len(template.signals))
        coordinates += outputs + [StateEntry("held values", f"[{i}]", "signal") for i in further]
        for owner, saved in zip(self._holds, template.holds, strict=True):
            names = self._holds[owner].names(saved)
            coordinates += [StateEntry(owner, name, "hold") for name in names]
        return coordinates


def ages(integers: NDArray[np.int64], tick: int) -> bytes:
    """The whole numbers of holds: stamps of samples relative to a tick, counts, which are far
    smaller, as they are."""
    return np.where(8 * integers > tick, tick - integers, integers).tobytes()


def parameters_of(fmu: Fmu, state: bytes) -> Vector | None:
    """The parameters in the serialised state of a block of the package, which ends with its time,
    its other numbers in the order of their references, and its states; None of others."""
    about = fmu.description
    if about.block is None or about.states is None:
        return None
    scalars = [s for s in about.scalars if s.causality != "independent"]
    scalars.sort(key=lambda s: s.reference)
    kept = doubles(state)[-len(scalars) - len(about.states) :]
    fixed = [i for i, s in enumerate(scalars) if s.causality not in ("input", "output")]
    return kept[fixed]


def size(system: System) -> int:
    """The numbers of the state of a system, without the samples that holds keep. Raises InputFault
    for an FMU without a layout."""
    for fmu in system.fmus:
        if not has_layout(fmu):
            raise InputFault(f"{fmu.name}: {LAYOUT}")
    entries = [entry for fmu in system.fmus for entry in _entries(fmu)]
    return len(entries) + sum(len(fmu.description.outputs) for fmu in system.fmus)


@lru_cache(4096)
def _signal(column: str) -> StateEntry:
    fmu, _, variable = column.partition(".")
    return StateEntry(fmu, variable, "signal")


LAYOUT = (
    "its FMU does not declare the layout of its serialised state (`States` in its annotation: "
    "docs/fmus.md)"
)


def has_layout(fmu: Fmu) -> bool:
    """Whether the FMU declares the layout of its serialised state."""
    return fmu.description.states is not None and fmu.description.restores_state


def _entries(fmu: Fmu) -> Iterator[tuple[int, str, bool]]:
    """Index, from the end, and name of each number of an FMU that is no parameter, and whether it
    is an output."""
    assert fmu.description.states is not None
    scalars = [s for s in fmu.description.scalars if s.causality != "independent"]
    scalars.sort(key=lambda s: s.reference)  # entries of an array follow each other already
    for i, scalar in enumerate(scalars):
        if scalar.causality in ("input", "output"):
            place = i - len(scalars) - len(fmu.description.states)
            yield place, scalar.name, scalar.causality == "output"
    for i, name in enumerate(fmu.description.states):
        yield i - len(fmu.description.states), name, False


def doubles(state: bytes) -> Vector:
    """The doubles that a serialised state ends with, as many as fit."""
    return np.frombuffer(state, offset=len(state) % 8)
