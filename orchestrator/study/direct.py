"""The mechanism at the graphics rate: poses, velocities and wrenches are held, power crosses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import figures
from hapticlink.orchestrator.study.cases import PRINTED
from hapticlink.orchestrator.study.grids import (
    COLUMNS,
    COUPLING,
    ENERGY,
    Grid,
    grid,
    lasting,
    median,
    scaled,
    short,
)
from hapticlink.orchestrator.sweep.row import METRIC, Row

DIRECT, WEAKER = "closed-loop-direct", "weaker"


def at_weaker_gains(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
    grids = {b: grid(rows, METRIC, scene=DIRECT, gains=WEAKER, bias=b) for b in ("none", "full")}
    energy = {b: grid(rows, ENERGY, scene=DIRECT, gains=WEAKER, bias=b) for b in grids}
    coupling = {b: grid(rows, COUPLING, scene=DIRECT, gains=WEAKER, bias=b) for b in grids}
    yield "## The mechanism at the graphics rate: poses, velocities and wrenches are held"
    yield _advice(grids, coupling, energy)
    yield _decision(grids, coupling, energy)
    headings = {"none": "velocity terms left out", "full": "velocity terms sent"}
    made = figures.maps(
        folder,
        "direct_tracking.png",
        _title(grids),
        [(headings[b], grids[b]) for b in grids],
        "largest tracking error (mm)",
    )
    yield f"![Tracking error by hold and rate]({made})"
    in_mJ = {b: scaled(energy[b], 1e3) for b in energy}
    made = figures.maps(
        folder,
        "direct_energy.png",
        "Red feeds the loop: what holding the wrenches of hand and coupling makes in 3 s",
        [(headings[b], in_mJ[b]) for b in in_mJ],
        "energy made (mJ)",
        signed=True,
    )
    yield f"![Energy made by hold and rate]({made})"


def _everywhere(grids: dict[str, Grid]) -> dict[str, list[str]]:
    """By hold, the rates at which it lasts with and without velocity terms."""
    return {
        hold: [r for r in COLUMNS if all(r in lasting(g, hold) for g in grids.values())]
        for hold in grids["full"]
    }


def _title(grids: dict[str, Grid]) -> str:
    rates = _everywhere(grids)
    most = max(map(len, rates.values()))
    names = [h for h, r in rates.items() if len(r) == most]
    return f"{_and(names)}: lasting at {most} of {len(COLUMNS)} rates, more than any other hold"


def _advice(grids: dict[str, Grid], coupling: dict[str, Grid], energy: dict[str, Grid]) -> str:
    rates = _everywhere(grids)
    lines = [
        "| graphics rate (Hz) | take | tracking error (mm) | `zoh` there (mm) | coupling error at "
        "1 s (mm) | energy made (mJ) | holds that last |\n|---|---|---|---|---|---|---|"
    ]
    for rate in COLUMNS:
        worst = {h: _worst(grids, h, rate) for h in rates if rate in rates[h]}
        if not worst:
            lines.append(f"| {rate} | none lasts | | | | | 0 of {len(rates)} |")
            continue
        first = min(worst, key=worst.__getitem__)
        by_zoh = short(worst["zoh"]) if "zoh" in worst else "lost"
        lines.append(
            f"| {rate} | `{first}` | {short(worst[first])} | {by_zoh} | "
            f"{short(_worst(coupling, first, rate))} | {short(1e3 * _worst(energy, first, rate))} "
            f"| {len(worst)} of {len(rates)} |"
        )
    said = (
        "Of the holds that last the 3 s with velocity terms left out and with them sent, the one "
        "of the least largest tracking error; every number is the worse of the two. `a, b` is hold "
        "`a` from slow to fast and `b` from fast to slow: the mean over the slow step, `passive`. "
        "All others give the latest sample there, but `passive` and `nepce`: they stand there only."
    )
    return f"{fill(said, 108)}\n\n" + "\n".join(lines)


def _worst(grids: dict[str, Grid], hold: str, rate: str) -> float:
    return max(v for g in grids.values() if (v := g[hold][rate].value) is not None)


def _decision(grids: dict[str, Grid], coupling: dict[str, Grid], energy: dict[str, Grid]) -> str:
    head = (
        "| hold | lasts with both models at (Hz) | median tracking error there, sent (mm) | "
        "median coupling error at 1 s, sent (mm) | most energy made (mJ) |\n|---|---|---|---|---|"
    )
    lines = [head]
    for hold, rates in _everywhere(grids).items():
        if not rates:
            lines.append(f"| `{hold}` | none | | | |")
            continue
        track = median([grids["full"][hold][r].value for r in rates])
        far = median([coupling["full"][hold][r].value for r in rates])
        made = max(_worst(energy, hold, r) for r in rates)
        cells = f"{', '.join(rates)} | {short(track)} | {short(far)} | {short(1e3 * made)}"
        lines.append(f"| `{hold}` | {cells} |")
    return "\n".join(lines)


def at_printed_gains(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
    grids = {b: grid(rows, METRIC, scene=DIRECT, gains=PRINTED, bias=b) for b in ("none", "full")}
    cells = [c for g in grids.values() for by in g.values() for c in by.values()]
    ended = sum(c.value is None for c in cells)
    low = [
        c for g in grids.values() for by in g.values() for r, c in by.items()
        if r in ("10", "20", "24")
    ]  # fmt: skip
    lost = sum(c.value is None for c in low)
    lasts = {h: sum(len(lasting(g, h)) for g in grids.values()) for h in grids["full"]}
    most = max(lasts, key=lasts.__getitem__)
    yield "## The same at the report's own gains"
    yield fill(
        f"K_pc and B_pc of section B.6 were tuned for a mechanism at 512 Hz. With the mechanism at "
        f"the graphics rate {ended} of {len(cells)} cells end early, {lost} of {len(low)} at 24 Hz "
        f"and below; the hold that lasts most often, `{most}`, does in {lasts[most]} of "
        f"{len(COLUMNS) * len(grids)}.",
        108,
    )
    made = figures.maps(
        folder,
        "printed_gains.png",
        f"At the report's gains {ended} of {len(cells)} combinations are lost",
        [("velocity terms left out", grids["none"]), ("velocity terms sent", grids["full"])],
        "largest tracking error (mm)",
    )
    yield f"![Tracking error at the report's gains]({made})"


def _and(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
