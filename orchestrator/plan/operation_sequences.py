"""Sequences of operations that all schemes share: publish, feed, step, record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.description import STATE
from hapticlink.orchestrator.plan.operations import (
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
from hapticlink.orchestrator.system.system import Fmu, System


def firing(system: System, event: Event) -> tuple[list[Fmu], list[Fmu]]:
    """The FMUs whose clocks fire at this event, as (sampled, continuous)."""
    clocks = {f.clock for f in event.firings}
    due = [u for u in system.fmus if u.clock in clocks]
    return [u for u in due if u.sampled], [u for u in due if not u.sampled]


def starting(system: System, event: Event, continuous: list[Fmu]) -> list[Fmu]:
    """The plants that start a step; steps that would pass the end of the run are not started, but
    for those whose samples are wanted before it: by others that start one."""
    started = {f.clock for f in event.firings if not f.final}
    wanted = system.early if started else ()
    return [u for u in continuous if u.clock in started or u.name in wanted]


def publish(system: System, fmu: Fmu, ahead: int = 0) -> Iterator[Operation]:
    """Read the outputs of an FMU and push them into the holds of its connections, but for those
    that had them when its step began."""
    yield Get(fmu.name, ahead)
    for connection in system.out_of(fmu.name):
        if connection.hold and connection.needs != "step":
            yield Push(connection.name, ahead)


def publish_early(system: System, event: Event, fmu: Fmu) -> Iterator[Operation]:
    """Read the outputs of an FMU whose step was just taken from this event on, and push them into
    the holds that want them now; they describe the end of the step."""
    ahead = dticks(event, fmu)
    yield Get(fmu.name, ahead)
    for connection in system.out_of(fmu.name):
        if connection.needs == "step":
            yield Push(connection.name, ahead)


def early_first(system: System, plants: list[Fmu]) -> tuple[list[Fmu], list[Fmu]]:
    """The plants of clocks at which steps are taken early, and the others."""
    clocks = {system.fmu[name].clock for name in system.early}
    return [u for u in plants if u.clock in clocks], [u for u in plants if u.clock not in clocks]


def publish_ended(system: System, event: Event, continuous: list[Fmu]) -> Iterator[Operation]:
    """Publish the outputs of the plants whose steps end at this event (initialisation has read
    those of t = 0). Plants in `get_after_set` take their new inputs and are read once more, so that
    direct feed-through acts within the tick."""
    if not event.first:
        for fmu in continuous:
            yield from publish(system, fmu)
        for fmu in continuous:
            if fmu.name in system.coupling.get_after_set and system.into(fmu.name):
                yield Set(fmu.name, now=True)
                yield from publish(system, fmu)


def feed(system: System, event: Event, fmu: Fmu, part: int = 0) -> Iterator[Operation]:
    """Evaluate the holds in front of an FMU and set its inputs.

    A plant keeps an input constant over its step or substep, so it gets the hold's value at the
    middle of it. A sampled block, and one whose outputs describe the beginning of its step, get the
    value at this tick.
    """
    incoming = system.into(fmu.name)
    width = Fraction(0)
    if not (fmu.sampled or fmu.frames):
        width = Fraction(dticks(event, fmu), system.coupling.substeps.get(fmu.name, 1))
    for connection in incoming:
        if connection.hold:
            yield Evaluate(connection.name, part * width + width / 2)
    if incoming:
        yield Set(fmu.name)


def dticks(event: Event, fmu: Fmu) -> int:
    return next(f.dticks for f in event.firings if f.clock == fmu.clock)


def step(system: System, event: Event, fmu: Fmu) -> Iterator[Operation]:
    """Step an FMU whose inputs are set; inputs of a plant are updated before each substep."""
    parts = 1 if fmu.sampled else system.coupling.substeps.get(fmu.name, 1)
    for part in range(parts):
        if part:
            yield from feed(system, event, fmu, part)
        yield Step(fmu.name, dticks(event, fmu), part, parts)


def record(system: System, event: Event) -> Iterator[Operation]:
    """Record a row for each clock that fires, then test the stop condition."""
    for f in event.firings:
        yield from map(Record, system.recording.tables(f.clock))
    condition = system.ends_when
    if condition and any(f.clock == system.fmu[condition.fmu].clock for f in event.firings):
        yield StopWhen()


def require_rollback(system: System, names: Iterable[str], what: str) -> None:
    """Raises InputFault with the FMUs of `names` that cannot save and restore their state; `what`
    needs it."""
    unable = [n for n in names if not system.fmu[n].description.restores_state]
    if unable:
        flags = {STATE[system.fmu[n].description.fmi] for n in unable}
        raise InputFault(
            f"{what} takes steps back, and {', '.join(unable)} cannot save and restore its state "
            f"({' or '.join(sorted(flags))} is not true); take coupling = 'gauss-seidel' or "
            "'jacobi' with a higher rate"
        )
