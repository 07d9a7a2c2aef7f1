"""A scene's [holds], [delays], [kinds], [substeps], [[power]] and [[spring]] against its FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from hapticlink.orchestrator import power, springs
from hapticlink.orchestrator.crossings import Refused, Rules, names, turns
from hapticlink.orchestrator.faults import Finding, near
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.latency import Latency
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.toml_lines import Path

if TYPE_CHECKING:
    from hapticlink.orchestrator.system import Connection, Unit


def rules_of(scene: Scene, own: Mapping[str, str]) -> Rules:
    """The rules of `scene`; `own` are holds that a [[connection]] asks for itself, by name."""
    delays = {
        key: d if isinstance(d, Latency) else Latency(min=d) for key, d in scene.delays.items()
    }
    return Rules(
        scene.hold,
        scene.downsampling,
        {**scene.holds, **own},
        delays,
        scene.kinds,
        (*scene.power, *power.BLOCKS),
        scene.iteration.interpolation if scene.coupling == "iterated" else None,
        springs.springs_of(scene),
    )


def unfit(
    scene: Scene,
    units: Iterable[Unit],
    connections: Iterable[Connection],
    refused: Iterable[Refused],
) -> Iterator[Finding]:
    """What these tables say of things that are not there, or that cannot be."""
    by_name = {u.name: u for u in units}
    found = [c for c in connections if not c.initial]
    for table in ("holds", "delays", "kinds"):
        for key in getattr(scene, table):
            known = list(dict.fromkeys(name for c in found for name in names(c)))
            if key not in known:
                hint = near(key, known)
                if hint.startswith("there are"):
                    hint = f"there are {', '.join(c.name for c in found) or 'none'}"
                yield scene.place((table, key), f"is no connection of this scene; {hint}")
    for key, kind in scene.kinds.items():
        for c in (c for c in found if kind == "angle" and key in names(c)):
            if not turns(c, by_name):
                units_of = ", ".join(dict.fromkeys(str(s.unit) for s in c.outputs))
                message = (
                    f"{c.source}.{c.source_port} is in {units_of}, which is no angle: give the "
                    "unit a BaseUnit of rad alone, or leave the kind out"
                )
                yield scene.place(("kinds", key), message)
    yield from _refused(scene, refused)
    for name in scene.substeps:
        if name not in by_name or by_name[name].sampled:
            plants = ", ".join(u.name for u in by_name.values() if not u.sampled)
            yield scene.place(("substeps", name), f"is no plant of this scene; there are {plants}")
    for name in scene.get_after_set:
        if name not in by_name or by_name[name].sampled:
            plants = ", ".join(u.name for u in by_name.values() if not u.sampled)
            message = f"{name!r} is no plant of this scene; there are {plants}"
            yield scene.place(("get_after_set",), message)
    for i, p in enumerate(scene.power):
        yield from _power(scene, i, p, by_name)
    yield from springs.unfit(scene, by_name)


NOWHERE = {
    "spring": "no held connection sets a spring whose energy is known. One does in "
    "closed-loop-direct, whose poses reach the mechanism's far end of F_drift; [[spring]] names "
    "those of other FMUs (docs/holds.md, pspm)",
    "power": "no connection across rates carries power that is known. One does in "
    "closed-loop-direct; [[power]] names those of other FMUs (docs/holds.md, Energy)",
}


def _refused(scene: Scene, refused: Iterable[Refused]) -> Iterator[Finding]:
    """Holds that do not fit, each where the scene asks for it. A default that fits nowhere is told
    where it nearly does, or else once."""
    wires = {f"{w.from_} -> {w.to}": i for i, w in enumerate(scene.connection) if w.hold}
    sets = springs.springs_of(scene)
    asked = [r for r in refused if r.key]
    default = [r for r in asked if r.key == "hold" and HOLDS[r.hold].needs in NOWHERE]
    nearly = [
        r for r in default if HOLDS[r.hold].needs == "spring" and springs.spring(r.connection, sets)
    ]
    if default and not nearly:
        hold, needs = default[0].hold, HOLDS[default[0].hold].needs
        yield scene.place(("hold",), f"{hold!r} fits nowhere here: {NOWHERE[needs or '']}")
    for r in asked:
        if r in nearly or r not in default:
            path: Path = ("hold",) if r.key == "hold" else ("holds", r.key or "")
            path = ("connection", wires[r.key], "hold") if r.key in wires else path
            yield scene.place(path, f"{r.hold!r} does not fit {r.connection.name}: {r.reason}")


def _power(
    scene: Scene, i: int, p: power.PowerPort, units: Mapping[str, Unit]
) -> Iterator[Finding]:
    sizes = {}
    for end, causality in (("effort", "input"), ("displacement", "output")):
        fmu, _, name = getattr(p, end).partition(".")
        entries = units[fmu].description.port(name, causality) if fmu in units else ()
        sizes[end] = len(entries)
        if not entries:
            yield scene.place(("power", i, end), f"there is no {causality} {getattr(p, end)}")
    if p.displacement.partition(".")[0] != p.fmu:
        message = "effort and displacement are of one FMU: give the motion of the FMU it acts on"
        yield scene.place(("power", i), message)
    elif all(sizes.values()) and len(set(sizes.values())) > 1:
        message = f"{sizes['effort']} efforts on {sizes['displacement']} displacements"
        yield scene.place(("power", i), message)
