"""`hapticlink stability`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands import stability_map
from hapticlink.commands.options import (
    UNCHANGED,
    Changes,
    Json,
    Out,
    Quiet,
    Scene,
    default_folder,
    print_result,
)
from hapticlink.commands.progress import steps, waiting
from hapticlink.commands.sweep import Jobs, Vary

Equilibrium = Annotated[
    bool,
    Parameter(
        negative="", help="Judge the scene in its own hand alone, where its run comes to rest."
    ),
]
Figure = Annotated[bool, Parameter(negative="", help="Draw the verdict: stability.png in OUT.")]
Poses = Annotated[int, Parameter(help="Poses of the scene's run that are judged.")]
Grid = Annotated[
    int,
    Parameter(help="Judge the workspace around the run, too, at as many places along each side."),
]
Drift = Annotated[
    tuple[float, float],
    Parameter(help="Frequency (Hz) and growth rate (1/s) below which a growing mode is a drift."),
]
UserPort = Annotated[
    bool,
    Parameter(negative="", help="Report, too, whether any hand could be given energy."),
]
Check = Annotated[
    int,
    Parameter(help="Points of the map to be checked by runs, near the boundary and far away."),
]
Seed = Annotated[int, Parameter(help="Seed of the choice of these points.")]


def stability(
    scene: Scene,
    /,
    *,
    out: Out = None,
    changes: Changes = UNCHANGED,
    poses: Poses = 3,
    grid: Grid = 0,
    drift: Drift = (1.0, 0.2),
    figure: Figure = False,
    equilibrium: Equilibrium = False,
    port: UserPort = False,
    vary: Vary = None,
    check: Check = 0,
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Analyse whether a scene shakes: in poses that it visits, in hands from soft to firm.

    Prints the verdict, the worst pose of each hand, how far the worst case is from the limit, and
    what makes it stable; docs/stability.md explains it line by line. Writes stability.json to OUT
    (default `runs/SCENE`, with options `runs/SCENE,key=value,...`).

    With --vary, a map over one or two numeric keys and others, refined at the boundary: map.csv
    and map.png in OUT (default maps/SCENE); the same command continues an interrupted map.

    For example:

        hapticlink stability closed-loop
        hapticlink stability closed-loop --grid 6
        hapticlink stability virtual-wall --set fmu.wall.start.stiffness=5000
        hapticlink stability virtual-wall --port
        hapticlink stability virtual-wall --vary fmu.wall.start.stiffness=2000..8000:4 --check 2
    """
    given = changes.options
    name = default_folder("runs", scene).name
    if vary:
        folder = out or changes.folder("maps", scene)
        lines, record = stability_map.made(scene, folder, given, vary, check, seed, jobs, quiet)
        first, *rest = lines
        print_result((f"{name}: {first}", *rest), record, quiet, json)
        return 0
    import hapticlink as hl
    from hapticlink.analysis.stability.modes import Bounds
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.files import write_json

    passivity = None
    if port:  # first, as what it refuses is known within seconds
        with waiting(f"{name}: the user's port", quiet):
            passivity = hl.passivity(scene, given)
    folder, bounds = out or changes.folder("runs", scene), Bounds(*drift)
    with steps(f"{name}: stability", hidden=quiet) as progress:
        judged: hl.Stability | hl.VaryingStability
        if equilibrium:
            judged = hl.equilibrium_stability(scene, given, bounds=bounds, progress=progress)
        else:
            judged = hl.stability(
                scene, given, poses=poses, grid=grid, bounds=bounds, progress=progress
            )
    record, lines = judged.record(), [*judged.lines()]
    if passivity:
        record |= {"port": passivity.record()}
        lines += passivity.lines()
    if figure and isinstance(judged, hl.Stability):
        from hapticlink.visualization import figure_axes  # Matplotlib is slow to load
        from hapticlink.visualization.figures import stability_figure

        figure_axes.save({"stability": stability_figure.draw(judged)}, folders.ensure(folder))
    write_json(folders.ensure(folder) / "stability.json", record)
    report = (*lines, f"{folder}/stability.json")
    first = f"{name}: {judged.finding}"
    print_result((first, *(f"  {line}" for line in report)), record, quiet, json)
    return 0
