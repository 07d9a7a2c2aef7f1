"""The page of the study."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from hapticlink.analysis.search.settings import GAINS
from hapticlink.analysis.sweep.row import Row
from studies.observer import cases
from studies.observer.measure import ENERGY, ERROR, FORCE, MOMENT, SHAKES

WIN, WORSE = 1.5, 1.05
HEADS = (
    "observer", "tracking error (mm)", "report's over it", "worse", "error of F_hand (mN)",
    "of the moment (mN.m)", "generated (mJ)", "vibration (um)",
)  # fmt: skip


def rounded(row: Row) -> Row:
    """A row with four digits, for a table under version control."""
    return {k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in row.items()}


def write(folder: Path, rows: Sequence[Row]) -> Path:
    """README.md of the rows of all runs; returns its path."""
    judged, tuned = _of(rows, "kept apart"), _of(rows, "tuned")
    kalman = ratios(judged, cases.KALMAN)
    low, middle, high = np.quantile(kalman, [0.25, 0.5, 0.75])
    verdict = "a win" if middle >= WIN else "no win"
    floors = [row for row in judged if row["rate"] == str(cases.FLOORS_AT)]
    parts = [
        "# Observers of the hand's wrench",
        f"With the law `kalman` the largest tracking error is {middle:.2g} times smaller "
        f"({low:.2g} to {high:.2g}, quartiles of {len(kalman)} runs on draws kept apart, each "
        f"against the same run with the report's observer): {verdict}, by the bound of {WIN} that "
        "was set before. It is larger by more than 5 % in "
        f"{sum(k < 1 / WORSE for k in kalman)} of them.",
        "Made by `python -m studies.observer` "
        "([grid and seeds](../../studies/observer/__init__.py)). Medians, with quartiles in "
        "brackets. Tracking error: the largest distance of operational point and handle. *Report's "
        "over it*: draw by draw; *worse*: runs in which it is larger by more than 5 %. Errors of "
        "the observed wrench are root mean squares over the run, with the lag at the first moment "
        "in it; *vibration* is the handle's true motion above 60 Hz. *report's, a, b*: its "
        "observer with omega_n = a and k_D = b; *kalman, a*: with omega_n = a, by default 119. "
        f"Every run is in [runs.csv](runs.csv). {_ends(rows)}",
        "## Kept apart",
        _table(judged, cases.SENSED),
    ]
    for gains in GAINS:
        of_gains = [row for row in judged if row["gains"] == gains]
        parts += [f"### {gains.capitalize()} gains", _table(of_gains, cases.SENSED)]
    parts += [
        f"## What is left: floors at {cases.FLOORS_AT} Hz",
        "*Wrench exact*: controller and mechanism get the hand's wrench as it is, pose and "
        "velocity are observed. *Motion exact*: the controller gets pose and velocity as they are, "
        "the wrench is observed.",
        _table(floors, tuple(cases.JUDGED)),
        "## What was tried",
        "On the draws that were there to choose by. *Order 4*: the hand's wrench is a line that "
        "noise bends. *Impulse kept*: the observed wrench explains each jump of the observed "
        "velocity. *Dead zone*: an angle within its count is no error. *Grip predicted*: F falls "
        "by 2000 N/m times the motion, the stiffness of the grips of the arms among the hands.",
        _table(tuned, tuple(cases.TRIED)),
        "### In arms alone",
        _table([row for row in tuned if " arm " in row["case"]], tuple(cases.TRIED)),
        "## Other devices",
        "The default bandwidth against that of the default device, 119 rad/s.",
    ]
    for device in cases.DEVICES:
        parts += [
            f"### {device[0].upper()}{device[1:]}",
            _table(_of(rows, device), cases.ON_DEVICES),
        ]
    page = folder / "README.md"
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page


def ratios(rows: Iterable[Row], observer: str) -> list[float]:
    """The tracking error with the report's observer over that with another one, draw by draw."""
    by = {(_draw(row), row["observer"]): row[ERROR] for row in rows if ERROR in row}
    return [
        by[draw, cases.PRESENT] / error
        for (draw, name), error in by.items()
        if name == observer and (draw, cases.PRESENT) in by
    ]


def _draw(row: Row) -> tuple[str, ...]:
    return row["part"], row["case"], row["seed"], row["rate"], row["gains"]


def _of(rows: Iterable[Row], part: str) -> list[Row]:
    return [row for row in rows if row["part"] == part]


def _ends(rows: Sequence[Row]) -> str:
    early = sum(row["end"] != "duration" for row in rows)
    return (
        f"{early} of {len(rows)} runs end before their time, where the device leaves its workspace."
    )


def _table(rows: Sequence[Row], observers: Sequence[str]) -> str:
    lines = ["| " + " | ".join(HEADS) + " |", "|---" * len(HEADS) + "|"]
    for name in observers:
        own = [row for row in rows if row["observer"] == name and ERROR in row]
        against = ratios(rows, name)
        cells = [
            name,
            _quartiles([row[ERROR] for row in own]),
            _quartiles(against),
            f"{sum(ratio < 1 / WORSE for ratio in against)} of {len(against)}",
            *(
                _quartiles([scale * row[key] for row in own])
                for key, scale in ((FORCE, 1e3), (MOMENT, 1e3), (ENERGY, 1.0), (SHAKES, 1.0))
            ),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _quartiles(values: Sequence[float]) -> str:
    low, middle, high = (
        f"{v:.2g}" if v < 100 else f"{v:.0f}" for v in np.quantile(values, [0.25, 0.5, 0.75])
    )
    return f"{middle} ({low} to {high})"
