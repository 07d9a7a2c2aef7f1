from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from hapticlink.analysis.findings.start_values import coordinates, mechanism_outputs
from hapticlink.commands.options import UNCHANGED, Out, Scene, SceneOptions, default_folder
from hapticlink.orchestrator.base.terminal_output import say
from hapticlink.orchestrator.system.system import System

if TYPE_CHECKING:
    from hapticlink.orchestrator.base.ticks import Timeline


Draw = Annotated[
    bool,
    Parameter(
        negative="",
        help="Draw the blocks and their connections, the inside of each block with its equations, "
        "the mechanism where it starts, and the device in its workspace, into OUT (default "
        "info/SCENE).",
    ),
]


def info(
    scene: Scene | None = None,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    draw: Draw = False,
    out: Out = None,
) -> int:
    """Describe a scene: rates, FMUs, connections and holds; the device's workspace, and whether the
    scene starts in it; the parts of the equations that it needs and leaves out, with their cost.
    Without SCENE, list the shipped scenes.

    For example:

        hapticlink info closed-loop --draw
    """
    import hapticlink as hl
    from hapticlink.analysis.findings import summary
    from hapticlink.orchestrator.plan import sample_ages
    from hapticlink.orchestrator.plan.plan import Plan

    if scene is None:
        for name, title in hl.shipped().items():
            say(f"{name}: {title}")
        return 0
    from hapticlink.orchestrator.run.fetched_outputs import choose_fetched
    from hapticlink.orchestrator.system.build_system import build_system

    read = hl.scene(scene, changes.options)
    with build_system(read) as system:
        time = system.timeline
        start = mechanism_outputs(system) if read.linkage else {}
        fetched = choose_fetched(system).fmu
    say(f"{read.title}\n{read.description.strip()}".strip())
    _starts(read, start)
    begin = f" from {read.start_time:g} s on" if read.start_time else ""
    say(f"\n{read.duration:g} s{begin} in ticks of {time.base} s, {read.coupling}")
    for fmu in system.fmus:
        timing = fmu.description.timing
        every, some = (len(of.description.outputs) for of in (fmu, fetched[fmu.name]))
        solved = f", {fmu.description.solver}" * bool(fmu.description.solver)
        say(f"  {fmu.name}: {timing}, at {fmu.clock}, {every} outputs, {some} fetched{solved}")
    say("\nconnections (age of the newest sample when it is used, ms)")
    ages = {name: asdict(age) for name, age in sample_ages.delays(Plan(system)).items()}
    for connection in system.connections:
        if connection.initial:
            note = "once, at the start"
        elif age := ages.get(connection.name):
            note = f"{age['min'] * 1e3:.3g} to {age['max'] * 1e3:.3g}"
        else:
            note = "at the start only"
        say(f"  {connection.name}: {note}{f', {connection.hold}' * bool(connection.hold)}")
    for line in summary.describe_replacements(system.replacements):
        say(f"  {line}")
    _needs(read, time, list(system.replacements))
    if draw or out:
        _draw(read, system, start, out or default_folder("info", scene))
    return 0


def _starts(scene: Any, start: dict[str, float]) -> None:
    """Where the handle starts, who holds it, and what can be touched."""
    from hapticlink.analysis.findings import summary, workspace
    from hapticlink.orchestrator.scene.blocks import described_devices

    if scene.linkage and start:
        for line in summary.describe_assembly(asdict(scene.linkage), coordinates(start)):
            say(f"  {line}")
    if device := described_devices(scene).get(""):
        say("\ndevice's workspace")
        for line in workspace.lines(device, _pose(start)):
            say(f"  {line}")
    elif start:
        say(f"\nthe operational point starts at {workspace.write_pose(_pose(start))}")
    if scene.hand:
        swapped = (fmu.path or fmu.engine for fmu in scene.fmu if fmu.replaces == "hand")
        say(f"hand: {next(swapped, scene.hand.type)}")
    if scene.contacts and start:
        from hapticlink.analysis.findings import contact_warnings
        from hapticlink.components.contact.broad_phase import near

        pairs = [
            f"{pair.body} with {pair.obstacle}" for pair in near(scene.linkage, scene.contacts)
        ]
        say(f"contacts that can be reached: {', '.join(pairs) or 'none'}")
        q = coordinates(start)
        for line in contact_warnings.warn_of_pressed_start(scene.linkage, scene.contacts, q):
            say(f"  {line}")


def _pose(start: dict[str, float]) -> list[float]:
    """Of the operational point at the start."""
    return [value for name, value in start.items() if name.startswith("x[")]


def _draw(scene: Any, system: System, start: dict[str, float], out: Path) -> None:
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.scene.blocks import described_devices
    from hapticlink.visualization import figure_files
    from hapticlink.visualization.figures import block_diagram, schematic
    from hapticlink.visualization.mechanism import drawing, workspace_drawing

    figures = {"blocks": block_diagram.figure(system, f"Blocks of: {scene.title}")}
    q = coordinates(start)
    if q:
        figures["start"] = drawing.figure(scene, q)
    if device := described_devices(scene).get(""):
        title = f"Device and its workspace: {scene.title}"
        figures["workspace"] = workspace_drawing.draw(device, _pose(start), title)
    figures |= schematic.figures(scene, system)
    for name in figure_files.save(figures, folders.ensure(out)):
        say(f"  {out / name}")


_PER_TICK = ("operations", "signals")


def _needs(scene: Any, time: Timeline, replaced: list[str]) -> None:
    from hapticlink.analysis.findings import block_costs, requirements

    parts = list(requirements.needs(scene))
    own = f" by the scene's own {', '.join(replaced)}; an FMU in its place may need other parts"
    say(f"\nneeded{own * bool(replaced)}")
    for need in parts:
        if need.needed:
            say(f"  {need.part}: {need.why}")
    say("\noperations of a step and its outputs, signals in and out")
    rows = block_costs.costs(scene, time, skip=True)
    for row in rows:
        ports = sum(row.cost.inputs.values()), sum(row.cost.outputs.values())
        say(f"  {row.name}: {row.cost.step} operations, {ports[0]} + {ports[1]} signals")
    for title, all_rows in (
        ("a haptic tick", rows),
        ("with nothing left out", block_costs.costs(scene, time, skip=False)),
    ):
        operations, signals = (sum(getattr(r, k) for r in all_rows) for k in _PER_TICK)
        say(f"  {title}: {operations:.0f} operations, {signals:.0f} signals")
    say("\nleft out")
    for need in parts:
        if not need.needed:
            say(f"  {need.part}: {need.why}")
