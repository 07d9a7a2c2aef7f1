"""The parts that blocks of every scheme are made of."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.schemes.operations import (
    Evaluate,
    Event,
    Get,
    Operation,
    Push,
    Record,
    Set,
    Step,
    StopWhen,
)
from hapticlink.orchestrator.system import System, Unit


def firing(system: System, event: Event) -> tuple[list[Unit], list[Unit]]:
    """(sampled, continuous) FMUs whose clocks fire."""
    clocks = {f.clock for f in event.firings}
    due = [u for u in system.units if u.clock in clocks]
    return [u for u in due if u.sampled], [u for u in due if not u.sampled]


def starting(event: Event, continuous: list[Unit]) -> list[Unit]:
    """The plants that start a step; a step past the end of the run is not started."""
    started = {f.clock for f in event.firings if not f.final}
    return [u for u in continuous if u.clock in started]


def publish(system: System, unit: Unit) -> Iterator[Operation]:
    """Read the outputs, and hand them to the holds behind them."""
    yield Get(unit.name)
    for connection in system.out_of(unit.name):
        if connection.hold:
            yield Push(connection.name)


def publish_ended(system: System, event: Event, continuous: list[Unit]) -> Iterator[Operation]:
    """The outputs of the plants whose steps end here; initialisation has read the first."""
    if not event.first:
        for unit in continuous:
            yield from publish(system, unit)


def feed(system: System, unit: Unit) -> Iterator[Operation]:
    """Set the inputs, held ones at their value of this tick."""
    incoming = system.into(unit.name)
    for connection in incoming:
        if connection.hold:
            yield Evaluate(connection.name)
    if incoming:
        yield Set(unit.name)


def step(event: Event, unit: Unit) -> Step:
    return Step(unit.name, next(f.dticks for f in event.firings if f.clock == unit.clock))


def record(system: System, event: Event) -> Iterator[Operation]:
    """One row for each clock that fires, then the question whether the run is over."""
    for f in event.firings:
        yield Record(f.clock)
    condition = system.ends_when
    if condition and any(f.clock == system.unit[condition.fmu].clock for f in event.firings):
        yield StopWhen()
