"""The page and the figure of the benchmark `skip`."""

from __future__ import annotations

import statistics
from pathlib import Path

from benchmarks.page import table
from benchmarks.rows import Rows, quartiles
from benchmarks.skip import OFF, ON
from studies import draw

COUNTS = ("operations", "calls", "values")
Ratios = dict[str, dict[str, list[float]]]


def ratios(rows: Rows) -> Ratios:
    """By scene and quantity, without skipping over with it: in each round of the run time."""
    found: Ratios = {}
    for (scene, skipping, number), row in rows.rows.items():
        if skipping != ON or (scene, OFF, number) not in rows:
            continue
        off = rows.rows[scene, OFF, number]
        of = found.setdefault(scene, {name: [] for name in (*COUNTS, "run_s")})
        for name, values in of.items():
            values.append(float(off[name]) / max(float(row[name]), 1e-12))
    return found


def page(out: Path, rows: Rows, same: Rows, command: str) -> str:
    """Writes skip.png."""
    found = ratios(rows)
    _figure(out, found)
    cells = []
    for scene in found:
        on, off = (rows.rows[scene, s, "0"] for s in (ON, OFF))
        first, middle, third = quartiles(found[scene]["run_s"])
        counted = [f"{int(row[n]):,}" for n in COUNTS for row in (on, off)]
        spread = f"{middle:.2f} ({first:.2f} to {third:.2f})"
        cells.append((scene, *counted, spread, _same(same.rows[scene,])))
    heads = (
        "scene | operations | without skipping | calls | without | values | without | "
        "run time without / with | the same"
    )
    lines = [
        "# What leaving out the unneeded saves",
        "",
        _finding(found, same),
        "",
        "![Operations and run time without skipping, over those with it](skip.png)",
        "",
        f"Made by `{command}`. "
        "Each shipped scene runs with native FMUs as it is, and with nothing skipped: all "
        "blocks, all optional outputs and all pairs of contacts are built into FMUs, every "
        "output is fetched at each communication point, and every input is set whether it has "
        "changed or not. Operations (executed in all steps of the FMUs), FMI calls (set, step, "
        "get) and values moved by them repeat exactly; run time, the processor time of the "
        "loop, is the median of the ratios of interleaved rounds, with quartiles, recording "
        "what connections read. The same: how many of the numbers that the scene has in its "
        "tables, all outputs recorded, are equal to the last bit. All rows: "
        "[runs.csv](runs.csv), [same.csv](same.csv).",
        "",
        *table(heads, "lrrrrrrrl", cells),
        "",
    ]
    return "\n".join(lines)


def _same(row: dict[str, str]) -> str:
    compared, differ = int(row["compared"]), int(row["differ"])
    text = f"all {compared:,}"
    if differ:
        text = f"{compared - differ:,} of {compared:,}; others within "
        text += f"{float(row['largest_difference']):.1g}"
    return text + (f"; without {row['apart']}" if row["apart"] else "")


def _finding(found: Ratios, same: Rows) -> str:
    def spread(name: str) -> str:
        values = sorted(quartiles(of[name])[1] for of in found.values())
        return f"{statistics.median(values):.2f} ({values[0]:.2f} to {values[-1]:.2f})"

    equal = sum(row["differ"] == "0" for row in same.rows.values())
    worst = max(float(row["largest_difference"]) for row in same.rows.values())
    rest = (
        "" if equal == len(same.rows) else f", within {worst:.1g} of a signal's largest in others"
    )
    return (
        f"Without skipping, runs take {spread('run_s')} times as long, in the median over "
        f"{len(found)} scenes (least to most): with {spread('operations')} times the operations, "
        f"and {spread('values')} times the values moved between FMUs. "
        f"Results are the same to the bit in {equal} of {len(same.rows)} scenes{rest}."
    )


def _figure(folder: Path, found: Ratios) -> None:
    order = sorted(found, key=lambda s: found[s]["operations"][0])
    figure, (axes,) = draw.panels(1, width=7.5, height=0.23 * len(order) + 1.6)
    axes.grid(visible=False)
    places = range(len(order))
    operations = [found[s]["operations"][0] for s in order]
    times = [quartiles(found[s]["run_s"]) for s in order]
    middle = [t[1] for t in times]
    bars = [[t[1] - t[0] for t in times], [t[2] - t[1] for t in times]]
    axes.hlines(places, 1, operations, color="0.8", lw=1)
    axes.plot(operations, places, "o", ms=5, color="#8bb8d8", label="operations")
    axes.errorbar(
        middle, places, xerr=bars, fmt="o", ms=5, color="#d1495b", label="run time, quartiles"
    )
    axes.axvline(1, color="0.4", lw=1)
    axes.set_xscale("log")
    ticks = [1, 1.5, 2, 3, 5, 10]
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axes.minorticks_off()
    axes.set_yticks(places, order, fontsize=8)
    axes.set_xlabel("without skipping, over with it")
    axes.legend(loc="lower right")
    median = statistics.median(middle)
    axes.set_title(
        f"Without skipping runs take {median:.2f} times as long (median of scenes)", fontsize=11
    )
    draw.save(figure, folder, "skip.png")
