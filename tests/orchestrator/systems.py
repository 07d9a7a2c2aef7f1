"""Connections of small systems for tests, made and held as those of a run are."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.scene.toml_keys import Problem
from hapticlink.orchestrator.system.assign_holds import assign
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.connections import connect
from hapticlink.orchestrator.system.system import Connection, EnergyPorts, Fmu, Refused, System

BARE = Scene(title="", duration=1.0)
NO_ENERGY = EnergyPorts()


def system_of(scene: object, *options: str) -> System:
    """The system of a scene, by its name or path. Its FMU files need not exist any more."""
    with build_system(open_scene.load(str(scene), options)) as system:
        return system


def with_coupling(system: System, **settings: object) -> System:
    """The system with other settings of its coupling."""
    return replace(system, coupling=replace(system.coupling, **settings))


def connected(
    fmus: Sequence[Fmu],
    rows: Iterable[tuple[str, str]],
    timeline: Timeline,
    scene: Scene = BARE,
    energy: EnergyPorts = NO_ENERGY,
) -> tuple[tuple[Connection, ...], tuple[Refused, ...]]:
    """The connections of `rows` (source, target), and the holds that were refused."""
    problems: list[Problem] = []
    wires = [((), Wire(from_=source, to=target)) for source, target in rows]
    made = [c for _, c in connect(wires, {u.name: u.description for u in fmus}, problems)]
    assert not problems
    return assign(fmus, made, timeline, scene, energy)
