"""The map that `hapticlink stability --vary` makes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hapticlink.commands.progress import counted, timed


def made(
    scene: str,
    folder: Path,
    options: tuple[str, ...],
    vary: list[str],
    check: int,
    seed: int,
    jobs: int | None,
    quiet: bool,
) -> tuple[list[str], dict[str, Any]]:
    """Makes or continues the map of `hapticlink stability --vary`; what is printed of it, and its
    rows."""
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
    return lines, {"folder": str(folder), "rows": points.rows}
