"""FMUs, the connections between them, and the hold of each that crosses rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.start_values import Starts
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.conditions import Condition
from hapticlink.orchestrator.scene.records import (
    Iteration,
    Latency,
    PowerPort,
    SetSpring,
    StepControl,
)


@dataclass(frozen=True)
class Fmu:
    """One FMU of the system and the clock it steps at."""

    name: str
    description: Description
    clock: str
    starts: Starts = ()
    isolate: bool = False

    @property
    def sampled(self) -> bool:
        return self.description.timing == "sampled"


@dataclass(frozen=True)
class Connection:
    """A vector from one FMU's outputs to another's inputs; hold is None within one rate.

    A connection to parameters acts at each communication point where they are tunable, else once,
    in initialisation (`initial`; FMI 2.0.5 section 2.2.7).
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
    def name(self) -> str:
        return f"{self.source}.{self.source_port} -> {self.target}.{self.target_port}"

    @property
    def to_parameter(self) -> bool:
        return self.inputs[0].causality == "parameter"

    @property
    def initial(self) -> bool:
        return self.to_parameter and self.inputs[0].variability != "tunable"


@dataclass(frozen=True)
class System:
    """What is simulated, on which timeline, in which order of calls.

    power: the ports that carry it. substeps: steps that a plant takes between two reads, its
    held inputs renewed at each. get_after_set: plants that may be read again after new inputs
    are set. refused: default holds that did not fit. springs: what set positions set.
    energy_in_play (J): what gravity can turn over in the mechanism, None where its energy is not
    judged.
    """

    fmus: tuple[Fmu, ...]
    connections: tuple[Connection, ...]
    timeline: Timeline
    coupling: str
    ends_when: Condition | None = None
    faults: Faults = field(default_factory=Faults)
    power: tuple[PowerPort, ...] = ()
    substeps: Mapping[str, int] = field(default_factory=dict)
    get_after_set: tuple[str, ...] = ()
    iteration: Iteration = field(default_factory=Iteration)
    step_control: StepControl | None = None
    refused: tuple[Refused, ...] = ()
    springs: tuple[SetSpring, ...] = ()
    energy_in_play: float | None = None

    @cached_property
    def fmu(self) -> Mapping[str, Fmu]:
        return {u.name: u for u in self.fmus}

    @cached_property
    def connection(self) -> Mapping[str, Connection]:
        return {c.name: c for c in self.connections}

    def into(self, name: str) -> tuple[Connection, ...]:
        """Connections to the inputs of an FMU."""
        return tuple(c for c in self.connections if c.target == name and not c.initial)

    def out_of(self, name: str) -> tuple[Connection, ...]:
        """Connections from the outputs of an FMU."""
        return tuple(c for c in self.connections if c.source == name and not c.initial)


@dataclass(frozen=True)
class Refused:
    """A hold that does not fit: `key` is where the scene asks for it, None for the default."""

    key: str | None
    connection: Connection
    hold: str
    reason: str
