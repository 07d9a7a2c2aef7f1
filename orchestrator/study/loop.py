"""The part of the page with the mechanism at 512 Hz: Lambda^-1 and P_c are held, and no power
crosses rates (the report)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import figures
from hapticlink.orchestrator.study.cases import BIAS, MODELS, SYNC
from hapticlink.orchestrator.study.grids import (
    COLUMNS,
    COUPLING,
    Grid,
    best,
    grid,
    median,
    short,
    stable_rates,
)
from hapticlink.orchestrator.sweep.row import METRIC, Row

MATRICES = {"own": "its own", "held": "of the last frame (B.15)"}
FOLLOWS = {"operational": "the pose", "joint": "the joints"}
COMPENSATION = {"none": "off", "full": "on"}
LOOP = "closed-loop"


def at_haptic_rate(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
    """The section of the page; writes its figure."""
    cases = [(m, s, b) for m in MODELS for s in SYNC for b in BIAS]
    wheres = {(m, s, b): {"model": m, "sync": s, "bias": b} for m, s, b in cases}
    track = {c: grid(rows, METRIC, scene=LOOP, **where) for c, where in wheres.items()}
    far = {c: grid(rows, COUPLING, scene=LOOP, **where) for c, where in wheres.items()}
    yield "## The mechanism at 512 Hz, Lambda^-1 and P_c held (the report)"
    lines = [
        "| mechanism's D, W, w, J_h | copy follows | Coriolis compensation | unstable cells | "
        "tracking error, `zoh` (mm) | coupling error at 1 s, `zoh` (mm) | smallest of all holds "
        "(mm) |\n|---|---|---|---|---|---|---|"
    ]
    for case in cases:
        model, sync, bias = case
        found = far[case]
        ended = [c.value is None for by in found.values() for c in by.values()]
        tracked, apart = (
            median([c.value for c in g["zoh"].values()]) for g in (track[case], found)
        )
        hold, least = _least(found)
        lines.append(
            f"| {MATRICES[model]} | {FOLLOWS[sync]} | {COMPENSATION[bias]} | "
            f"{sum(ended)} of {len(ended)} | "
            f"{short(tracked)} | {short(apart)} | {short(least)} {hold} |"
        )
    yield f"Medians over the rates.\n\n{chr(10).join(lines)}"
    own = {FOLLOWS[s]: far["own", s, "full"] for s in SYNC}
    ratios = [
        low / by_zoh
        for g in own.values()
        for r in COLUMNS
        if (by_zoh := g["zoh"][r].value) and (low := g[best(g, r) or "zoh"][r].value)
    ]
    gain = 100 * (1 - median(ratios))
    by_hold: dict[str, list[str]] = {}
    for rate in COLUMNS:
        by_hold.setdefault(f"`{best(own[FOLLOWS['joint']], rate)}`", []).append(rate)
    bests = "; ".join(f"{hold} at {', '.join(rates)}" for hold, rates in by_hold.items())
    tracks = [track["own", s, "full"] for s in SYNC]
    most = max(v for g in tracks for by in g.values() for c in by.values() if (v := c.value))
    yield fill(
        "No force crosses rates here; a held mobility modulates the power of the motors, by a few "
        "mJ (docs/passivity.md, The user's port). With the mechanism's own "
        "matrices and Coriolis and centrifugal compensation on, the tracking error is at most "
        f"{short(most)} mm for every hold and rate; what the user feels is the coupling error, the "
        "distance of the handle from the continuous run. Holds with the smallest one by rate, "
        f"where the copy follows the joints: {bests}.",
        108,
        break_on_hyphens=False,
    )
    made = figures.maps(
        folder,
        "loop_coupling.png",
        f"Lambda^-1 held: the best hold of a rate reduces the zero-order hold's coupling error by "
        f"{gain:.0f} %",
        [(f"copy follows {follows}", g) for follows, g in own.items()],
        "coupling error at 1 s (mm), Coriolis and centrifugal compensation on",
    )
    yield f"![Coupling error with Lambda^-1 held]({made})"


def _least(found: Grid) -> tuple[str, float | None]:
    """The hold with the smallest median, among those that are stable at all rates."""
    able = {
        h: median([c.value for c in by.values()])
        for h, by in found.items()
        if stable_rates(found, h) == list(COLUMNS)
    }
    if not able:
        return "", None
    hold = min(able, key=able.__getitem__)
    return f"`{hold}`", able[hold]
