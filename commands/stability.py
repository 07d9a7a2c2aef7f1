"""`hapticlink stability`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from hapticlink.commands.options import (
    Json,
    Map,
    Out,
    Quiet,
    Scene,
    Set,
    Swap,
    default_folder,
    options,
)
from hapticlink.commands.options import (
    tell as tell_result,
)
from hapticlink.commands.progress import counted, steps, timed, waiting
from hapticlink.commands.sweep import Jobs, Vary

At = Annotated[
    float,
    Parameter(
        help="Time (s) from which on no target, drive or wrench changes, for what is judged there: "
        "EQUILIBRIUM, PORT, GROWTH."
    ),
]
Equilibrium = Annotated[
    bool, Parameter(negative="", help="Judge the equilibrium of the scene in its own hand alone.")
]
Figure = Annotated[bool, Parameter(negative="", help="Draw the verdict: stability.png in OUT.")]
Poses = Annotated[int, Parameter(help="Poses of the scene's run that are judged.")]
Drift = Annotated[
    tuple[float, float],
    Parameter(help="Frequency (Hz) and growth rate (1/s) below which a growing mode is a drift."),
]
Growth = Annotated[
    float | None,
    Parameter(
        help="Instead, how fast perturbations grow along the run in this time (s) from AT on."
    ),
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
    set: Set = None,
    swap: Swap = None,
    map: Map = None,
    poses: Poses = 3,
    drift: Drift = (1.0, 0.2),
    figure: Figure = False,
    equilibrium: Equilibrium = False,
    at: At = 0.0,
    port: UserPort = False,
    growth: Growth = None,
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
        hapticlink stability virtual-wall --set fmu.wall.start.stiffness=5000
        hapticlink stability virtual-wall --port
        hapticlink stability virtual-wall --vary fmu.wall.start.stiffness=2000..8000:4 --check 2
    """
    chosen = (*(set or ()), *(swap or ()), *(map or ()))
    name = default_folder("runs", scene).name
    if vary:
        folder = out or default_folder("maps", scene, chosen)
        points, map_record = _map(
            scene, folder, options(set, swap, map), vary, check, seed, jobs, quiet
        )
        tell_result((f"{name}: {next(points)}", *points), map_record, quiet, json)
        return 0
    import hapticlink as hl
    from hapticlink.analysis.stability.mode_kinds import Bounds
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.files import write_json

    given = options(set, swap, map)
    if growth is not None:
        rate = hl.finite_time_growth(scene, given, at=at, seconds=growth)
        growth_lines = (
            f"{name}: over {growth:g} s from {at:g} s on, the worst",
            f"  perturbation grows at {rate:.5g} 1/s: no verdict on stability",
        )
        tell_result(
            growth_lines, {"finite_time_growth": rate, "from": at, "over": growth}, quiet, json
        )
        return 0
    folder = out or default_folder("runs", scene, chosen)
    record: dict[str, Any]
    if equilibrium or port or at:
        with waiting(f"{name}: equilibrium and linearisation", quiet):
            passivity = hl.passivity(scene, given, at=at) if port else None
            result = hl.equilibrium_stability(scene, given, at=at)
        record = result.record() | ({"port": passivity.record()} if passivity else {})
        first, lines = result.verdict, [*result.lines(), *(passivity.lines() if passivity else ())]
    else:
        with steps(f"{name}: stability", hidden=quiet) as tell:
            found = hl.stability(scene, given, poses=poses, bounds=Bounds(*drift), tell=tell)
        record, first, lines = found.record(), found.finding, [*found.lines()]
        if figure:
            _draw(found, folder)
    write_json(folders.ensure(folder) / "stability.json", record)
    report = (*lines, f"{folder}/stability.json")
    tell_result((f"{name}: {first}", *(f"  {line}" for line in report)), record, quiet, json)
    return 0


def _draw(found: Any, folder: Path) -> None:
    from hapticlink.orchestrator.results import folders
    from hapticlink.visualization.figure_axes import png, write
    from hapticlink.visualization.figures import stability_figure

    write([("stability", png(stability_figure.draw(found)))], folders.ensure(folder))


def _map(
    scene: str,
    folder: Path,
    options: tuple[str, ...],
    vary: list[str],
    check: int,
    seed: int,
    jobs: int | None,
    quiet: bool,
) -> tuple[Iterator[str], dict[str, Any]]:
    import hapticlink as hl

    command = f"hapticlink stability {scene} --vary {' --vary '.join(vary)}"
    with timed(command, hidden=quiet), counted(scene, hidden=quiet) as count:
        points = hl.stability_map(
            scene, vary, options, out=folder, check=check, seed=seed, jobs=jobs, progress=count
        )
    verdicts = [row["verdict"] for row in points.of("grid")]
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts))
    lines = [
        f"{len(verdicts)} points, {counts}",
        f"  {len(points.of('boundary'))} points of the boundary",
    ]
    reasons = [row["message"] for row in points.of("grid") if row["verdict"] == "refused"]
    lines += [f"  refused, the first one: {reason}" for reason in reasons[:1]]
    if check:
        runs = points.of("check")
        differing = [row for row in runs if not row.get("agree")]
        lines.append(f"  {len(runs) - len(differing)} of {len(runs)} runs agree with the map")
        keys = [text.partition("=")[0] for text in vary]
        for row in differing:
            point = ", ".join(f"{key}={row[key]}" for key in keys)
            run = row.get("run_verdict", "without a verdict")
            lines.append(f"  they differ at {point}: map {row['verdict']}, run {run}")
    lines.append(f"  {folder}/: map.csv, map.png")
    return iter(lines), {"folder": str(folder), "rows": points.rows}
