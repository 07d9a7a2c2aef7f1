"""`--explain`: a plan as text: which operation is executed when, and the instant that the newest
sample describes from which each input is computed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields
from itertools import groupby
from typing import get_args

from hapticlink.orchestrator.base.ticks import Clock
from hapticlink.orchestrator.plan.operations import Event, Operation, Repeat
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import pattern_end, uses
from hapticlink.orchestrator.system.system import System

LEGEND = "\n".join(
    (
        "Time is counted in ticks. The operations of an event form a block; events of one kind "
        "share it:",
        *(f"  {kind.__name__.lower():<10}{kind.does}" for kind in get_args(Operation)),
        "`ahead n`: for a time n ticks after the event. More: docs/holds.md, docs/coupling.md.\n",
    )
)
PRINTED = 600
"""Number of events in a table that is printed."""


def explain(plan: Plan, rows: int | None = None) -> Iterator[str]:
    """The lines of the text: the clocks, the operations of each kind of event, and a table of the
    events until their pattern repeats (`pattern_end`), limited to the first `rows` events."""
    system, timeline = plan.system, plan.system.timeline
    base = timeline.base
    yield LEGEND
    yield f"ticks of {base.numerator}/{base.denominator} s, {system.coupling.scheme}"
    for clock in timeline.clocks:
        fmus = ", ".join(
            u.name + (" (sampled)" if u.sampled else "")
            for u in system.fmus
            if u.clock == clock.name
        )
        yield f"  {clock.name}: {_steps(clock)}: {fmus}"
    yield from _count_fetched(system)
    yield from _holds(system)
    for loop in plan.loops():
        yield f"  loop {loop.ring}: {', '.join(loop.fmus)} in this order"
    last, names = pattern_end(system), dict[Event, str]()
    events: dict[int, str] = {}
    cut = False
    for tick, event in plan:
        if tick > last or (cut := len(events) == rows):
            break
        events[tick] = names.setdefault(event, _letters(len(names)))
    yield ""
    for event, name in names.items():
        yield f"block {name}: {_kind(event)}"
        yield from _lines(plan.block(event), "  ")
    yield ""
    yield (
        "tick, time (s), block, FMU that gets inputs: "
        "each input @ the tick that its newest sample describes"
    )
    connections = {c.name: c for c in system.connections}
    used = ((u.tick, connections[u.connection], u.described) for u in uses(plan, max(events)))
    for (tick, target), group in groupby(used, key=lambda use: (use[0], use[1].target)):
        inputs = " ".join(f"{c.target_port}@{described}" for _, c, described in group)
        yield f"{tick:>8}  {timeline.time(tick):<12.9g} {events[tick]:<3} {target}: {inputs}"
    if cut:
        yield f"cut after {rows} events; a run writes them all to plan.txt"


def _letters(n: int) -> str:
    """A name for the n-th kind of event: A to Z, then AA, AB, ..."""
    return chr(ord("A") + n) if n < 26 else _letters(n // 26 - 1) + _letters(n % 26)


def _steps(clock: Clock) -> str:
    if clock.period:
        return f"every {clock.period} ticks" + f", first {clock.first}" * (
            clock.first != clock.period
        )
    return f"steps of {clock.shortest} to {clock.longest} ticks"


def _count_fetched(system: System) -> Iterator[str]:
    """How many outputs of each FMU are fetched, how many of these are written, and what integrates
    it where it has no solver."""
    written = system.recording.outputs
    rows = f" in every row of {system.recording.every}" if system.recording.every > 1 else ""
    for u in system.fmus:
        names = [s.name for s in u.description.outputs]
        many = len([n for n in names if written is None or f"{u.name}.{n}" in written])
        some = f", {len(u.recorded_only)} of them for rows alone" if u.recorded_only else ""
        solved = f", {u.description.solver}" * bool(u.description.solver)
        yield f"  {u.name}: {len(names)} outputs fetched{some}, {many} recorded{rows}{solved}"


def _holds(system: System) -> Iterator[str]:
    for c in system.connections:
        if c.hold:
            late = f", latency {c.latency}" if c.latency else ""
            kind = f" of a {c.kind}" if c.kind else ""
            yield f"  {c.name}: {c.hold}{kind}{late}"


def _kind(event: Event) -> str:
    """`the start, haptics 15, graphics 256`: the clocks that fire, with the steps that they start
    (ticks)."""
    clocks = (f"{f.clock} {f.dticks}" + " (last)" * f.final for f in event.firings)
    return ("the start, " if event.first else "") + ", ".join(clocks)


def _lines(block: Iterable[Operation], indent: str) -> Iterator[str]:
    for operation in block:
        if isinstance(operation, Repeat):
            yield f"{indent}repeat until these agree: {', '.join(operation.connections)}"
            yield from _lines((*operation.guess, *operation.body), indent + "  ")
            yield from _lines(operation.again, indent + "  again: ")
        else:
            yield indent + _line(operation)


def _line(operation: Operation) -> str:
    """An operation with its FMU or connection and every argument that differs from its default, as
    in `step virtual_mechanism dticks 15`."""
    first, *others = vars(operation).items() or [("", "")]
    defaults = {f.name: f.default for f in fields(operation)}
    given = [f"{name} {value}" for name, value in others if value != defaults[name]]
    return " ".join(filter(None, [type(operation).__name__.lower(), str(first[1]), *given]))
