"""FMUs, the connections between them, and the hold of each that crosses rates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from hapticlink.orchestrator import haptic_loop
from hapticlink.orchestrator.blocks import blocks
from hapticlink.orchestrator.conditions import Condition, parse_condition
from hapticlink.orchestrator.description import Description, Scalar, describe
from hapticlink.orchestrator.faults import Finding, InputFault, SceneFault
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.ticks import Timeline


@dataclass(frozen=True)
class Unit:
    """One FMU of the system and the clock it steps at."""

    name: str
    description: Description
    clock: str

    @property
    def sampled(self) -> bool:
        return self.description.timing == "sampled"


@dataclass(frozen=True)
class Connection:
    """A vector from one FMU's outputs to another's inputs; hold is None within one rate.

    A connection to parameters (`initial`) is made once, in initialisation.
    """

    source: str
    source_port: str
    target: str
    target_port: str
    outputs: tuple[Scalar, ...]
    inputs: tuple[Scalar, ...]
    hold: str | None = None

    @property
    def name(self) -> str:
        return f"{self.source}.{self.source_port} -> {self.target}.{self.target_port}"

    @property
    def initial(self) -> bool:
        return self.inputs[0].causality == "parameter"


@dataclass(frozen=True)
class System:
    """What is simulated, on which timeline, in which order of calls."""

    units: tuple[Unit, ...]
    connections: tuple[Connection, ...]
    timeline: Timeline
    coupling: str
    ends_when: Condition | None = None

    @cached_property
    def unit(self) -> Mapping[str, Unit]:
        return {u.name: u for u in self.units}

    def into(self, name: str) -> tuple[Connection, ...]:
        """Connections to the inputs of an FMU."""
        return tuple(c for c in self.connections if c.target == name and not c.initial)

    def out_of(self, name: str) -> tuple[Connection, ...]:
        """Connections from the outputs of an FMU."""
        return tuple(c for c in self.connections if c.source == name and not c.initial)


def from_scene(scene: Scene, timeline: Timeline, files: Mapping[str, Path]) -> System:
    """The system of `scene` with its FMUs in `files`. Raises SceneFault for names in holds and
    stop_when that the system does not have."""
    units = tuple(Unit(b.name, describe(files[b.name]), b.clock) for b in blocks(scene))
    made = tuple(connect(units, haptic_loop.connections(scene), scene.hold, scene.holds))
    findings = []
    for key in scene.holds:
        named = [c for c in made if key in _names(c)]
        if not any(c.hold for c in named):
            crossing = ", ".join(c.name for c in made if c.hold) or "none"
            why = "does not cross rates" if named else "is no connection of this scene"
            finding = f"{why}; connections that cross rates: {crossing}"
            findings.append(Finding(f"holds.{key}", finding))
    condition = parse_condition(scene.ends_when) if scene.ends_when else None
    if condition and not _has_output(units, condition):
        findings.append(Finding("stop_when", f"{condition}: there is no such output"))
    if findings:
        raise SceneFault(scene.title, findings)
    return System(units, made, timeline, scene.coupling, condition)


def connect(
    units: Iterable[Unit],
    rows: Iterable[tuple[str, str]],
    hold: str,
    holds: Mapping[str, str],
) -> Iterable[Connection]:
    """The connections of `rows` whose two ends exist. Raises InputFault where an input has two
    sources, or two ends differ in size or unit."""
    by_name = {u.name: u for u in units}
    fed: dict[tuple[str, str], str] = {}
    for source, target in rows:
        (giver, output), (taker, entry) = (_split(end) for end in (source, target))
        if giver not in by_name or taker not in by_name:
            continue
        outputs = by_name[giver].description.port(output, "output")
        inputs = by_name[taker].description.port(entry, "input", "parameter")
        if not outputs or not inputs:
            continue
        made = Connection(giver, output, taker, entry, outputs, inputs)
        if len(outputs) != len(inputs):
            raise InputFault(f"{made.name}: {len(outputs)} values for {len(inputs)} inputs")
        for a, b in zip(outputs, inputs, strict=True):
            if a.unit and b.unit and a.unit != b.unit:
                raise InputFault(
                    f"{made.name}: {a.name} is in {a.unit}, {b.name} in {b.unit}; "
                    "connect signals of one unit"
                )
            if (first := fed.setdefault((taker, b.name), source)) != source:
                raise InputFault(f"{target}: fed by {first} and by {source}; keep one")
        if by_name[giver].clock != by_name[taker].clock and not made.initial:
            kind = next((holds[key] for key in _names(made) if key in holds), hold)
            made = Connection(giver, output, taker, entry, outputs, inputs, kind)
        yield made


def _names(c: Connection) -> tuple[str, str, str]:
    """The names under which [holds] may speak of a connection, the most precise first."""
    return (c.name, f"{c.target}.{c.target_port}", f"{c.source}.{c.source_port}")


def _split(end: str) -> tuple[str, str]:
    fmu, _, variable = end.partition(".")
    return fmu, variable


def _has_output(units: Iterable[Unit], condition: Condition) -> bool:
    named = (u for u in units if u.name == condition.fmu)
    return any(s.name == condition.variable for u in named for s in u.description.outputs)
