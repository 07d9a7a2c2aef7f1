"""Checks a scene's tables of connections, [substeps], [[power]] and [[spring]] against the ports of
its FMUs, and its rates and coupling against their capabilities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hapticlink.orchestrator.base.errors import near
from hapticlink.orchestrator.fmi.description import VARIABLE_STEP
from hapticlink.orchestrator.fmi.units import why_unsuitable
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import PowerPort
from hapticlink.orchestrator.scene.toml_keys import NAMED, Path, Problem
from hapticlink.orchestrator.system import springs
from hapticlink.orchestrator.system.ports import between_plants, names, size
from hapticlink.orchestrator.system.system import Fmu, System


def check_system(scene: Scene, system: System) -> Iterator[Problem]:
    """A finding for each name in these tables that the system does not have, and for each entry
    that does not fit it."""
    held = [c for c in system.connections if not c.initial]
    for table in NAMED:
        for key in getattr(scene, table):
            known = list(dict.fromkeys(name for c in held for name in names(c)))
            if key not in known:
                hint = near(key, known)
                if hint.startswith("there are"):
                    hint = f"there are {', '.join(c.name for c in held) or 'none'}"
                yield (table, key), f"is no connection of this scene; {hint}"
    for key, kind in scene.kinds.items():
        for c in (c for c in held if key in names(c)):
            source = system.fmu[c.source].description
            if why := why_unsuitable(kind, [source.unit(s) for s in c.outputs]):
                message = f"{c.source}.{c.source_port} {why}; take another kind, or leave it out"
                yield ("kinds", key), message
    yield from _check_holds(scene, system)
    plants = [u.name for u in system.fmus if not u.sampled]
    why = f"is no plant of this scene; there are {', '.join(plants)}"
    yield from ((("substeps", name), why) for name in scene.substeps if name not in plants)
    for name in scene.get_after_set:
        if name not in plants:
            yield ("get_after_set",), f"{name!r} {why}"
    for i, p in enumerate(scene.power):
        yield from _power(i, p, system.fmu)
    yield from springs.check_springs(scene, system.fmu)
    yield from _step_sizes(system)
    yield from _check_iterated(system)
    yield from _check_computing_time(scene, system)


NOWHERE = {
    "spring": "no held connection sets a spring whose energy is known. One does in "
    "closed-loop-direct: its held poses are the set position of F_drift; [[spring]] declares "
    "those of other FMUs (docs/passivity.md, pspm)",
    "power": "no connection across rates carries power that is known. One does in "
    "closed-loop-direct; a [[power]] (docs/passivity.md, Energy) declares it of an FMU of others",
}
"""Why a default hold fits no connection, by what it needs."""


def _check_holds(scene: Scene, system: System) -> Iterator[Problem]:
    """A finding for each requested hold that does not fit, at its key in the scene. For a default
    that fits no connection: one for each connection that sets a spring, or else a single one."""
    wires = {f"{w.from_} -> {w.to}": i for i, w in enumerate(scene.connection) if w.hold}
    asked, needs = [r for r in system.refused if r.key], HOLDS[scene.hold].needs or ""
    default = [r for r in asked if r.key == "hold" and r.hold == scene.hold and needs in NOWHERE]
    sets = system.energy.springs if needs == "spring" else ()
    nearly = [r for r in default if springs.spring(r.connection, sets)]
    if default and not nearly:
        into = [r.connection for r in default if not system.fmu[r.connection.target].sampled]
        c = into[0] if into else default[0].connection
        here = f': effort = "{c.target}.{c.target_port}", displacement = an output of {c.target}'
        what = f"{NOWHERE[needs]}{here * (needs == 'power')}"
        yield ("hold",), f"{scene.hold!r} fits nowhere here: {what}"
    for r in asked:
        if r in nearly or r not in default:
            path: Path = ("hold",) if r.key == "hold" else ("holds", r.key or "")
            path = ("connection", wires[r.key], "hold") if r.key in wires else path
            yield path, f"{r.hold!r} does not fit {r.connection.name}: {r.reason}"


def _power(i: int, p: PowerPort, fmus: Mapping[str, Fmu]) -> Iterator[Problem]:
    sizes = {}
    for end, causality in (("effort", "input"), ("displacement", "output")):
        sizes[end] = size(getattr(p, end), fmus, causality)
        if not sizes[end]:
            yield ("power", i, end), f"there is no {causality} {getattr(p, end)}"
    if p.displacement.partition(".")[0] != p.fmu:
        message = "effort and displacement are of one FMU: give the motion of the FMU it acts on"
        yield ("power", i), message
    elif all(sizes.values()) and len(set(sizes.values())) > 1:
        message = f"{sizes['effort']} efforts on {sizes['displacement']} displacements"
        yield ("power", i), message


def _step_sizes(system: System) -> Iterator[Problem]:
    """A finding for each FMU with a fixed communication step size on a clock whose steps vary."""
    timeline, seconds = system.timeline, system.timeline.seconds
    for fmu in system.fmus:
        clock = timeline.clock(fmu.clock)
        if clock.first == clock.period or fmu.description.varies_step:
            continue
        least = seconds(min(clock.first, clock.shortest))
        yield (
            clock.key,
            f"{fmu.name} takes steps of one size only ({VARIABLE_STEP} is not true), but its "
            f"steps here are {least:.6g} to {seconds(clock.longest):.6g} s: take a fixed rate, "
            "with neither a phase nor align = 'tick'",
        )


def _check_iterated(system: System) -> Iterator[Problem]:
    """A finding where coupling "iterated" has no connected plants of one rate to iterate."""
    between = any(between_plants(c, system.fmu) and not c.initial for c in system.connections)
    if system.coupling.scheme == "iterated" and not between:
        yield (
            ("coupling",),
            "'iterated' repeats the steps of connected plants of one rate until they agree, and "
            "there are none: take it out (docs/coupling.md)",
        )


def _check_computing_time(scene: Scene, system: System) -> Iterator[Problem]:
    """A finding where the result of a step would not be there when the next one begins."""
    for name in sorted(system.early):
        shortest = system.timeline.seconds(system.timeline.clock(system.fmu[name].clock).shortest)
        if scene.computing_time > shortest:
            yield (
                ("computing_time",),
                f"the shortest step of {name} is {shortest:.6g} s, and the next one cannot begin "
                "before its result is there: take at most that, or a lower rate",
            )
