"""The records of a system: FMUs, connections with their holds, and the timeline."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any

from hapticlink.components.specs.driver import Driver
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.start_values import Starts
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.conditions import Condition
from hapticlink.orchestrator.scene.scene_tables import Iteration, Latency, PowerPort, SetSpring


@dataclass(frozen=True)
class ServedAt:
    """Where an FMU is served from (`network/`): its address, HOST:PORT, the file of the key, and
    what both sides have to agree on."""

    address: str
    key: Path
    identity: Mapping[str, str]


@dataclass(frozen=True)
class Fmu:
    """One FMU of the system, the clock that it steps at, its start values, whether it runs in
    a process of its own, and whether it drives hardware. recorded_only: outputs that are only read
    for the rows of a table."""

    name: str
    description: Description
    clock: str
    starts: Starts = ()
    isolate: bool = False
    hardware: bool = False
    recorded_only: frozenset[str] = frozenset()
    in_its_place: ServedAt | Driver | Callable[..., Any] | None = None
    """What runs instead: the FMU on another computer, a board, or what this makes by the arguments
    of an `Instance`."""

    @property
    def served(self) -> ServedAt | None:
        return at if isinstance(at := self.in_its_place, ServedAt) else None

    @property
    def driver(self) -> Driver | None:
        """Of the board in its place."""
        return at if isinstance(at := self.in_its_place, Driver) else None

    @property
    def sampled(self) -> bool:
        return self.description.timing == "sampled"

    @property
    def frames(self) -> bool:
        """Whether its outputs describe the beginning of the step at whose end they are known."""
        return self.description.timing == "frame"

    @property
    def start_values(self) -> dict[str, Any]:
        """Its start values by name of the variable."""
        return {scalar.name: value for scalar, value in self.starts}

    def starting(self, new: Starts) -> Fmu:
        """The FMU with `new` start values, in place of those that these variables have."""
        names = {scalar.name for scalar, _ in new}
        others = tuple(start for start in self.starts if start[0].name not in names)
        return replace(self, starts=others + new)


@dataclass(frozen=True)
class Connection:
    """A vector from outputs of one FMU to inputs of another; hold is None where every sample is
    passed on as it is.

    A connection to tunable parameters acts at each communication point, one to fixed parameters
    once, in initialisation mode (`initial`; FMI 2.0.5 section 2.2.7).
    """

    source: str
    source_port: str
    target: str
    target_port: str
    outputs: tuple[Scalar, ...]
    inputs: tuple[Scalar, ...]
    hold: str | None = None
    latency: Latency | None = None
    kind: str | None = None

    @property
    def from_(self) -> str:
        return f"{self.source}.{self.source_port}"

    @property
    def to(self) -> str:
        return f"{self.target}.{self.target_port}"

    @cached_property
    def name(self) -> str:
        return f"{self.from_} -> {self.to}"

    @property
    def needs(self) -> str | None:
        """What its hold needs beside its samples: `Hold.needs`."""
        return HOLDS[self.hold].needs if self.hold else None

    @property
    def to_parameter(self) -> bool:
        return self.inputs[0].causality == "parameter"

    @property
    def initial(self) -> bool:
        return self.to_parameter and self.inputs[0].variability != "tunable"


@dataclass(frozen=True)
class Replacement:
    """An FMU in the place of a block. lost: connections of the block to ports that the FMU does not
    have. unfed: inputs of the FMU that no connection feeds, which keep their start values. mapped:
    by port of the block, what the FMU calls its entries where that is another name."""

    lost: tuple[str, ...]
    unfed: tuple[str, ...]
    mapped: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Coupling:
    """In which order and how often the FMUs are called."""

    scheme: str
    iteration: Iteration = field(default_factory=Iteration)
    substeps: Mapping[str, int] = field(default_factory=dict)
    """By plant, the doSteps per communication step, held inputs updated before each."""
    get_after_set: tuple[str, ...] = ()
    """Plants whose outputs may be read again after inputs are set, without a doStep between."""


MOST = 6
"""Entries of a spring-damper up to which its force is taken for the middle of a step."""


@dataclass(frozen=True)
class EnergyPorts:
    """What is known of the energy that crosses connections."""

    power: tuple[PowerPort, ...] = ()
    springs: tuple[SetSpring, ...] = ()
    """Spring-dampers whose set positions are connected."""
    in_play: float | None = None
    """Scale (J) of the mechanism's gravitational energy, None where its energy balance is not
    checked."""
    driven: bool = False
    """Whether drives or forces of plugins put energy into the mechanism."""

    @property
    def without_gains(self) -> tuple[object, ...]:
        """These with the number of springs alone."""
        return self.power, len(self.springs), self.in_play, self.driven

    def coupling(self, c: Connection, connections: Iterable[Connection]) -> SetSpring | None:
        """The spring-damper whose force a connection has, if both its ends move with a mobility
        that is known, each of these is brought by one connection, and there are no more entries
        than MOST."""
        force, n = c.from_, len(c.inputs)
        own = next((s for s in self.springs if s.force == force and all(s.ends)), None)
        if own is None or n > MOST:
            return None
        to = {k.to: len(k.inputs) for k in connections if not k.initial}
        sizes = [to.get(end) for end in own.ends]
        return own if sizes == [n, n, n, n, n * n] else None

    def coupling_beside(
        self, c: Connection, connections: Collection[Connection]
    ) -> SetSpring | None:
        """The spring-damper of `coupling` whose force moves what the effort of a connection does,
        beside it."""
        moved = {p.effort: p.displacement for p in self.power}
        own = moved.get(c.to)
        others = (k for k in connections if k.target == c.target and k.name != c.name)
        same = (k for k in others if own and moved.get(k.to) == own)
        found = (self.coupling(k, connections) for k in same)
        return next((of for of in found if of), None)


@dataclass(frozen=True)
class SlowerTable:
    """Outputs, `fmu.output`, that have a row at every so many communication points of a clock."""

    clock: str
    every: int
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Recording:
    """What is written."""

    outputs: tuple[str, ...] | None = None
    """The outputs, `fmu.output`; None for all."""
    every: int = 1
    """Number of communication points of a clock for which it gets a row."""
    slower: Mapping[str, SlowerTable] = field(default_factory=dict)
    """By name, the tables of outputs that have fewer rows, which are in no other."""

    @property
    def whole(self) -> tuple[str, ...] | None:
        """The outputs that are in the tables of the clocks; None for all."""
        apart = {*chain(*(t.outputs for t in self.slower.values()))}
        return self.outputs and tuple(n for n in self.outputs if n not in apart)

    def tables(self, clock: str) -> dict[str, int]:
        """The names of a clock's tables, each with its `every`."""
        slower = {n: self.every * t.every for n, t in self.slower.items() if t.clock == clock}
        return {clock: self.every} | slower


@dataclass(frozen=True)
class InputChange:
    """What the steps of an FMU get from its first one at or after `time` on, which is at `begin`
    (s): `values` of `inputs` once, or before each step that begins before `end` if that is given.
    Without values, the inputs keep what `held` brings them at `begin`; `noise` is the standard
    deviation that adds to it, with a seed. text: for the record of a run. Without inputs it is only
    for that record."""

    begin: float
    time: float
    text: str
    fmu: str = ""
    inputs: tuple[Scalar, ...] = ()
    values: tuple[float, ...] = ()
    end: float | None = None
    held: Connection | None = None
    noise: float = 0.0
    seed: int = 0

    @property
    def key(self) -> tuple[object, ...]:
        """By which it is known among those of a state; `text` is shortened."""
        return self.text, self.time, self.values, self.noise, self.seed


@dataclass(frozen=True)
class System:
    """What is simulated, on which timeline, with which coupling."""

    fmus: tuple[Fmu, ...]
    connections: tuple[Connection, ...]
    timeline: Timeline
    coupling: Coupling
    ends_when: Condition | None = None
    """Condition that ends the run early."""
    faults: Faults = field(default_factory=Faults)
    energy: EnergyPorts = field(default_factory=EnergyPorts)
    recording: Recording = field(default_factory=Recording)
    refused: tuple[Refused, ...] = ()
    """Holds that did not fit."""
    replacements: Mapping[str, Replacement] = field(default_factory=dict)
    """The FMUs in the place of the loop's blocks, by name."""
    changes: tuple[InputChange, ...] = ()
    """What happens at given times, in their order."""

    @cached_property
    def fmu(self) -> Mapping[str, Fmu]:
        return {u.name: u for u in self.fmus}

    @cached_property
    def connection(self) -> Mapping[str, Connection]:
        return {c.name: c for c in self.connections}

    def block(self, fmu: str) -> str | None:
        """The block that an FMU is, or that it replaces; None for other FMUs, whatever they are
        called."""
        return fmu if fmu in self.replacements else self.fmu[fmu].description.block

    def is_alike(self, other: System) -> bool:
        """Whether `other` differs in start values of FMUs and the ticks of its clocks alone, and no
        hold depends on these."""
        if any(c.needs in ("spring", "power", "coupling") for c in self.connections):
            return self == other
        return self._of_objects == other._of_objects

    @cached_property
    def _of_objects(self) -> tuple[object, ...]:
        """What the objects of a run are made of: the system without start values and gains of
        springs, but with their names and number, the clocks' ticks only where latencies are drawn
        in these, and the values of changes as text, in which 0.0 is not -0.0."""
        fmus = tuple(replace(fmu, starts=()) for fmu in self.fmus)
        names = [[scalar.name for scalar, _ in fmu.starts] for fmu in self.fmus]
        changed = repr([change.values for change in self.changes])
        time = self.timeline
        late = any(c.latency for c in self.connections)
        clocks = time if late else ([c.name for c in time.clocks], time.of)
        rest = replace(self, fmus=fmus, energy=EnergyPorts(), timeline=_NO_TIME)
        return rest, names, self.energy.without_gains, changed, clocks

    def restarted(
        self, starts: Iterable[Starts], energy: Callable[..., EnergyPorts], time: Timeline
    ) -> System:
        """The system with other start values of the same variables of its FMUs, and other ticks of
        the same clocks; `energy` gives the energy ports of FMUs that have them."""
        fmus = tuple(replace(u, starts=s) for u, s in zip(self.fmus, starts, strict=True))
        made = replace(self, fmus=fmus, energy=energy(fmus), timeline=time)
        of_ticks = time is not self.timeline and any(c.latency for c in self.connections)
        if made.energy.without_gains == self.energy.without_gains and not of_ticks:
            vars(made)["_of_objects"] = self._of_objects
        return made

    @cached_property
    def early(self) -> frozenset[str]:
        """The FMUs whose steps are taken as soon as they begin, before those of others: their
        samples describe the end of a step."""
        return frozenset(c.source for c in self.connections if c.needs == "step")

    def into(self, name: str) -> tuple[Connection, ...]:
        return self._by_end[0].get(name, ())

    def out_of(self, name: str) -> tuple[Connection, ...]:
        return self._by_end[1].get(name, ())

    @cached_property
    def _by_end(self) -> tuple[Mapping[str, tuple[Connection, ...]], ...]:
        """The connections by their targets, and by their sources, without initial ones."""
        lasting = [c for c in self.connections if not c.initial]
        return tuple(
            {end: tuple(c for c in lasting if of(c) == end) for end in {*map(of, lasting)}}
            for of in (attrgetter("target"), attrgetter("source"))
        )


_NO_TIME = Timeline(Fraction(1), 0, (), {})


@dataclass(frozen=True)
class Refused:
    """A hold that does not fit a connection: `key` is the scene's key that requests it, None for a
    default."""

    key: str | None
    connection: Connection
    hold: str
    reason: str
