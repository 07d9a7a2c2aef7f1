"""Assigns a hold to each connection, and says why a default was refused.

The tables of `NAMED` (scene/toml_keys.py) name a connection as `source -> target`, by its target's
port or by its source's port (all connections from there); the most precise name wins. By default a
connection from a slower clock has the scene's `hold`, one from a faster clock its `downsampling`,
and one between clocks that differ only in phase `zoh`, since every sample is read there. A
connection within a rate has no hold unless it is named or has a latency. A default hold that needs
power is assigned to every connection across clocks that carries power, in either direction.

What `model` stands for is in early_steps.py.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.variables import WRITTEN
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Latency, PowerPort
from hapticlink.orchestrator.system import springs
from hapticlink.orchestrator.system.early_steps import (
    find_early,
    longer,
    moves,
    stands_for,
    towards,
    why_late,
)
from hapticlink.orchestrator.system.haptic_loop import energy_in_play
from hapticlink.orchestrator.system.ports import (
    between_plants,
    carries_power,
    companion_outputs,
    kind,
    names,
)
from hapticlink.orchestrator.system.system import Connection, EnergyPorts, Fmu, Refused


def assign(
    fmus: Iterable[Fmu],
    connections: Iterable[Connection],
    timeline: Timeline,
    scene: Scene,
    energy: EnergyPorts,
) -> tuple[tuple[Connection, ...], tuple[Refused, ...]]:
    """The connections with their holds, latencies and kinds, and the holds that were refused."""
    by_name = {u.name: u for u in fmus}
    refused: list[Refused] = []
    assigned = tuple(_assign(connections, by_name, timeline, scene, energy, refused))
    assigned = tuple(_with_springs(assigned, by_name, scene.named_holds, energy, refused))
    if not {c.hold for c in assigned} & {*stands_for("hold", scene.hold)}:
        # A default hold that fits no connection is an error. Between iterated plants it was the
        # interpolation that did not fit, which is replaced silently.
        refused = [
            r if r.key or between_plants(r.connection, by_name) else replace(r, key="hold")
            for r in refused
        ]
    return assigned, tuple(refused)


def _assign(
    connections: Iterable[Connection],
    fmus: Mapping[str, Fmu],
    timeline: Timeline,
    scene: Scene,
    energy: EnergyPorts,
    refused: list[Refused],
) -> Iterator[Connection]:
    connections = tuple(connections)
    holds, early = scene.named_holds, find_early(scene, connections, fmus, timeline)
    between = scene.iteration.interpolation if scene.coupling == "iterated" else None
    for c in connections:
        if c.initial:
            yield c
            continue
        source, target = (fmus[n].clock for n in (c.source, c.target))
        key = next((k for k in names(c) if k in holds), None)
        delay = next((scene.delays[k] for k in names(c) if k in scene.delays), Latency())
        latency = delay if isinstance(delay, Latency) else Latency(min=delay)
        late = bool(latency.min or latency.max or latency.loss)
        hold = holds[key] if key else None
        if not key and source != target:
            longest, other = (timeline.clock(name).longest for name in (source, target))
            if longest > other or HOLDS[scene.hold].needs == "power":
                hold = scene.hold
            else:
                hold = scene.downsampling if longest < other else "zoh"
        elif late and not hold:
            hold = "zoh"
        if hold in ("model", "ahead") and c.source in early:
            known = hold == "model" and companion_outputs(c, fmus, hold)
            hold = hold if known else "ahead"
            if hold == "ahead" and not late and scene.computing_time:
                latency, late = Latency(min=scene.computing_time), True
        elif hold == "model" and longer(c, fmus, timeline) < 0:
            hold = towards(c, early, late, energy, connections)
        named = (scene.kinds[k] for k in names(c) if k in scene.kinds)
        c = replace(c, latency=latency if late else None, kind=next(named, kind(c, fmus)))
        iterated = between if between_plants(c, fmus) else None
        hold = hold or iterated
        reason = hold and why_unsuitable(hold, c, fmus, energy.power, iterated is not None)
        if hold and HOLDS[hold].needs == "step":
            reason = reason or why_late(c, scene, fmus, timeline)
        elif hold == "model" and not reason and (of := moves(c, fmus, connections)) in early:
            reason = (
                f"it goes on in coordinates of {of}, whose samples are of the end of a frame; with "
                "mechanism_at = 'graphics' take directions_from = 'mechanism'"
            )
        elif hold == "model" and reason and not (fmus[c.source].sampled or fmus[c.source].frames):
            reason = f"{why_late(c, scene, fmus, timeline)}, and {reason}"
        if hold and reason:
            refused.append(Refused(key, c, hold, reason))
            hold = "foh" if iterated and not _has_rows(c) else "zoh"
        yield replace(c, hold=hold, kind=c.kind if c.kind != "none" else None)


def _with_springs(
    connections: Sequence[Connection],
    fmus: Mapping[str, Fmu],
    holds: Mapping[str, str],
    energy: EnergyPorts,
    refused: list[Refused],
) -> Iterator[Connection]:
    """The connections, with `zoh` where the hold needs a spring and has none that fits."""
    for c in connections:
        reason = None
        if c.needs == "spring":
            reason = springs.why_unlimited(c, energy.springs, connections, fmus)
        elif c.needs == "coupling" and energy.coupling(c, connections) is None:
            reason = (
                f"{c.from_} is no force of a spring-damper both ends of which are "
                "connected and move with a known mobility (docs/holds.md); take 'half-lead'"
            )
        elif c.needs == "reaction" and energy.coupling_beside(c, connections) is None:
            reason = (
                f"beside {c.to} acts no force of a spring-damper both ends of "
                "which are connected and move with a known mobility (docs/holds.md); take "
                "'half-lead'"
            )
        elif c.needs in ("coupling", "reaction") and c.latency:
            reason = springs.NEVER_LATE
        if c.hold and reason:
            key = next((k for k in names(c) if k in holds), None)
            refused.append(Refused(key, c, c.hold, reason))
            c = replace(c, hold="zoh")
        yield c


def _has_rows(c: Connection) -> bool:
    """Whether there is nothing between its samples that a hold could make."""
    return c.kind in ("table", "count") or c.outputs[0].type in ("Clock", *WRITTEN)


def why_unsuitable(
    hold: str,
    c: Connection,
    fmus: Mapping[str, Fmu],
    power: Iterable[PowerPort],
    iterated: bool,
) -> str | None:
    """Why `hold` cannot be used on a connection, None where it can."""
    needs = HOLDS[hold].needs
    if iterated and not HOLDS[hold].interpolates:
        able = ", ".join(HOLDS.names(lambda kind: kind.interpolates))
        return f"coupling = 'iterated' interpolates here; take one of {able}"
    if _has_rows(c) and not HOLDS[hold].gives_samples:
        able = ", ".join(HOLDS.names(lambda kind: kind.gives_samples))
        counts = "clock, whose counts" if c.outputs[0].type == "Clock" else "text, which can"
        what = {"table": "table, whose rows", "count": "count, which can"}.get(c.kind or "", counts)
        return f"{c.source_port} is a {what} have no values in between; take {able}"
    if needs == "derivative" and not companion_outputs(c, fmus, hold):
        return (
            f"{c.source} does not put out the derivative of {c.source_port}, or does not declare "
            "it (docs/holds.md, Derivatives); take 'foh', which uses the difference of two samples"
        )
    if needs == "integral" and not companion_outputs(c, fmus, hold):
        return (
            f"{c.source} does not put out anything of which {c.source_port} is the derivative, or "
            "does not declare it (docs/holds.md, Derivatives); take 'foh'"
        )
    if needs == "gradient" and not companion_outputs(c, fmus, hold):
        return (
            f"{c.source} does not put out the gradient of {c.source_port}, or does not declare it "
            "(docs/holds.md, Gradients); take 'foh'"
        )
    if needs == "power" and not carries_power(c, power):
        return (
            f"it is not a declared power connection: write a [[power]] that pairs the effort "
            f"{c.to} with a displacement (docs/passivity.md, Energy), or take "
            "another hold"
        )
    return None


def find_energy_ports(
    scene: Scene, fmus: Collection[Fmu], connections: Collection[Connection]
) -> EnergyPorts:
    """Power ports and springs of the scene come before those that its FMUs declare, so that they
    take precedence."""
    power = (
        PowerPort(effort=f"{u.name}.{port}", displacement=f"{u.name}.{p.displacement}", sign=p.sign)
        for u in fmus
        for port, p in u.description.power.items()
    )
    declared = springs.find_declared_springs(fmus, connections)
    driven = bool(scene.linkage and (scene.linkage.force or scene.linkage.driven))
    every = (*scene.power, *power), (*scene.spring, *declared)
    return EnergyPorts(*every, energy_in_play(scene), driven)
