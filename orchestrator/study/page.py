"""The page: which hold at which rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import direct, loop
from hapticlink.orchestrator.study.cases import FLOOR, PRINTED, REFERENCE, SYNC
from hapticlink.orchestrator.study.errors import floor
from hapticlink.orchestrator.study.grids import APART, COUPLING, MODELLING, grid, short
from hapticlink.orchestrator.sweep.row import METRIC, Row


def write(folder: Path, rows: Sequence[Row]) -> Path:
    """README.md of the folder, and its figures."""
    parts = [_head(), *direct.at_weaker_gains(folder, rows)]
    parts += [*direct.at_printed_gains(folder, rows), *loop.at_haptic_rate(folder, rows)]
    parts += [_modelling(rows), _how(rows)]
    path = folder / "README.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def _head() -> str:
    text = (
        "Made by `hapticlink study`; every number is in [table.csv](table.csv). The five-bar of "
        "Table 6.1, a constant wrench of the hand, 3 s, haptics at 512 Hz, graphics at 10 to 60 "
        "Hz; `10..60` draws each period between the two (three seeds, the worst is shown). A run "
        "stays stable where it comes to its end with handle and operational point less than a link "
        f"({APART[0]:g} mm) and {APART[1]:g} rad apart. Otherwise its cell is grey and tells when "
        "the run ended: the device left its workspace or the mechanism broke down (at 3.0 s: they "
        "came apart)."
    )
    return f"# The mismatch of rates: which hold at which rate\n\n{fill(text, 108)}"


def _modelling(rows: Sequence[Row]) -> str:
    reference, full = (
        {r["gains"]: r for r in rows if _is_reference(r) and r["bias"] == bias}
        for bias in ("none", "full")
    )
    held = {b: _tracked(rows, b) for b in ("none", "full")}
    text = (
        f"Leaving the velocity terms out moves the handle by "
        f"{reference[PRINTED][MODELLING]:.2g} mm in the first second even where nothing is "
        f"held, and the tracking error is then {reference[PRINTED][METRIC]:.2g} mm against "
        f"{full[PRINTED][METRIC]:.1g} mm with them. With Lambda^-1 held, the best hold at its "
        f"best rate tracks within {short(min(held['none']))} mm without them, the worst at its "
        f"worst within {short(max(held['full']))} mm with them."
    )
    return f"## What the model leaves out\n\n{fill(text, 108)}"


def _tracked(rows: Sequence[Row], bias: str) -> list[float]:
    """Tracking errors of the scene closed-loop, the mechanism moving by its own matrices."""
    where = {"scene": loop.LOOP, "model": "own", "bias": bias}
    grids = (grid(rows, METRIC, sync=sync, **where) for sync in SYNC)
    return [v for g in grids for by in g.values() for c in by.values() if (v := c.value)]


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
        "(`components/specs/`)."
    )
    return f"## How it was measured\n\n{fill(text, 108)}"


def _is_reference(row: Row) -> bool:
    return row["scene"] == "continuous" and row["rate"] == str(REFERENCE)
