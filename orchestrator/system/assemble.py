"""The system of a scene: its FMUs described, connected, held and checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from hapticlink.orchestrator.base.faults import InputFault, SceneFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.conditions import Condition, parse_condition
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system import checks, haptic_loop
from hapticlink.orchestrator.system.assign_holds import assign, rules_of
from hapticlink.orchestrator.system.connections import Ends, Wiring
from hapticlink.orchestrator.system.system import Connection, Fmu, System


def from_scene(scene: Scene, timeline: Timeline, files: Mapping[str, Path]) -> System:
    """The system of `scene` with the FMUs of its blocks in `files`. Raises SceneFault for FMUs
    and connections that do not fit, and for names in holds and stop_when that it does not have."""
    wiring = Wiring(scene)
    of = timeline.of
    ours = tuple(Fmu(b.name, describe(files[b.name]), of[b.name]) for b in blocks(scene))
    foreign = (
        Fmu(fmu.name, description, of[fmu.name], starts, fmu.isolate)
        for fmu, description, starts in wiring.fmus()
    )
    units = tuple(replace(u, isolate=u.isolate or scene.isolate) for u in (*ours, *foreign))
    ends = tuple(wiring.ends({u.name: u.description for u in units}))
    rows = _not_replaced(haptic_loop.connections(scene), ends)
    wiring.whole(ends, {u.name: u.description for u in ours}, haptic_loop.connections(scene))
    connected = (
        *connect(ours, rows, scene.hold, scene.holds),
        *(_held(e, units, scene.hold, scene.holds) for e in ends),
    )
    findings = wiring.findings
    rules = rules_of(scene, {_between(e): e.hold for e in ends if e.hold})
    made, refused = assign(units, connected, timeline, rules)
    findings += [
        *checks.unfit(scene, units, made, refused),
        *checks.step_sizes(scene, units, timeline),
    ]
    findings += checks.iterated(scene, units, made)
    condition = parse_condition(scene.ends_when) if scene.ends_when else None
    if condition and not _has_output(units, condition):
        message = f"{condition}: there is no such output"
        findings.append(scene.place(("stop_when",), message))
    if findings:
        raise SceneFault(scene.title, findings)
    return System(
        units,
        made,
        timeline,
        scene.coupling,
        condition,
        scene.faults,
        rules.power,
        scene.substeps,
        scene.get_after_set,
        scene.iteration,
        scene.step_control,
        refused,
        rules.springs,
    )


def _between(e: Ends) -> str:
    return f"{e.source}.{e.source_port} -> {e.target}.{e.target_port}"


def _not_replaced(rows: Iterable[tuple[str, str]], ends: Iterable[Ends]) -> list[tuple[str, str]]:
    """The loop's own connections whose target no [[connection]] feeds."""
    fed = {f"{e.target}.{s.port}" for e in ends for s in e.inputs}
    return [row for row in rows if row[1] not in fed]


def _held(e: Ends, units: Iterable[Fmu], hold: str, holds: Mapping[str, str]) -> Connection:
    """The connection of `e`; its own hold goes before [holds], and that before the scene's."""
    made = Connection(e.source, e.source_port, e.target, e.target_port, e.outputs, e.inputs)
    clocks = {u.name: u.clock for u in units}
    if made.initial or clocks[e.source] == clocks[e.target]:
        return made
    named = next((holds[key] for key in _names(made) if key in holds), hold)
    return replace(made, hold=e.hold or named)


def connect(
    units: Iterable[Fmu],
    rows: Iterable[tuple[str, str]],
    hold: str,
    holds: Mapping[str, str],
) -> Iterable[Connection]:
    """The connections of `rows` whose two ends exist. Raises InputFault where an input has two
    sources, or two ends differ in size or unit."""
    by_name = {u.name: u for u in units}
    fed: dict[tuple[str, str], str] = {}
    for source, target in rows:
        (giver, output), (taker, entry) = (_split(end) for end in (source, target))
        if giver not in by_name or taker not in by_name:
            continue
        outputs = by_name[giver].description.port(output, "output")
        inputs = by_name[taker].description.port(entry, "input", "parameter")
        if not outputs or not inputs:
            continue
        made = Connection(giver, output, taker, entry, outputs, inputs)
        if len(outputs) != len(inputs):
            raise InputFault(f"{made.name}: {len(outputs)} values for {len(inputs)} inputs")
        for a, b in zip(outputs, inputs, strict=True):
            if a.unit and b.unit and a.unit != b.unit:
                raise InputFault(
                    f"{made.name}: {a.name} is in {a.unit}, {b.name} in {b.unit}; "
                    "connect signals of one unit"
                )
            if (first := fed.setdefault((taker, b.name), source)) != source:
                raise InputFault(f"{target}: fed by {first} and by {source}; keep one")
        if by_name[giver].clock != by_name[taker].clock and not made.initial:
            kind = next((holds[key] for key in _names(made) if key in holds), hold)
            made = Connection(giver, output, taker, entry, outputs, inputs, kind)
        yield made


def _names(c: Connection) -> tuple[str, str, str]:
    """The names under which [holds] may speak of a connection, the most precise first."""
    return (c.name, f"{c.target}.{c.target_port}", f"{c.source}.{c.source_port}")


def _split(end: str) -> tuple[str, str]:
    fmu, _, variable = end.partition(".")
    return fmu, variable


def _has_output(units: Iterable[Fmu], condition: Condition) -> bool:
    named = (u for u in units if u.name == condition.fmu)
    return any(s.name == condition.variable for u in named for s in u.description.outputs)
