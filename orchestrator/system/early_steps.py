"""Plants whose steps are taken as soon as they begin, and what the hold `model` stands for.

The inputs of a plant are held over its step, so that its step is determined when it begins. `model`
stands for what is known of a connection: from a source that gives gradients, `model` itself; from a
slower plant, whose steps are then taken early, `ahead`; to such a plant, `mid` for the force of a
coupling both ends of which move with a known mobility, `reaction` for an effort beside it,
`half-lead` for other efforts, and `latest` for anything else.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Mapping

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.ports import carries_power, names
from hapticlink.orchestrator.system.system import Connection, EnergyPorts, Fmu

MODEL = {"hold": ("model", "ahead"), "downsampling": ("mid", "reaction", "half-lead")}


def stands_for(key: str, hold: str) -> tuple[str, ...]:
    """The holds that connections get for the scene's `hold` or `downsampling`, where they fit."""
    return MODEL[key] if hold == "model" else (hold,)


def find_early(
    scene: Scene, connections: Iterable[Connection], fmus: Mapping[str, Fmu], timeline: Timeline
) -> set[str]:
    """The plants whose steps are taken as soon as they begin: those with a hold `model` or `ahead`
    to a faster clock, where inputs are held over a step."""
    asked = {"model", "ahead"}
    found = set[str]()
    for c in connections:
        key = next((k for k in names(c) if k in scene.named_holds), None)
        hold = scene.named_holds[key] if key else scene.hold
        if hold in asked and not c.initial and why_late(c, scene, fmus, timeline) is None:
            found.add(c.source)
    return found


def why_late(
    c: Connection, scene: Scene, fmus: Mapping[str, Fmu], timeline: Timeline
) -> str | None:
    """Why the source of a connection cannot take its step before its target needs the samples."""
    source = fmus[c.source]
    if source.sampled or source.frames:
        return f"{c.source} is no plant, whose step is determined when it begins"
    if longer(c, fmus, timeline) <= 0:
        return f"{c.source} is not slower than {c.target}"
    if scene.coupling not in ("gauss-seidel", "jacobi"):
        return f"coupling = {scene.coupling!r} does not hold the inputs of {c.source} over a step"
    if c.source in scene.get_after_set:
        return f"get_after_set changes outputs of {c.source} when its step is taken"
    return None


def longer(c: Connection, fmus: Mapping[str, Fmu], timeline: Timeline) -> int:
    """By how many ticks the longest step of the source is longer than that of the target."""
    source, target = (timeline.clock(fmus[n].clock).longest for n in (c.source, c.target))
    return source - target


def moves(c: Connection, fmus: Mapping[str, Fmu], connections: Iterable[Connection]) -> str | None:
    """The FMU from which the source of a connection has the coordinates of its gradient."""
    gradients = fmus[c.source].description.gradients.values()
    by = {g.by for g in gradients if g.of == c.source_port}
    fed = (k for k in connections if k.target == c.source and k.target_port in by)
    return next((k.source for k in fed), None)


def towards(
    c: Connection,
    early: Container[str],
    late: bool,
    energy: EnergyPorts,
    connections: Collection[Connection],
) -> str:
    """What `model` is of a connection to a slower clock, whose samples may be late."""
    if c.target not in early or not carries_power(c, energy.power):
        return "latest"
    if not late and energy.coupling(c, connections):
        return "mid"
    return "reaction" if not late and energy.coupling_beside(c, connections) else "half-lead"
