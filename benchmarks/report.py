"""Tables and figures of the mechanism bench."""

from __future__ import annotations

import csv
import math
import os
import platform
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from benchmarks.mechanism import LOST, MACHINE, NATIVE, advantage
from benchmarks.state import versions

COLOURS = {
    NATIVE: "#1b6ca8",
    MACHINE: "#8bb8d8",
    "MuJoCo": "#d1495b",
    "Exudyn": "#e0a030",
    "Pinocchio": "#5a8f3c",
}


def write(
    out: Path,
    found: dict[str, list[dict]],
    missing: list[str],
    energy: list[dict[str, str]],
    growth: list[dict[str, str]],
    command: str,
) -> None:
    with (out / "table.csv").open("w", newline="") as file:
        flat = [{"case": case, **row} for case, rows in found.items() for row in rows]
        writer = csv.DictWriter(file, list(flat[0]))
        writer.writeheader()
        writer.writerows(flat)
    figure_error(out / "error-against-run-time.png", found)
    figure_growth(out / "growth.png", growth)
    (out / "README.md").write_text(_page(found, energy, growth, missing, command))


def verdict(rows: list[dict]) -> dict[str, float]:
    """By peer: the least of its run times over ours at its error or less, over its best rows."""
    found = {}
    for code in COLOURS:
        ratios = [ratio for _, _, ratio in advantage(rows, code) if not math.isnan(ratio)]
        if not code.startswith("ours") and ratios:
            found[code] = min(ratios)
    return found


def unmatched(found: dict[str, list[dict]]) -> list[str]:
    """Rows of others that are more accurate than any of ours: they have no ratio."""
    return [
        f"\nNo row of ours is as accurate as {code}'s {error:.1e} m on {case} ({time:.1f} ms)."
        for case, rows in found.items()
        for code in COLOURS
        if not code.startswith("ours")
        for error, time, ratio in advantage(rows, code)
        if math.isnan(ratio)
    ]


def _page(
    found: dict, energy: list[dict], growth: list[dict], missing: list[str], command: str
) -> str:
    lines = [
        "# Mechanism: error against run time",
        "",
        f"Made by `{command}` on {platform.machine()}, {os.cpu_count()} cores, one of them used:",
        ", ".join(f"{name} {number}" for name, number in versions().items()) + ".",
        "Seconds are the least of interleaved rounds and compare within one run only. All codes",
        "start from the same pose and rates and take equal steps; building is not timed. An error",
        "above 0.1 m, or none, is a mechanism that was lost.",
        "",
        "## How many times as long the others take at equal error",
        "",
        "The least ratio over the rows that no other row of the same code beats, against our",
        "fastest row (as C) with no larger error.",
        "",
        "| mechanism | " + " | ".join(c for c in COLOURS if "ours" not in c) + " |",
        "|---|---|---|---|",
    ]
    for case, rows in found.items():
        least = verdict(rows)
        cells = (f"{least[c]:.1f}" if c in least else "-" for c in COLOURS if "ours" not in c)
        lines.append(f"| {case} | {' | '.join(cells)} |")
    lines += [
        "",
        "Pinocchio has no integrator for closed loops: its loop here is Python around its compiled",
        "constraintDynamics. `four calls only` is the time of those calls alone, the least that a",
        "program in C++ would take for the same RK4 step; the ratio above counts it, at the",
        "error of our RK4 with projection.",
        "",
        '`ours, C` is what a native FMU runs (`packaging = "native"`), with the same compiler and',
        "options, for any processor of the kind. `ours, CasADi VM` is what a Python FMU runs: the",
        "same operations, one by one from a list, at five to ten times the time.",
        "",
        "Read with care: one tip at one time, so that an error that crosses zero flatters its row;",
        "MuJoCo's equalities are soft, with one stiffness (time constant 2 h). Runs longer than",
        "3 s were not repeated.",
        *unmatched(found),
        *(f"\n{name}" for name in missing),
        "",
    ]
    for case, rows in found.items():
        lines += [
            f"## {case}",
            "",
            f"Floor of the reference: {rows[0]['floor']:.1e} m.",
            "",
            "| code | method | steps a second | evaluations a step | us a step | ms a simulated s |"
            " tip error m |",
            "|---|---|--:|--:|--:|--:|--:|",
        ]
        for r in rows:
            error = f"{r['error']:.1e}" if r["error"] < LOST else "lost"
            if math.isnan(r["error"]) and "calls" in r["method"]:
                error = ""
            lines.append(
                f"| {r['code']} | {r['method']} | {r['rate']} | {r['evaluations']} | "
                f"{r['us_per_step']:.2f} | {r['ms_per_s']:.3f} | {error} |"
            )
        lines.append("")
    lines += [
        "## Free five-bar, 12.6 mJ, 200 s at 512 Hz",
        "",
        "| integrator | stabilisation | largest closure error m | largest energy change |",
        "|---|---|--:|--:|",
    ]
    for r in energy:
        closure, drift = float(r["closure_m"]), float(r["energy_drift"])
        told = f"{closure:.1e} | {drift:.1e}" if math.isfinite(closure) else "lost | lost"
        lines.append(f"| {r['integrator']} | {r['stabilization']} | {told} |")
    lines += [
        "",
        "## Growth with the number of bodies (RK4 with projection)",
        "",
        "| mechanism | bodies | build s | instructions a step | per body | us a step, VM | as C |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for r in growth:
        bodies, count = int(r["bodies"]), int(r["instructions"])
        native = float(r["c_us"])
        lines.append(
            f"| {r['mechanism']} | {bodies} | {float(r['build_s']):.3f} | {count} | "
            f"{count / bodies:.0f} | {float(r['vm_us']):.1f} | "
            f"{f'{native:.2f}' if math.isfinite(native) else '-'} |"
        )
    return "\n".join(lines) + "\n"


def figure_error(path: Path, found: dict) -> None:
    figure, axes = plt.subplots(1, len(found), figsize=(5.2 * len(found), 4.8), squeeze=False)
    for ax, (case, rows) in zip(axes[0], found.items(), strict=True):
        _error(ax, case, rows)
    axes[0][0].set_ylabel("tip error at the end, m")
    handles = {code: Line2D([], [], color=colour, lw=2) for code, colour in COLOURS.items()}
    figure.legend(handles.values(), handles, ncols=len(handles), loc="lower center", frameon=False)
    least = [min(v.values()) for rows in found.values() if (v := verdict(rows))]
    finding = (
        f"At equal error the other codes take at least {min(least):.0f} times as long"
        if least
        else "Error against run time"
    )
    figure.suptitle(finding)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _error(ax: Axes, case: str, rows: list[dict]) -> None:
    """Every method's line; those on their code's front are named where they join it."""
    for code, colour in COLOURS.items():
        methods = sorted({r["method"] for r in rows if r["code"] == code})
        if code == MACHINE:  # the same errors as C, shifted: one line tells how far
            methods = [m for m in methods if m == "rk4, projection"]
        named = front([r for r in rows if r["code"] == code and r["method"] in methods])
        for method in methods:
            mine = [r for r in rows if (r["code"], r["method"]) == (code, method)]
            points = sorted((r["ms_per_s"], r["error"], r["floor"]) for r in mine)
            kept = [(t, e) for t, e, floor in points if 10 * floor < e < LOST]
            on_front = method in named
            if kept:
                style = {"lw": 1.5, "ms": 4} if on_front else {"lw": 0.8, "ms": 2, "alpha": 0.35}
                ax.loglog(*zip(*kept, strict=True), "o-", color=colour, **style)
            if kept and on_front:
                ax.annotate(
                    method,
                    named[method],
                    (4, 3),
                    textcoords="offset points",
                    fontsize=6,
                    rotation=10,
                    color=colour,
                )
            lost = [t for t, e, _ in points if e >= LOST]
            ax.plot(lost, [LOST] * len(lost), "x", color=colour, ms=5)
    ax.set_title(case, fontsize=10)
    ax.set_xlabel("run time per simulated second, ms (x: lost)")
    ax.grid(alpha=0.3, which="major")


def front(rows: list[dict]) -> dict[str, tuple[float, float]]:
    """By method, its fastest row (ms, m) that no other of `rows` beats in both error and time."""
    kept = [r for r in rows if 10 * r["floor"] < r["error"] < LOST]
    found: dict[str, tuple[float, float]] = {}
    for r in sorted(kept, key=lambda r: r["ms_per_s"]):
        if not any(o["error"] < r["error"] and o["ms_per_s"] < r["ms_per_s"] for o in kept):
            found.setdefault(r["method"], (r["ms_per_s"], r["error"]))
    return found


def figure_growth(path: Path, rows: list[dict]) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(9, 4))
    for name, colour in (("serial chain", "#1b6ca8"), ("N-four-bar", "#d1495b")):
        mine = [r for r in rows if r["mechanism"] == name]
        bodies = [int(r["bodies"]) for r in mine]
        axes[0].loglog(
            bodies, [int(r["instructions"]) for r in mine], "o-", color=colour, label=name
        )
        axes[1].loglog(bodies, [float(r["build_s"]) for r in mine], "o-", color=colour, label=name)
    for ax, what in zip(axes, ("instructions a step", "build time, s"), strict=True):
        first = ax.get_lines()[0]
        x, y = first.get_xdata(), first.get_ydata()
        ax.loglog(x, [y[0] * b / x[0] / 1.6 for b in x], ":", color="0.5", label="linear")
        ax.set_xlabel("bodies")
        ax.set_ylabel(what)
        ax.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.suptitle("Cost of a step and build time grow linearly in the number of bodies")
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
