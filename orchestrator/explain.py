"""`--explain`: a plan as text. What runs when, and which sample each input is made from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import fields
from itertools import groupby

from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.schemes.operations import Event, Operation, Repeat
from hapticlink.orchestrator.stamps import uses
from hapticlink.orchestrator.system import System
from hapticlink.orchestrator.ticks import Clock

ROWS = 600


def explain(plan: Plan, rows: int = ROWS) -> Iterator[str]:
    """Clocks, the block of each kind of event, then a table up to the end of the first hyperperiod
    in which all phases have begun, or of the first `rows` events."""
    system, timeline = plan.system, plan.system.timeline
    base = timeline.base
    yield f"ticks of {base.numerator}/{base.denominator} s, {system.coupling}"
    for clock in timeline.clocks:
        units = ", ".join(
            u.name + (" (sampled)" if u.sampled else "")
            for u in system.units
            if u.clock == clock.name
        )
        yield f"  {clock.name}: {_steps(clock)}: {units}"
    yield from _holds(system)
    until, names = _shown(plan, rows)
    yield ""
    for event, name in names.items():
        yield f"block {name}: {_kind(event)}"
        yield from _lines(plan.block(event), "  ")
    yield ""
    yield "tick, time (s), block, FMU that is set: each input @ the tick its newest sample is of"
    events = {tick: names[event] for tick, event in plan if tick <= until}
    connections = {c.name: c for c in system.connections}
    made = ((u.tick, connections[u.connection], u.stamp) for u in uses(plan, until))
    for (tick, target), group in groupby(made, key=lambda use: (use[0], use[1].target)):
        inputs = " ".join(f"{c.target_port}@{stamp}" for _, c, stamp in group)
        yield f"{tick:>8}  {timeline.seconds(tick):<12.9g} {events[tick]:<3} {target}: {inputs}"


def _shown(plan: Plan, rows: int) -> tuple[int, dict[Event, str]]:
    """The last tick to show, and a name for each kind of event until then."""
    clocks = plan.system.timeline.clocks
    until = plan.system.timeline.end
    periods = [c.period for c in clocks if c.period]
    if len(periods) == len(clocks):
        begun = max(c.first % c.longest for c in clocks)
        until = min(until, begun + math.lcm(*periods))
    names: dict[Event, str] = {}
    last = 0
    for count, (tick, event) in enumerate(plan):
        if count >= rows or tick > until:
            break
        last = tick
        names.setdefault(event, _letters(len(names)))
    return last, names


def _letters(n: int) -> str:
    return chr(ord("A") + n) if n < 26 else _letters(n // 26 - 1) + _letters(n % 26)


def _steps(clock: Clock) -> str:
    if clock.period:
        return f"every {clock.period} ticks" + f", first {clock.first}" * (
            clock.first != clock.period
        )
    return f"steps of {clock.shortest} to {clock.longest} ticks"


def _holds(system: System) -> Iterator[str]:
    for c in system.connections:
        if c.hold:
            late = f", latency {c.latency}" if c.latency else ""
            kind = f" of a {c.kind}" if c.kind else ""
            yield f"  {c.name}: {c.hold}{kind}{late}"


def _kind(event: Event) -> str:
    told = (f"{f.clock} {f.dticks}" + " (last)" * f.final for f in event.firings)
    return ("the start, " if event.first else "") + ", ".join(told)


def _lines(block: Iterable[Operation], indent: str) -> Iterator[str]:
    for operation in block:
        if isinstance(operation, Repeat):
            yield f"{indent}repeat until these agree: {', '.join(operation.connections)}"
            yield from _lines((*operation.guess, *operation.body), indent + "  ")
            yield from _lines(operation.again, indent + "  again: ")
        else:
            yield indent + _line(operation)


def _line(operation: Operation) -> str:
    """`step virtual_mechanism dticks 15`: the operation, what it works on, what is not usual."""
    first, *others = vars(operation).items() or [("", "")]
    usual = {f.name: f.default for f in fields(operation)}
    given = [f"{name} {value}" for name, value in others if value != usual[name]]
    return " ".join(filter(None, [type(operation).__name__.lower(), str(first[1]), *given]))
