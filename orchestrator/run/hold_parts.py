"""What the hold of each connection is made of: its own kind, what it needs, and what is around it.
`run/compiled/hold_structures.py` makes the structures of these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.hold import Hold, HoldContext
from hapticlink.orchestrator.holds.table import HoldRow
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene_tables import Latency, SetSpring
from hapticlink.orchestrator.system import ports
from hapticlink.orchestrator.system.read_beside import read_beside
from hapticlink.orchestrator.system.springs import spring
from hapticlink.orchestrator.system.system import Connection, System


@dataclass(frozen=True)
class SpringParts:
    """A spring-damper that holds set, with its near end at the haptic rate.

    stiffness, damping: K and B by entry. position, velocity: read x and v; without v it is the
    difference of two positions. turns: a full turn for each entry that is a wrapped angle, else 0.
    sampled: whether F is computed at each tick and held until the next, or acts continuously.
    period: T (s), the longest step.
    """

    stiffness: Vector
    damping: Vector
    position: Reader
    turns: Vector
    period: float
    velocity: Reader | None = None
    sampled: bool = False


@dataclass(frozen=True)
class HoldParts:
    """The parts of a hold.

    kind: its row, or the class of a plugin's hold. sources: the indices of a sample's entries among
    the signals; further: those of what belongs to it besides, the source's derivative or integral,
    or the energy that the far side of a spring has put in. turns: for each entry of a sample that
    is a wrapped angle, a full turn in its unit. matrix: "projector" or "semidefinite". context:
    what a plugin's hold is constructed from. frames: whether a sample describes the beginning of
    its source's step. relation: what the first of `further` are to the signal, of `ahead`. beside:
    reads what the law reads beside samples; gains: K and B of the force whose both ends these are.
    parts: steps of the target in one of its period. base: a tick (s). spring: the one that it sets,
    or on whose far side it is; row: 0 for its set position, 1 for its set velocity. far: the
    connection whose hold observes the far side of the spring that this one sets.
    """

    name: str
    kind: HoldRow | type[Hold]
    sources: tuple[int, ...]
    context: HoldContext
    base: Fraction = Fraction(1)
    further: tuple[int, ...] = ()
    turns: Mapping[int, float] = field(default_factory=dict)
    matrix: str | None = None
    latency: Latency | None = None
    frames: bool = False
    displacement: Reader | None = None
    velocity: Reader | None = None
    relation: str = "ALONE"
    beside: Reader | None = None
    gains: tuple[Vector, Vector] | None = None
    parts: int = 1
    spring: SetSpring | None = None
    row: int = 0
    far: str | None = None


def describe_holds(signals: SignalVector) -> dict[str, HoldParts]:
    """The parts of the hold of each connection, by its name."""
    holds = {c.name: describe_hold(c, signals) for c in signals.system.connections if c.hold}
    for observer, sets, observed, credit in [*_far_sides(holds, signals)]:
        holds[observer] = replace(holds[observer], spring=observed)
        holds[sets] = replace(holds[sets], further=(credit,), far=observer)
    return holds


def describe_hold(connection: Connection, signals: SignalVector) -> HoldParts:
    """The parts of the hold of `connection`, as if no spring had another side."""
    assert connection.hold is not None
    kind, system = HOLDS[connection.hold], signals.system
    displacement, velocity = None, None
    if kind.needs == "power":
        displacement, velocity = _motion(connection, signals)
    of = spring(connection, system.energy.springs) if kind.needs == "spring" else None
    kept = None if kind.gives_samples else connection.kind
    matrix = kept if kept in ("projector", "semidefinite") else None
    companions = ports.companion_outputs(connection, system.fmu)
    further = [signals.scalar(connection.source, s.name) for s in companions]
    if kind.needs == "reaction":  # pose and velocity of the near end
        ends = read_beside(connection, system)
        further = [i for k in (1, 3) for i in signals.sources(ends[k].of)]
    return HoldParts(
        name=connection.hold,
        kind=kind,
        sources=tuple(signals.sources(connection)),
        context=HoldContext(
            len(connection.inputs), system.timeline.seconds, displacement, velocity
        ),
        base=system.timeline.base,
        further=tuple(further),
        turns={} if matrix else _turns(connection, system),
        matrix=matrix,
        latency=connection.latency,
        frames=system.fmu[connection.source].frames,
        displacement=displacement,
        velocity=velocity,
        relation=ports.relation(connection, system.fmu) if kind.needs == "step" else "ALONE",
        beside=_beside(connection, signals),
        gains=_gains(connection, system) if kind.needs == "coupling" else None,
        parts=system.coupling.substeps.get(connection.target, 1),
        spring=of,
        row=of.ports.index(connection.to) if of else 0,
    )


def _turns(connection: Connection, system: System) -> dict[int, float]:
    """For each entry of a sample that is a wrapped angle, a full turn in its unit: of the
    connection's own, and of integrals beside them, which are as the connection that carries them
    is, or else as the source declares them."""
    if connection.kind == "angle":
        return ports.turns(connection, system.fmu)
    assert connection.hold is not None
    if HOLDS[connection.hold].needs != "integral":
        return {}
    of = replace(connection, outputs=ports.companion_outputs(connection, system.fmu))
    held = (
        c.kind
        for c in system.out_of(connection.source)
        if c.hold and not c.initial and c.outputs == of.outputs
    )
    if next(held, ports.kind(of, system.fmu)) != "angle":
        return {}
    return {len(connection.inputs) + i: turn for i, turn in ports.turns(of, system.fmu).items()}


def _motion(connection: Connection, signals: SignalVector) -> tuple[Reader, Reader | None]:
    """Readers of the displacement that is conjugate to a signal, and of its velocity where the
    target has that. Samples are converted to the target's units behind the hold, so that the
    displacement is scaled instead."""
    power, size = bond(connection, signals), len(connection.inputs)
    assert power is not None
    entries, work, places = list(power.entries), np.zeros(size), np.zeros(size, np.intp)
    work[entries], places[entries] = power.work, power.moved
    moved = Reader(signals, places.tolist(), work)
    if not power.moving:
        return moved, None
    places[entries] = power.moving
    return moved, Reader(signals, places.tolist(), work)


def _beside(connection: Connection, signals: SignalVector) -> Reader | None:
    """Reads what a hold reads beside its samples, as the inputs of other connections get it."""
    read = read_beside(connection, signals.system)
    if not read:
        return None
    places, factors, offsets = list[int](), list[float](), list[float]()
    for row in read:
        where = signals.hold(row.of.name) if row.held else None
        places += signals.sources(row.of) if where is None else range(where.start, where.stop)
        factors += [row.sign * s.conversion.factor for s in row.of.inputs]
        offsets += [row.sign * s.conversion.offset for s in row.of.inputs]
    return Reader(signals, places, np.array(factors), np.array(offsets))


def _gains(connection: Connection, system: System) -> tuple[Vector, Vector]:
    """K and B of the spring-damper whose force a connection has."""
    of = system.energy.coupling(connection, system.connections)
    assert of is not None
    K = np.array(of.stiffness)
    return K, np.array(of.damping) if of.damping else np.zeros_like(K)


def describe_spring(of: SetSpring, signals: SignalVector) -> SpringParts:
    """The parts of the energy tank of a spring-damper."""
    timeline, unit = signals.system.timeline, signals.system.fmu[of.position.partition(".")[0]]
    places, turned = _places(of.position, signals)
    stiffness, velocity = np.array(of.stiffness), None
    if of.velocity:
        velocity = Reader(signals, _places(of.velocity, signals)[0])
    return SpringParts(
        stiffness,
        np.array(of.damping) if of.damping else np.zeros_like(stiffness),
        Reader(signals, places),
        np.array([turned.get(i, 0.0) for i in range(len(places))]),
        timeline.seconds(timeline.clock(unit.clock).longest),
        velocity,
        unit.sampled,
    )


def _places(port: str, signals: SignalVector) -> tuple[Sequence[int], Mapping[int, float]]:
    """Indices of the signals of an input or output, and a full turn of its wrapped angles."""
    fmu, _, name = port.partition(".")
    system = signals.system
    unit = system.fmu[fmu]
    if c := next((c for c in system.into(fmu) if c.target_port == name), None):
        return signals.sources(c), ports.turns(c, system.fmu) if c.kind == "angle" else {}
    scalars = unit.description.port(name, "output")
    own = Connection(fmu, name, fmu, name, scalars, scalars)
    angle = unit.description.kinds.get(name) == "angle"
    return signals.port(unit, name), ports.turns(own, system.fmu) if angle else {}


def _far_sides(
    holds: Mapping[str, HoldParts], signals: SignalVector
) -> Iterator[tuple[str, str, SetSpring, int]]:
    """Of each spring with an energy tank whose force goes back to the FMU that sets its far end, to
    act on that displacement under a hold that observes its work: that connection, the one that sets
    it, the spring, and where among the signals the energy stands. A force that is late or converted
    is left out."""
    system = signals.system
    drawn = {parts.spring for parts in holds.values()}
    for i, s in enumerate(system.energy.springs):
        fmu, _, port = s.set_position.partition(".")
        sets = next((c for c in system.into(fmu) if c.target_port == port), None)
        for c in system.out_of(fmu):
            if s not in drawn or not sets or not observes(holds.get(c.name)):
                continue
            if f"{fmu}.{c.source_port}" != s.force or c.target != sets.source:
                continue
            power = bond(c, signals)
            if not power or np.any(power.factor != 1.0) or np.any(power.offset != 0.0):
                continue
            if list(power.moved) == signals.sources(sets):
                yield c.name, sets.name, s, signals.credit(i)


def observes(parts: HoldParts | None) -> bool:
    """Whether a hold observes its energy, of samples that come in time as they are."""
    if not parts or parts.latency or parts.turns or parts.matrix:
        return False
    return isinstance(parts.kind, HoldRow) and parts.kind.needs == "power"
