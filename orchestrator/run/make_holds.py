"""Creates the hold of each connection, with its context."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticlink.orchestrator.base.errors import Fault, shortened
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.energy_tank import EnergyTank
from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Vector
from hapticlink.orchestrator.holds.holds_on_manifolds import Projector, Semidefinite, Unwrapped
from hapticlink.orchestrator.run import spring_holds
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.records import SetSpring
from hapticlink.orchestrator.system.latency_and_loss import Late, Link
from hapticlink.orchestrator.system.ports import beside, kind, turns
from hapticlink.orchestrator.system.springs import spring
from hapticlink.orchestrator.system.system import Connection, System


def make_holds(system: System, signals: SignalVector) -> tuple[dict[str, Hold], list[EnergyTank]]:
    """The hold of each connection by name, and the energy tanks, each shared by the holds of one
    spring-damper."""
    shared: dict[SetSpring, EnergyTank] = {}
    holds = {c.name: make_hold(c, system, signals, shared) for c in system.connections if c.hold}
    spring_holds.join_sides(holds, shared, system, signals)
    return holds, [*shared.values()]


def make_hold(
    connection: Connection,
    system: System,
    signals: SignalVector,
    shared: dict[SetSpring, EnergyTank],
) -> Hold:
    """The hold of `connection`, wrapped for its kind, its latency and what it reads beside its
    samples; `shared` are the energy tanks so far."""
    assert connection.hold is not None
    made_by, size = HOLDS[connection.hold], len(connection.inputs)
    context = _context(connection, system, signals, shared)

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
        hold = Late(hold, Link(connection.latency, system.timeline.base))
    if further := beside(connection, system.fmu):
        places = [signals.scalar(connection.source, s.name) for s in further]
        hold = spring_holds.WithFurther(hold, spring_holds.reader(signals, places))
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
    of = replace(connection, outputs=beside(connection, system.fmu))
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
    system: System,
    signals: SignalVector,
    shared: dict[SetSpring, EnergyTank],
) -> HoldContext:
    """The context of a hold; displacement, velocity and tank only if the hold needs them."""
    size, moved, moving, tank = len(connection.inputs), None, None, None
    power = bond(connection, system, signals)
    if HOLDS[connection.hold or ""].needs == "power" and power:
        # Samples are converted to the target's units behind the hold, so that the displacement is
        # scaled instead.
        entries, work, places = list(power.entries), np.zeros(size), np.zeros(size, np.intp)
        work[entries], places[entries] = power.work, power.moved
        moved = Reader(signals, places.tolist(), work)
        if power.moving:
            places[entries] = power.moving
            moving = Reader(signals, places.tolist(), work)
    if HOLDS[connection.hold or ""].needs == "spring":
        of = spring(connection, system.energy.springs)
        assert of is not None
        if of not in shared:
            shared[of] = spring_holds.tank(of, system, signals)
        row = of.ports.index(f"{connection.target}.{connection.target_port}")
        tank = shared[of], row
    return HoldContext(size, system.timeline.seconds, moved, moving, tank)


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
                f"{shortened(' '.join(repr(value).split()))}, where {self._size} finite numbers in "
                "a NumPy array are needed"
            )
        return value
