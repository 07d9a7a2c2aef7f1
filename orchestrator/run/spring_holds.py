"""Energy tanks of the spring-dampers that holds set, and the energy that crosses their far side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.energy_tank import EnergyTank, NearEnd
from hapticlink.orchestrator.holds.hold import Hold, Vector
from hapticlink.orchestrator.run.energy.bonds import Reader, bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.records import SetSpring
from hapticlink.orchestrator.system.ports import turns
from hapticlink.orchestrator.system.system import Connection


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


def tank(of: SetSpring, signals: SignalVector) -> EnergyTank:
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


def join_sides(
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
