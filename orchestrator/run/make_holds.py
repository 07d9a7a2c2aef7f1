"""Creates the hold of each connection, with its context, and the energy tanks of the spring-dampers
that holds set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hapticlink.orchestrator.base.errors import Fault, shorten
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.energy_tank import EnergyTank, NearEnd
from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Needs, Vector
from hapticlink.orchestrator.holds.holds_on_manifolds import Projector, Semidefinite, Unwrapped
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene_tables import SetSpring
from hapticlink.orchestrator.system.latency_and_loss import Late, SampleLink
from hapticlink.orchestrator.system.ports import companion_outputs, kind, turns
from hapticlink.orchestrator.system.springs import spring
from hapticlink.orchestrator.system.system import Connection, System


def make_holds(signals: SignalVector) -> tuple[dict[str, Hold], list[EnergyTank]]:
    """The hold of each connection by name, and the energy tanks, each shared by the holds of one
    spring-damper."""
    shared: dict[SetSpring, EnergyTank] = {}
    connections = signals.system.connections
    holds = {c.name: make_hold(c, signals, shared) for c in connections if c.hold}
    _join_sides(holds, shared, signals)
    return holds, [*shared.values()]


def make_hold(
    connection: Connection, signals: SignalVector, shared: dict[SetSpring, EnergyTank]
) -> Hold:
    """The hold of `connection`, wrapped for its kind, its latency and what it reads beside its
    samples; `shared` are the energy tanks so far."""
    assert connection.hold is not None
    made_by, size, system = HOLDS[connection.hold], len(connection.inputs), signals.system
    context = _context(connection, made_by.needs, signals, shared)

    def make() -> Hold:
        own = made_by(context)
        if connection.hold not in HOLDS.origins:
            return own
        return CheckedHold(own, size, connection.hold, connection.name)

    hold = make()
    if connection.kind == "projector" and not made_by.gives_samples:
        hold = Projector(make, size)
    elif connection.kind == "semidefinite" and not made_by.gives_samples:
        hold = Semidefinite(make, size)
    elif turned := _turns(connection, system):
        hold = Unwrapped(make, list(turned), list(turned.values()))
    if connection.latency:
        hold = Late(hold, SampleLink(connection.latency, system.timeline.base))
    if further := companion_outputs(connection, system.fmu):
        places = [signals.scalar(connection.source, s.name) for s in further]
        hold = WithFurther(hold, Reader(signals, places))
    return hold


def _turns(connection: Connection, system: System) -> dict[int, float]:
    """For each entry of a sample that is a wrapped angle, a full turn in its unit: of the
    connection's own, and of integrals beside them, which are as the connection that carries them
    is, or else as the source declares them."""
    if connection.kind == "angle":
        return turns(connection, system.fmu)
    assert connection.hold is not None
    if HOLDS[connection.hold].needs != "integral":
        return {}
    of = replace(connection, outputs=companion_outputs(connection, system.fmu))
    held = (
        c.kind
        for c in system.out_of(connection.source)
        if c.hold and not c.initial and c.outputs == of.outputs
    )
    if next(held, kind(of, system.fmu)) != "angle":
        return {}
    return {len(connection.inputs) + i: turn for i, turn in turns(of, system.fmu).items()}


def _context(
    connection: Connection,
    needs: Needs | None,
    signals: SignalVector,
    shared: dict[SetSpring, EnergyTank],
) -> HoldContext:
    """The context of a hold; displacement, velocity and tank only if the hold needs them."""
    size, moved, moving, tank = len(connection.inputs), None, None, None
    if needs == "power" and (power := bond(connection, signals)):
        # Samples are converted to the target's units behind the hold, so that the displacement is
        # scaled instead.
        entries, work, places = list(power.entries), np.zeros(size), np.zeros(size, np.intp)
        work[entries], places[entries] = power.work, power.moved
        moved = Reader(signals, places.tolist(), work)
        if power.moving:
            places[entries] = power.moving
            moving = Reader(signals, places.tolist(), work)
    if needs == "spring":
        of = spring(connection, signals.system.energy.springs)
        assert of is not None
        if of not in shared:
            shared[of] = _tank(of, signals)
        row = of.ports.index(f"{connection.target}.{connection.target_port}")
        tank = shared[of], row
    return HoldContext(size, signals.system.timeline.seconds, moved, moving, tank)


class CheckedHold(Hold):
    """Wraps a hold of a plugin; those of the package have tests instead. A value that is no vector
    of `size` finite numbers is a Fault, which names the hold and its connection."""

    def __init__(self, hold: Hold, size: int, name: str, connection: str) -> None:
        self._hold, self._size = hold, size
        self._name, self._connection = name, connection

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        value = self._hold.value(tick, ahead)
        if (
            not isinstance(value, np.ndarray)
            or value.shape != (self._size,)
            or value.dtype.kind not in "fiu"
            or not np.isfinite(value).all()
        ):
            raise Fault(
                f"hold {self._name!r} of {self._connection}: its value is "
                f"{shorten(' '.join(repr(value).split()))}, where {self._size} finite numbers in "
                "a NumPy array are needed"
            )
        return value


class WithFurther(Hold):
    """Appends what it reads to each sample, so that both have the same latency: the source's
    derivative or integral, or the energy that the far side of a spring has put in, which `account`
    (with where to write it) then knows."""

    def __init__(
        self, hold: Hold, further: Reader, account: tuple[Account, Vector] | None = None
    ) -> None:
        self.hold, self.further, self.account = hold, further, account
        self.link = getattr(hold, "link", None)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if self.account:
            observer, credit = self.account
            credit[:] = observer.credit
        self.hold.push(stamp, np.concatenate([sample, self.further()]), arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.hold.value(tick, ahead)


def _tank(of: SetSpring, signals: SignalVector) -> EnergyTank:
    timeline, unit = signals.system.timeline, signals.system.fmu[of.position.partition(".")[0]]
    places, turned = _places(of.position, signals)
    stiffness, velocity = np.array(of.stiffness), None
    if of.velocity:
        velocity = Reader(signals, _places(of.velocity, signals)[0])
    near = NearEnd(
        Reader(signals, places),
        np.array([turned.get(i, 0.0) for i in range(len(places))]),
        timeline.seconds(timeline.clock(unit.clock).longest),
        timeline.seconds,
        velocity,
        unit.sampled,
    )
    damping = np.array(of.damping) if of.damping else np.zeros_like(stiffness)
    return EnergyTank(stiffness, damping, near)


def _places(port: str, signals: SignalVector) -> tuple[Sequence[int], Mapping[int, float]]:
    """Indices of the signals of an input or output, and a full turn of its wrapped angles."""
    fmu, _, name = port.partition(".")
    system = signals.system
    unit = system.fmu[fmu]
    if c := next((c for c in system.into(fmu) if c.target_port == name), None):
        return signals.sources(c), turns(c, system.fmu) if c.kind == "angle" else {}
    scalars = unit.description.port(name, "output")
    own = Connection(fmu, name, fmu, name, scalars, scalars)
    angle = unit.description.kinds.get(name) == "angle"
    return signals.port(unit, name), turns(own, system.fmu) if angle else {}


def _join_sides(
    holds: dict[str, Hold], tanks: Mapping[SetSpring, EnergyTank], signals: SignalVector
) -> None:
    """Give the energy tank of each spring both sides: where its force goes back to the FMU that
    sets its far end, to act on that displacement, and the hold observes the work of it. A force
    that is late or converted is left out."""
    system = signals.system
    for i, s in enumerate(system.energy.springs):
        fmu, _, port = s.set_position.partition(".")
        sets = next((c for c in system.into(fmu) if c.target_port == port), None)
        for c in system.out_of(fmu):
            observer = holds.get(c.name)
            if s not in tanks or not sets or not isinstance(observer, Account):
                continue
            if f"{fmu}.{c.source_port}" != s.force or c.target != sets.source:
                continue
            power = bond(c, signals)
            if not power or np.any(power.factor != 1.0) or np.any(power.offset != 0.0):
                continue
            if list(power.moved) == signals.sources(sets):
                observer.tank, place = tanks[s], signals.credit(i)
                credit = Reader(signals, [place]), (observer, signals.values[place : place + 1])
                holds[sets.name] = WithFurther(holds[sets.name], *credit)
