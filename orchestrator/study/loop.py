"""The mechanism at 512 Hz: Lambda^-1 and P_c are held, no power crosses (the report)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import figures
from hapticlink.orchestrator.study.cases import MODELS, SYNC
from hapticlink.orchestrator.study.grids import (
    COLUMNS,
    COUPLING,
    Grid,
    best,
    grid,
    lasting,
    median,
    short,
)
from hapticlink.orchestrator.sweep.row import METRIC, Row

MOVES = {"own": "its own D, W, w, J_h", "held": "those of the last frame (B.15)"}
FOLLOWS = {"operational": "the pose", "joint": "the joints"}
LOOP = "closed-loop"


def at_haptic_rate(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
    cases = [(m, s) for m in MODELS for s in SYNC]
    track = {c: grid(rows, METRIC, scene=LOOP, model=c[0], sync=c[1], bias="full") for c in cases}
    far = {c: grid(rows, COUPLING, scene=LOOP, model=c[0], sync=c[1], bias="full") for c in cases}
    yield "## The mechanism at 512 Hz, Lambda^-1 and P_c held (the report)"
    lines = [
        "| mechanism moves by | copy follows | cells lost | tracking error, `zoh` (mm) | coupling "
        "error at 1 s, `zoh` (mm) | least of all holds (mm) |\n|---|---|---|---|---|---|"
    ]
    for model, sync in cases:
        found = far[model, sync]
        ended = [c.value is None for by in found.values() for c in by.values()]
        tracked, apart = (
            median([c.value for c in g["zoh"].values()]) for g in (track[model, sync], found)
        )
        hold, least = _least(found)
        lines.append(
            f"| {MOVES[model]} | {FOLLOWS[sync]} | {sum(ended)} of {len(ended)} | "
            f"{short(tracked)} | {short(apart)} | {short(least)} {hold} |"
        )
    yield "Velocity terms sent; medians over the rates.\n\n" + "\n".join(lines)
    own = {FOLLOWS[s]: far["own", s] for s in SYNC}
    ratios = [
        low / by_zoh
        for g in own.values()
        for r in COLUMNS
        if (by_zoh := g["zoh"][r].value) and (low := g[best(g, r) or "zoh"][r].value)
    ]
    gain = 100 * (1 - median(ratios))
    bests = ", ".join(f"`{best(own[FOLLOWS['joint']], r)}` at {r}" for r in COLUMNS)
    yield fill(
        "No power crosses a rate here, so no hold makes energy, and the tracking error hardly "
        "tells holds apart. What the user feels does: how far the handle strays from the "
        f"continuous run. The least by rate, copy by the joints: {bests}.",
        108,
    )
    made = figures.maps(
        folder,
        "loop_coupling.png",
        f"Lambda^-1 held: the best hold of a rate takes {gain:.0f} % off the zero-order hold's "
        "coupling error",
        [(f"copy follows {follows}", g) for follows, g in own.items()],
        "coupling error at 1 s (mm), velocity terms sent",
    )
    yield f"![Coupling error with Lambda^-1 held]({made})"


def _least(found: Grid) -> tuple[str, float | None]:
    """The hold of the least median, among those that last at all rates."""
    able = {
        h: median([c.value for c in by.values()])
        for h, by in found.items()
        if lasting(found, h) == list(COLUMNS)
    }
    if not able:
        return "", None
    hold = min(able, key=able.__getitem__)
    return f"`{hold}`", able[hold]
