from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from hapticlink.commands.options import PRINTED, UNCHANGED, Output, Scene, SceneOptions, title
from hapticlink.commands.progress import count_runs, steps, time_command, waiting
from hapticlink.commands.sweep import Jobs, Vary
from hapticlink.orchestrator.results.numbers import short

if TYPE_CHECKING:
    from hapticlink.analysis.maps.stability_map import Map

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
    Parameter(negative="", help="Report also whether some hand could get energy from it."),
]
Check = Annotated[
    int,
    Parameter(help="Points of the map to be checked by runs, near the boundary and far away."),
]
Seed = Annotated[int, Parameter(help="Seed of the choice of these points.")]
Largest = Annotated[
    str | None,
    Parameter(
        help="key=value, with --vary: the largest stable and the largest passive value of the key, "
        "searched from this one on, at each combination of the others."
    ),
]


def stability(
    scene: Scene,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    poses: Poses = 3,
    grid: Grid = 0,
    drift: Drift = (1.0, 0.2),
    figure: Figure = False,
    equilibrium: Equilibrium = False,
    port: UserPort = False,
    vary: Vary = None,
    largest: Largest = None,
    check: Check = 0,
    seed: Seed = 0,
    jobs: Jobs = None,
    output: Output = PRINTED,
) -> int:
    """Analyse whether a scene shakes: in poses that it visits, in hands from soft to firm.

    Prints the verdict, the worst pose of each hand, how far the worst case is from the limit, and
    what makes it stable; docs/stability.md explains it line by line. Writes stability.json to OUT
    (default `runs/SCENE`, with options `runs/SCENE,key=value,...`).

    With --vary, a map over one or two numeric keys and others, refined at the boundary: map.csv
    and map.png in OUT (default maps/SCENE); the same command continues an interrupted map. With
    --largest, the Z-width: z-width.csv and z-width.png.

    For example:

        hapticlink stability closed-loop
        hapticlink stability closed-loop --grid 6
        hapticlink stability virtual-wall --set fmu.wall.start.stiffness=5000
        hapticlink stability virtual-wall --port
        hapticlink stability virtual-wall --vary fmu.wall.start.stiffness=2000..8000:4 --check 2
        hapticlink stability virtual-wall --largest fmu.wall.start.stiffness=1000 \\
            --vary linkage.joint.rail.damping=1,5
    """
    import hapticlink as hl

    given, name, quiet = changes.options, title(scene), output.quiet
    if vary:
        return _over_keys(scene, vary, largest, check, seed, changes, jobs, output)
    if largest:
        raise hl.InputFault("--largest needs --vary: over which keys, e.g. --vary haptics.rate=512")
    from hapticlink.analysis.stability.modes import Bounds
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.write_files import write_json

    passivity = None
    if port:  # first, as what it refuses is known within seconds
        with waiting(f"{name}: the user's port", quiet):
            passivity = hl.passivity(scene, given)
    folder, bounds = output.out or changes.folder("runs", scene), Bounds(*drift)
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
        from hapticlink.visualization import figure_files  # Matplotlib is slow to load
        from hapticlink.visualization.figures import stability_figure

        figure_files.save({"stability": stability_figure.draw(judged)}, folders.ensure(folder))
    write_json(folders.ensure(folder) / "stability.json", record)
    output.show(f"{name}: {judged.finding}", (*lines, f"{folder}/stability.json"), record)
    return 0


def _over_keys(
    scene: str,
    vary: Sequence[str],
    largest: str | None,
    check: int,
    seed: int,
    changes: SceneOptions,
    jobs: int | None,
    output: Output,
) -> int:
    """A map, or where a largest value is asked for, a Z-width."""
    import hapticlink as hl

    folder, quiet = output.out or changes.folder("maps", scene), output.quiet
    keys, given = [text.partition("=")[0] for text in vary], changes.options
    searched = f" --largest {largest}" if largest else ""
    command = f"hapticlink stability {scene}{searched} --vary {' --vary '.join(vary)}"
    with time_command(command, hidden=quiet), count_runs(scene, hidden=quiet) as count:
        if largest:
            rows = hl.z_width(scene, largest, vary, given, out=folder, jobs=jobs, progress=count)
            found, lines = f"largest {largest.partition('=')[0]}", [*_of_limits(rows, keys)]
            files = "z-width.csv, z-width.png"
        else:
            points = hl.stability_map(
                scene, vary, given, out=folder, check=check, seed=seed, jobs=jobs, progress=count
            )
            verdicts = [row["verdict"] for row in points.of("grid")]
            counts = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts))
            found, lines = f"{len(verdicts)} points, {counts}", [*_of_map(points, keys)]
            rows, files = points.rows, "map.csv, map.png"
    record = {"folder": str(folder), "rows": rows}
    output.show(f"{title(scene)}: {found}", [*lines, f"{folder}/: {files}"], record)
    return 0


def _of_limits(rows: Sequence[dict[str, Any]], keys: Sequence[str]) -> Iterator[str]:
    """A line for each point of a Z-width."""
    for row in rows:
        point = ", ".join(f"{key}={row[key]}" for key in keys)
        said = []
        for what in ("stable", "passive", "without_cycles"):
            kind, value = row.get(what), short(row.get(f"largest_{what}") or 0.0)
            name = what.replace("_", " limit ")
            if kind:
                end = {"limit": f" up to {value}", "at least": f" at least up to {value}"}
                said.append(f"{name}{end.get(kind, ': ' + row.get(f'message_{what}', kind))}")
        if "cycle_m" in row:
            cycle = f"{short(1e6 * row['cycle_m'])} um at {short(row['cycle_hz'])} Hz"
            said.append(
                f"where the search begins, limit cycles between two counts of up to {cycle}"
            )
        yield f"{point}: {'; '.join(said) or row.get('message', '')}"
    removed = [line for row in rows for line in row.get("judged_without", "").split("; ") if line]
    yield from dict.fromkeys(removed)


def _of_map(points: Map, keys: Sequence[str]) -> Iterator[str]:
    """Lines on the boundary, on what was refused, and on the runs that have checked a map."""
    yield f"{len(points.of('boundary'))} points of the boundary"
    reasons = [row["message"] for row in points.of("grid") if row["verdict"] == "refused"]
    yield from (f"refused, the first one: {reason}" for reason in reasons[:1])
    runs = points.of("check")
    differing = [row for row in runs if not row.get("agree")]
    if runs:
        yield f"{len(runs) - len(differing)} of {len(runs)} runs agree with the map"
    for row in differing:
        point = ", ".join(f"{key}={row[key]}" for key in keys)
        run = row.get("run_verdict", "without a verdict")
        yield f"they differ at {point}: map {row['verdict']}, run {run}"
