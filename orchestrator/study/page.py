"""The page: which hold at which rate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import figures
from hapticlink.orchestrator.study.cases import FLOOR, MODELS, PRINTED, REFERENCE, SYNC
from hapticlink.orchestrator.study.errors import floor
from hapticlink.orchestrator.study.grids import COLUMNS, Grid, best, grid, lasting, short
from hapticlink.orchestrator.sweep.row import METRIC, Row

COUPLING, MODELLING, ENERGY = "coupling_1s_mm", "modelling_1s_mm", "held_energy_made_J"
MOVES = {"own": "its own D, W, w, J_h", "held": "those of the last frame (B.15)"}
FOLLOWS = {"operational": "the pose", "joint": "the joints"}
DIRECT, LOOP, WEAKER = "closed-loop-direct", "closed-loop", "weaker"


def write(folder: Path, rows: Sequence[Row]) -> Path:
    """README.md of the folder, and its figures."""
    parts = [_head(), *_direct(folder, rows), *_printed(folder, rows), *_loop(folder, rows)]
    parts += [_modelling(rows), _how(rows)]
    path = folder / "README.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def _head() -> str:
    return (
        "# The mismatch of rates: which hold at which rate\n\n"
        "Made by `hapticlink study`; every number is in [table.csv](table.csv). The five-bar of "
        "Table 6.1, a constant\nwrench of the hand, 3 s, haptics at 512 Hz, graphics at 10 to 60 "
        "Hz; `10..60` draws each period between the\ntwo (three seeds, the worst is shown). Grey "
        "cells ended early, at the time they tell: the device left its\nworkspace or the "
        "mechanism broke down."
    )


# --- the mechanism at the graphics rate -------------------------------------------------------


def _direct(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
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
    in_mJ = {b: _times(energy[b], 1e3) for b in energy}
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
        "of the least largest tracking error; every number is the worse of the two. `a, mean` is "
        "hold `a` from slow to fast and the mean over the slow step from fast to slow, where all "
        "others give the latest sample."
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
        track = _median([grids["full"][hold][r].value for r in rates])
        far = _median([coupling["full"][hold][r].value for r in rates])
        made = max(_worst(energy, hold, r) for r in rates)
        cells = f"{', '.join(rates)} | {short(track)} | {short(far)} | {short(1e3 * made)}"
        lines.append(f"| `{hold}` | {cells} |")
    return "\n".join(lines)


# --- the report's gains -----------------------------------------------------------------------


def _printed(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
    grids = {b: grid(rows, METRIC, scene=DIRECT, gains=PRINTED, bias=b) for b in ("none", "full")}
    cells = [c for g in grids.values() for by in g.values() for c in by.values()]
    ended = sum(c.value is None for c in cells)
    low = [
        c for g in grids.values() for by in g.values() for r, c in by.items()
        if r in ("10", "20", "24")
    ]  # fmt: skip
    lost = sum(c.value is None for c in low)
    yield "## The same at the report's own gains"
    yield fill(
        f"K_pc and B_pc of section B.6 were tuned for a mechanism at 512 Hz. With the mechanism at "
        f"the graphics rate {ended} of {len(cells)} cells end early, {lost} of {len(low)} at 24 Hz "
        f"and below; no hold makes up for gains that the rate does not allow.",
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


# --- the report's own arrangement -------------------------------------------------------------


def _loop(folder: Path, rows: Sequence[Row]) -> Iterator[str]:
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
            _median([c.value for c in g["zoh"].values()]) for g in (track[model, sync], found)
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
    gain = 100 * (1 - _median(ratios))
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
        h: _median([c.value for c in by.values()])
        for h, by in found.items()
        if lasting(found, h) == list(COLUMNS)
    }
    if not able:
        return "", None
    hold = min(able, key=able.__getitem__)
    return f"`{hold}`", able[hold]


def _modelling(rows: Sequence[Row]) -> str:
    reference, full = (
        {r["gains"]: r for r in rows if _is_reference(r) and r["bias"] == bias}
        for bias in ("none", "full")
    )
    text = (
        f"Leaving the velocity terms out moves the handle by "
        f"{reference[PRINTED][MODELLING]:.2g} mm in the first second even where nothing is held, "
        f"and the tracking error is then {reference[PRINTED][METRIC]:.2g} mm against "
        f"{full[PRINTED][METRIC]:.1g} mm with them. No choice of hold makes up for that: send them "
        "first, then choose a hold."
    )
    return f"## What the model leaves out\n\n{fill(text, 108)}"


def _how(rows: Sequence[Row]) -> str:
    first, whole = floor(rows, COUPLING), floor(rows, "coupling_max_mm")
    text = (
        "Tracking: the largest |x_S - x_D|. Coupling: how far the handle is from that of the same "
        f"blocks at {REFERENCE} Hz, each with its own Lambda^-1 and nothing held, on a grid of "
        "128 Hz, over the first second (table.csv has the whole run too: the loop is active, so "
        f"differences grow). The same at {FLOOR} Hz differ from it by up to {first:.1g} mm in the "
        f"first second and {whole:.1g} mm in 3 s: less is not told from none. Modelling: the "
        "handle with velocity terms left out against sent. Energy: the sum over the connections "
        "that carry power across rates, made positive. Device dimensions are assumed "
        "(`components/specs.py`)."
    )
    return f"## How it was measured\n\n{fill(text, 108)}"


def _is_reference(row: Row) -> bool:
    return row["scene"] == "continuous" and row["rate"] == str(REFERENCE)


def _median(values: Sequence[float | None]) -> float:
    found = sorted(v for v in values if v is not None)
    return found[len(found) // 2] if found else float("nan")


def _times(found: Grid, factor: float) -> Grid:
    return {
        h: {
            r: replace(c, value=None if c.value is None else factor * c.value)
            for r, c in by.items()
        }
        for h, by in found.items()
    }


def _and(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
