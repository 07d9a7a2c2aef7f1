"""Iterated coupling: the step of an algebraic loop of plants is repeated to a fixed point.

Sampled blocks come first, as in Gauss-Seidel, then the plants of a rate, each after those that feed
it. The plants of a loop step together, with a guess of their outputs at the end of the step pushed
into their holds, which thus interpolate; the step is repeated from the saved states with improved
guesses until guess and outputs agree. With holds by polynomials of degree k the order is k + 1, as
for Jacobi, with a smaller error and no stability limit on the step size beyond that of the plants.

A plant holds its inputs constant over each substep. Two adjacent substeps get
(f1 + f2)/2 -+ (2/sqrt 3)(f2 - f1)/2, with f1, f2 the input at the two Gauss points of the pair:
mean and first moment equal those of the input up to cubics, so that substeps cause an error of
order 4 (the commutator-free rule of Blanes and Moan 2006, for constant stages). The scheme is not
causal.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from math import sqrt

from hapticlink.orchestrator.plan import dependency_order, operation_sequences
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Event,
    Get,
    Operation,
    Push,
    Repeat,
    Rollback,
    Save,
    Set,
    Step,
)
from hapticlink.orchestrator.plan.schemes import gauss_seidel
from hapticlink.orchestrator.system.system import Connection, Fmu, System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault for a feed-through loop of sampled blocks, and
    for FMUs of a loop that do not support rollback."""
    operations = gauss_seidel.before_plants(system, event)
    for group in groups(system, event):
        if len(group) > 1:
            operations += _repeat(system, event, group)
        else:
            operations += _step(system, event, group[0], [])
            operations.append(Get(group[0].name, operation_sequences.dticks(event, group[0])))
        operations += _push_on(system, event, group)
    return tuple(operations)


def order_fmus(system: System) -> list[list[Fmu]]:
    plants = [u for u in system.fmus if not u.sampled]
    clocks = dict.fromkeys(u.clock for u in plants)
    of_a_rate = ([u for u in plants if u.clock == clock] for clock in clocks)
    return [*gauss_seidel.order_fmus(system), *of_a_rate]


def groups(system: System, event: Event) -> list[list[Fmu]]:
    """The plants that start a step, in order; those of a loop are in one group."""
    starting = operation_sequences.starting(
        system, event, operation_sequences.firing(system, event)[1]
    )
    clock = {u.name: u.clock for u in starting}
    feeds = {
        u.name: {c.source for c in system.into(u.name) if clock.get(c.source) == u.clock}
        for u in starting
    }
    return [[system.fmu[n] for n in group] for group in dependency_order.components(feeds)]


def _repeat(system: System, event: Event, group: list[Fmu]) -> Iterator[Operation]:
    names = [u.name for u in group]
    operation_sequences.require_rollback(system, names, "coupling = 'iterated'")
    loop = [c for n in names for c in system.into(n) if c.source in names]
    dticks = operation_sequences.dticks(event, group[0])
    body = [op for fmu in group for op in _step(system, event, fmu, loop)]
    # The signal vector still contains the guess, which direct feed-through is evaluated with.
    body += [Set(n, now=True) for n in names if n in system.coupling.get_after_set]
    body += [Get(n, dticks) for n in names]
    yield from (Save(n) for n in names)
    yield Repeat(
        tuple(c.name for c in loop),
        dticks,
        tuple(Push(c.name, dticks) for c in loop if c.hold),
        tuple(body),
        tuple(Rollback(n) for n in names),
    )


def _push_on(system: System, event: Event, group: list[Fmu]) -> Iterator[Operation]:
    """Push a group's outputs at the end of the step to the plants of its rate after it."""
    names, clock = [u.name for u in group], group[0].clock
    plants = [u.name for u in system.fmus if u.clock == clock and not u.sampled]
    for c in (c for n in names for c in system.out_of(n) if c.hold):
        if c.target in plants and c.target not in names:
            yield Push(c.name, operation_sequences.dticks(event, group[0]))


def _step(system: System, event: Event, fmu: Fmu, loop: list[Connection]) -> Iterator[Operation]:
    """The step of a plant; each substep uses mean and first moment of the inputs from `loop`."""
    parts = system.coupling.substeps.get(fmu.name, 1)
    dticks = operation_sequences.dticks(event, fmu)
    inside = {c.name for c in loop}
    for part in range(parts):
        for operation in operation_sequences.feed(system, event, fmu, part):
            match operation:
                case Evaluate(name) if name in inside:
                    yield Blend(name, substep(part, parts, dticks))
                case _:
                    yield operation
        yield Step(fmu.name, dticks, part, parts)


def substep(part: int, parts: int, dticks: int) -> tuple[tuple[float, Fraction], ...]:
    """The constant input of a substep as (weight, ahead) of the input's values, see the module's
    text. A last substep without a partner uses the mean of two Gauss points.
    """
    width = Fraction(dticks, parts)
    pair = part - part % 2
    alone = pair + 1 == parts
    span = width if alone else 2 * width
    middle = pair * width + span / 2
    offset = Fraction(1 / sqrt(12)) * span
    share = 0.0 if alone else (1 / sqrt(3) if part % 2 else -1 / sqrt(3))
    return ((0.5 - share, middle - offset), (0.5 + share, middle + offset))
