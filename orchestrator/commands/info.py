"""`hapticlink info`."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hapticlink.orchestrator.commands.options import Scene, Set

if TYPE_CHECKING:
    from hapticlink.orchestrator.ticks import Timeline


def info(scene: Scene | None = None, /, *, set: Set = None) -> int:
    """Tell what a scene consists of: rates, FMUs, connections, holds; what it needs and leaves out,
    and what that saves. Without SCENE, list the shipped scenes."""
    from hapticlink.orchestrator import (
        assembled,
        blocks,
        rooms,
        scene_file,
        scene_names,
        stamps,
        system,
        timeline,
    )
    from hapticlink.orchestrator.plan import Plan

    if scene is None:
        for name in scene_names.shipped():
            print(f"{name}: {scene_file.load(name).title}")
        return 0
    read = scene_file.load(scene, set or ())
    time = timeline.timeline(read)
    with rooms.room() as room:
        made = system.from_scene(read, time, blocks.fmu_files(read, time, room))
        start = assembled.at_start(made) if read.linkage and read.linkage.loop else []
    print(f"{read.title}\n{read.description.strip()}".strip())
    print(f"\n{read.duration:g} s in ticks of {time.base} s, {read.coupling}")
    for line in assembled.moved(asdict(read.linkage), start) if read.linkage and start else ():
        print(f"  {line}")
    for unit in made.units:
        timing = unit.description.timing
        print(f"  {unit.name}: {timing}, at {unit.clock}, {len(unit.description.outputs)} outputs")
    print("\nconnections (age of the newest sample when it is used, ms)")
    ages = {name: asdict(age) for name, age in stamps.delays(Plan(made)).items()}
    for connection in made.connections:
        if connection.initial:
            note = "once, at the start"
        else:
            age = ages[connection.name]
            note = f"{age['least'] * 1e3:.3g} to {age['most'] * 1e3:.3g}"
        print(f"  {connection.name}: {note}{f', {connection.hold}' * bool(connection.hold)}")
    _needs(read, time)
    return 0


def _needs(scene: Any, time: Timeline) -> None:
    from hapticlink.orchestrator import costs, needs

    found = list(needs.needs(scene))
    for title, needed in (("needed", True), ("left out", False)):
        print(f"\n{title}")
        for need in found:
            if need.needed == needed:
                print(f"  {need.part}: {need.why}")
    print("\noperations of a step and of its outputs, signals in and out")
    rows = {}
    for title, skip in (("as it is", True), ("nothing left out", False)):
        rows[title] = costs.costs(scene, time, skip=skip)
        print(f"  {title}")
        for row in rows[title]:
            ports = sum(row.cost.inputs.values()), sum(row.cost.outputs.values())
            print(
                f"    {row.name}: {row.cost.step} + {row.cost.output} operations, "
                f"{ports[0]} + {ports[1]} signals"
            )
        operations, signals = (sum(getattr(r, k) for r in rows[title]) for k in _PER_TICK)
        print(f"    a haptic tick: {operations:.0f} operations, {signals:.0f} signals")


_PER_TICK = ("operations", "signals")
