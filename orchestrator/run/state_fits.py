"""Whether a scene can go on from the state of a run: what acts at the start alone, or has acted,
has to be as it was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.state_file import expect_state
from hapticlink.orchestrator.run.run_state import (
    RunState,
    new_starts,
    order_of_calls,
    with_other_holds,
)
from hapticlink.orchestrator.system.changes import check_change, why_at_start_alone
from hapticlink.orchestrator.system.system import System

SHOWN = 8
"""Settings that differ that a message shows."""


def require_fit(state: RunState, system: System, tables: Mapping[str, Any]) -> None:
    """Raises InputFault with all that keeps a scene, of these tables, from going on."""
    with expect_state(state.path):
        found = [*why_no_fit(state, system)]
        other = [*_differences(state.content["scene"], tables)]
    if found:
        lines = [f"{state.path}: the scene cannot go on from this state", *found]
        if other:
            more = f" and {len(other) - SHOWN} more" if len(other) > SHOWN else ""
            lines.append(f"settings that differ: {', '.join(other[:SHOWN])}{more}")
        raise InputFault("\n  ".join(lines))


def why_no_fit(state: RunState, system: System) -> Iterator[str]:
    """What keeps a system from going on from a state, and what to do."""
    saved, time = state.content, system.timeline
    if missing := [*_unpaired("FMU", saved["fmus"], system.fmu)]:
        yield from missing
        return
    for u in system.fmus:
        of = saved["fmus"][u.name]
        if of["guid"] != u.description.guid or of["timing"] != u.description.timing:
            yield f"{u.name} is another FMU: leave what it is made of as it was"
    yield from _unpaired("connection", saved["connections"], system.connection)
    yield from (
        f"{key} is another: leave it as it was"
        for key, value in order_of_calls(system).items()
        if saved["coupling"][key] != value
    )
    if saved["begin"] != str(time.begin):
        yield "start_time is another: leave it as it was"
    yield from _why_other_clocks(state, system)
    yield from _why_other_changes(state, system)
    if {*saved["connections"]} == {*system.connection}:
        yield from _why_other_holds(state, system)
    yield from _why_other_starts(state, system)


def _unpaired(what: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    yield from (f"{what} {name} is not in the scene" for name in before if name not in now)
    yield from (f"{what} {name} is not in the state" for name in now if name not in before)


def _why_other_clocks(state: RunState, system: System) -> Iterator[str]:
    saved, time = state.content, system.timeline
    if (end := time.time(time.end)) <= state.time:
        yield f"the run ends at {end:g} s, and its time is {state.time:g} s: take a longer duration"
        return
    known = saved["events"]["clocks"]
    if saved["base"] != str(time.base) or {*known} != {c.name for c in time.clocks}:
        yield "its rates are others: leave them as they were (`[[at]]` can set graphics.rate later)"
        return
    for clock in time.clocks:
        number, tick, last = known[clock.name]
        starts = clock.starts
        begun = number == 0 or (number <= len(starts) and starts[number - 1] == last)
        if not begun or number >= len(starts) or starts[number] != tick:
            key = ".".join(map(str, clock.key)) or clock.name
            yield f"{key}: its steps until then are others: leave it as it was"


def _why_other_changes(state: RunState, system: System) -> Iterator[str]:
    saved = {each["key"] for each in state.content["changes"]}
    now = {c.key: c for c in system.changes if c.fmu}
    for key, change in now.items():
        if key not in saved and change.begin < state.time:
            yield f"[[at]] {change.text}, at {change.time:g} s, is past: take a later time"
    for each in state.content["changes"]:
        if each["key"] not in now and each["begin"] < state.time:
            yield f"[[at]] {each['text']}, at {each['time']:g} s, has acted: leave it in the scene"


def _why_other_holds(state: RunState, system: System) -> Iterator[str]:
    for c in with_other_holds(state, system):
        hold, latency, kind = state.content["connections"][c.name]
        if (hold is None) != (c.hold is None) or kind != c.kind or latency != repr(c.latency):
            what = f"{hold or 'none'}, latency {latency}" if kind == c.kind else f"kind {kind}"
            yield f"hold of {c.name}: {what} in the state: leave hold, latency and kind as then"
            continue
        try:
            check_change(system, c, hold, None)
        except InputFault as why:
            yield f"{why} (it is {c.hold} in the scene)"


def _why_other_starts(state: RunState, system: System) -> Iterator[str]:
    acted = {name for each in state.content["changes"] for name in each["inputs"]}
    for change in new_starts(state, system):
        why = why_at_start_alone(system, change.fmu, change.inputs[0])
        if not why and change.text in acted:
            why = "is set by [[at]], too"
        if why:
            yield f"{change.text} {why}: leave it as it was"


def _differences(before: Any, now: Any, path: Sequence[str] = ()) -> Iterator[str]:
    """The keys whose values differ between the tables of two scenes, as `key = now (before)`."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in {**before, **now}:
            if path or key not in ("resume", "title", "description", "record"):
                yield from _differences(before.get(key), now.get(key), (*path, str(key)))
    elif isinstance(before, list | tuple) and isinstance(now, list | tuple):
        if len(before) == len(now):
            for i, (one, other) in enumerate(zip(before, now, strict=True)):
                yield from _differences(one, other, (*path, str(i)))
        else:
            yield f"{'.'.join(path)} ({len(now)} entries; {len(before)} in the state)"
    elif before != now:
        yield f"{'.'.join(path)} = {now} ({before} in the state)"
