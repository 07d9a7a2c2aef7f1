"""What run.json says of a run before it begins: scene, versions, rates, holds, connections."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hapticlink.fmus.versions import find_code, find_versions
from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.base.signal_names import MECHANISM
from hapticlink.orchestrator.fmi.units import MATRICES
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.rows_file import TEXTS
from hapticlink.orchestrator.results.run_record import (
    ClockSteps,
    RecordedFmu,
    RefusedHold,
    RunSetup,
)
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.early_steps import stands_for
from hapticlink.orchestrator.system.ports import names, power_across_rates
from hapticlink.orchestrator.system.system import Connection, System

PACKAGES = ("hapticlink", "casadi", "fmpy", "pythonfmu", "numpy")
"""Those whose versions are recorded."""


def setup(
    scene: Scene, plan: Plan, tables: Mapping[str, Sequence[str]], not_recorded: list[str]
) -> RunSetup:
    """The record of a run that has not begun. tables: columns by the names of its tables;
    not_recorded: outputs of which an entry is not written in the rows of its rate."""
    system, timeline = plan.system, plan.system.timeline
    seconds, base = timeline.seconds, timeline.base
    end = timeline.time(timeline.end)
    held = [c for c in system.connections if c.hold]
    compiled = scene.packaging == "native" and blocks(scene).built
    packages = (*PACKAGES, "ziglang") if compiled else PACKAGES
    return RunSetup(
        **describe_scene(scene),
        versions=find_versions(packages) | {"python": platform.python_version()} | find_code(),
        plugins=plugins.list_plugins(),
        seeds=_seeds(scene, system),
        files=[*_list_files(scene, system, tables)],
        rates=[n for c in timeline.clocks for n in system.recording.tables(c.name)],
        clocks={
            c.name: ClockSteps(seconds(c.first), seconds(c.shortest), seconds(c.longest))
            for c in timeline.clocks
        },
        stop_when=str(system.ends_when or ""),
        base=f"{base.numerator}/{base.denominator} s",
        fmus={
            u.name: RecordedFmu(u.clock, u.description.timing, system.block(u.name))
            for u in system.fmus
        },
        friction_speeds=_friction_speeds(scene, system),
        coupling=system.coupling.scheme,
        loops=list(plan.loops()),
        connections=[c.name for c in system.connections],
        replaced=dict(system.replacements),
        holds={c.name: c.hold for c in held if c.hold},
        holds_that_did_not_fit={
            r.connection.name: RefusedHold(r.hold, r.reason) for r in system.refused
        },
        held_as={c.name: c.kind for c in held if c.kind},
        latencies={c.name: c.latency for c in held if c.latency},
        substeps={
            u.name: system.coupling.substeps.get(u.name, 1) for u in system.fmus if not u.sampled
        },
        within_a_step={
            c.name: _within_a_step(system.coupling.substeps.get(c.target, 1))
            for c in system.connections
            if _varies_within_a_step(system, c)
        },
        get_after_set=list(system.coupling.get_after_set),
        power_across_rates=power_across_rates(system),
        events=[(c.begin, c.text) for c in system.changes if c.begin < end],
        not_recorded=not_recorded,
        units=_units(system),
        without_effect=[
            *_find_idle_holds(scene, system),
            *_find_idle_computing_time(scene, system),
            *_find_idle_events(scene, system),
        ],
    )


def _list_files(scene: Scene, system: System, tables: Mapping[str, Sequence[str]]) -> Iterator[str]:
    yield from ("run.json", *(f"{table}.{scene.record.format}" for table in tables))
    if scene.record.format == "rows":
        texts = SignalVector(system).texts
        yield from (f"{table}{TEXTS}" for table, columns in tables.items() if texts(columns))


def describe_scene(scene: Scene) -> dict[str, Any]:
    """What depends on the start values in the scene."""
    source = scene.source
    return {"scene": scene.tables(), "options": [*source.options] if source else []}


def _find_idle_holds(scene: Scene, system: System) -> Iterator[str]:
    """The scene's default holds, where they are not the plain ones, that no connection can take."""

    def longest(fmu: str) -> int:
        return system.timeline.clock(system.fmu[fmu].clock).longest

    ways = {
        "hold": (scene.hold, "zoh", "a slower rate to a faster"),
        "downsampling": (scene.downsampling, "latest", "a faster rate to a slower"),
    }
    asked = {c.hold for c in system.connections} | {r.hold for r in system.refused}
    for key, (hold, plain, way) in ways.items():
        if hold == plain or asked & {hold, *stands_for(key, hold)}:
            continue
        sign = 1 if key == "hold" else -1
        apart = ((c, longest(c.source) - longest(c.target)) for c in system.connections if c.hold)
        own = [any(k in scene.named_holds for k in names(c)) for c, d in apart if d * sign > 0]
        if not own:
            why = f"there is no connection from {way} one ([holds] names others)"
        elif all(own):
            why = f"all connections from {way} one have holds of their own in [holds]"
        else:
            why = (
                "it is for efforts on plants whose steps are taken when they begin (hold = 'model')"
            )
        yield f'{key} = "{hold}" acts on no connection: {why}'


def _find_idle_computing_time(scene: Scene, system: System) -> Iterator[str]:
    """The computing time of steps taken when they begin, where no connection waits for it."""
    known = Latency(min=scene.computing_time)
    steps = [c.latency for c in system.connections if c.needs == "step"]
    if scene.computing_time and known not in steps:
        own = "all connections from such steps have latencies of their own in [delays]"
        none = "no step is taken when it begins (hold = 'model')"
        yield f"computing_time acts on no connection: {own if steps else none}"


def _find_idle_events(scene: Scene, system: System) -> Iterator[str]:
    """Events of `[[at]]` that no step of their FMU sees."""
    end = system.timeline.time(system.timeline.end)
    for change in system.changes:
        if change.begin >= end:
            why = f"none begins before the run ends, at {end:g} s"
        elif change.end is not None and change.end <= change.begin:
            why = f"the first one is at {change.begin:g} s"
        else:
            continue
        yield f"{change.text}, from {change.time:g} s on, acts on no step: {why}"


def _units(system: System) -> dict[str, str]:
    """The units of the columns that are written."""
    outputs = ((u.name, s) for u in system.fmus for s in u.description.outputs)
    units = {f"{name}.{s.name}": s.unit for name, s in outputs if s.unit}
    written = system.recording.outputs
    return units if written is None else {name: units[name] for name in written if name in units}


def _varies_within_a_step(system: System, c: Connection) -> bool:
    """Whether the hold of a plant's input varies within its step. Projectors and semidefinite
    matrices are not counted."""
    if not c.hold or c.initial or system.fmu[c.target].sampled or c.kind in MATRICES:
        return False
    return HOLDS[c.hold].degree != 0


def _within_a_step(substeps: int) -> str:
    """How a plant takes an input whose hold varies within its step."""
    if substeps > 1:
        return f"constant in each of {substeps} substeps"
    return "constant, the hold at the middle (half-step lead)"


def _friction_speeds(scene: Scene, system: System) -> dict[str, float]:
    """v_f (rad/s or m/s) of the mechanism's joints with friction, by name."""
    if MECHANISM not in system.fmu or not (scene.linkage and scene.linkage.rubbing):
        return {}
    from hapticlink.components.dynamics import friction_scale  # loads CasADi

    timeline = system.timeline
    period = timeline.seconds(timeline.clock(system.fmu[MECHANISM].clock).longest)
    return friction_scale.speeds(scene.linkage, period / scene.mechanism.substeps)


def _seeds(scene: Scene, system: System) -> dict[str, int]:
    rates = {"graphics.rate": scene.graphics.rate} if scene.graphics else {}
    rates |= {f"fmu.{fmu.name}.rate": fmu.rate for fmu in scene.fmu if fmu.rate}
    seeds = {name: r.seed for name, r in rates.items() if isinstance(r, VariableRate)}
    seeds |= {c.name: c.latency.seed for c in system.connections if c.latency}
    return seeds | {f"at.{i}": event.seed for i, event in enumerate(scene.at) if event.noise}
