"""The page of the study of devices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hapticlink.orchestrator.results.numbers import short
from studies.devices.measure import ALONE, COUPLING


def text(rows: Sequence[dict[str, Any]]) -> str:
    """The page, of the rows of all devices."""
    checks = [(row, check) for row in rows for check in row["checks"]]
    decided = [check for _, check in checks if check["says"] in ("stable", "unstable")]
    right = sum(check["agrees"] for check in decided)
    whole = sum(
        bool(row["checks"]) and all(check["agrees"] for check in row["checks"]) for row in rows
    )
    study = "[what is judged and run](../../studies/devices/__init__.py)"
    numbers = (
        "largest stable stiffness of the coupling (N/m)",
        "mass at the handle in the workspace (kg)",
        "least force of the motors (N)",
        "way of a count (um)",
        "observer (rad/s)",
        "error of the force by a count (N)",
    )
    ways = list(rows[0]["errors"])
    tracked, alone = (
        [
            f"| {row['device']} | {' | '.join(_error(*row[k][way]) for way in ways)} |"
            for row in rows
        ]
        for k in ("errors", "without_topology")
    )
    heads = f"| device | {' | '.join(ways)} |", "|---" + "|--:" * len(ways) + "|"
    lines = (
        "# Devices",
        "",
        "What each shipped [device](../../docs/device-file.md) can render of the report's "
        "five-bar, and whether the verdicts and margins of `stability` are those of runs. Made by "
        f"`python -m studies.devices` ({study}); all numbers: [devices.json](devices.json).",
        "",
        "## What a device can render",
        "",
        f"| device | renders | {' | '.join(numbers)} |",
        "|---|---|--:|--:|--:|--:|--:|--:|",
        *(_rendered(row) for row in rows),
        "",
        "The mass is that in the lightest direction anywhere to that in the heaviest, the least "
        "force that in the worst direction, where the device is assembled.",
        "",
        "## Tracking",
        "",
        "Largest distance (mm) of operational point and handle in 3 s, graphics at 30 Hz, and when "
        "the handle left the workspace, which ends a run: with and without velocity terms "
        "(`controller.bias`), with ideal sensing, and with encoders and default gains.",
        "",
        *heads,
        *tracked,
        "",
        f"The same without topology controller, in {ALONE:g} s:",
        "",
        *heads,
        *alone,
        "",
        "With bias full and ideal sensing the law (4.6) asks for the acceleration that the "
        "mechanism has, which has no part along constrained directions: without a topology "
        "controller errors of sampling alone push the handle that way, slowly. With velocity terms "
        "left out, or with observed forces, more does.",
        "",
        "## Verdicts and runs",
        "",
        f"Verdicts of {whole} of {len(rows)} devices agree with their runs, {right} of "
        f"{len(decided)} runs that decide: one does not where the verdict is marginal or drifts.",
        "",
        "| device | at the scene's gains | margin | times it | judged | growth (1/s), hand | run |",
        "|---|---|--:|--:|---|---|---|",
        *(_check(row, check) for row, check in checks),
        "",
    )
    return "\n".join(lines)


def _rendered(row: dict[str, Any]) -> str:
    found, margin = row["rendered"], row["margin"]
    low, high = found["mass"]
    renders = "forces and moments" if row["renders"] == "held" else "forces"
    return (
        f"| {row['device']} | {renders} | {short(COUPLING * margin)} | "
        f"{short(low)} to {short(high)} | {short(found['force'])} | "
        f"{short(1e6 * found['count'])} | {short(found['omega_n'])} | "
        f"{short(found['noise'])} |"
    )


def _error(distance: float, reason: str, time: float) -> str:
    ends = {"duration": "", "stop_when": f" (left at {time:.3g} s)"}
    return f"{short(distance)}{ends.get(reason, f' ({reason} at {time:.3g} s)')}"


def _check(row: dict[str, Any], check: dict[str, Any]) -> str:
    verdict = row["verdict"]
    return (
        f"| {row['device']} | {verdict} | {short(row['margin'])} | "
        f"{check['factor']:g} | {check['says']} | {short(check['growth'])}, {check['hand']} | "
        f"{check['run']} |"
    )
