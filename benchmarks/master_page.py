"""The page of the benchmark `master`, its tables and its figure."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks.page import table
from benchmarks.peers.masters import MASTERS
from studies import draw

OURS, ALONE, PEERS = "hapticlink", "C loop", ("Ecos", "libcosim", "ctypes", "FMPy")
TITLES = {
    "native": "FMUs in C",
    "python": "Python FMUs of hapticlink",
    "pythonfmu": "Python FMUs of pythonfmu",
}
COLOURS = {
    OURS: "#1b6ca8", "Ecos": "#d1495b",
    "libcosim": "#e0a030", "ctypes": "#5a8f3c", "FMPy": "#8a5fa8", ALONE: "0.5",
}  # fmt: skip
Row = Mapping[str, str]
Case = tuple[str, int, int]
Best = dict[Case, dict[str, float]]


def best(rows: Iterable[Row], column: str) -> Best:
    """By case and master, the least value of a column; masters that failed are left out."""
    found: Best = {}
    for row in rows:
        case = (row["packaging"], int(row["fmus"]), int(row["signals"]))
        value, known = float(row[column]), found.setdefault(case, {})
        if math.isfinite(value):
            known[row["master"]] = min(value, known.get(row["master"], math.inf))
    return found


def share(times: Best, packaging: str, peer: str) -> str:
    """How many times as long as ours a peer takes, from least to most; "" if nowhere."""
    of = [row for case, row in times.items() if case[0] == packaging]
    found = [row[peer] / row[OURS] for row in of if peer in row and OURS in row]
    if not found:
        return ""
    least, most = (f"{x:.2g}" if x < 10 else f"{x:.0f}" for x in (min(found), max(found)))
    return f"{peer} {least} to {most}"


def finding(times: Best, packaging: str) -> str:
    return ", ".join(filter(None, (share(times, packaging, peer) for peer in PEERS)))


def by_master(values: Best, packaging: str, digits: str = ".3g") -> Iterator[str]:
    names = [m for m in MASTERS if any(m in row for row in values.values())]
    rows = (
        (n, k, *(format(row[m], digits) if m in row else "-" for m in names))
        for (of, n, k), row in sorted(values.items())
        if of == packaging
    )
    return table(f"FMUs | reals of each | {' | '.join(names)}", "rr" + "r" * len(names), rows)


def page(folder: Path, rows: Sequence[Row], whole: Sequence[Row], command: str) -> str:
    """Writes masters.png."""
    times, starts, memory = (best(rows, c) for c in ("step_us", "start_s", "memory_mb"))
    kinds = [kind for kind in TITLES if any(case[0] == kind for case in times)]
    by_kind = "; ".join(f"{TITLES[kind]}: {finding(times, kind)}" for kind in kinds)
    lines = [
        "# Masters",
        "",
        f"A step of a ring takes other masters this many times as long as hapticlink. {by_kind}.",
        "",
        f"![{title(times)}](masters.png)",
        "",
        "Rings of FMUs that pass on their inputs, y = u/2 + 1, with Jacobi coupling at one rate.",
        "hapticlink records every output; the others record nothing. `ctypes` is a loop in Python",
        "over the FMUs' functions with all arguments made before, `C loop` the same in C: what the",
        "FMUs cost themselves. Each master runs each ring in processes of its own, whose processor",
        "time is measured; the least of its rounds counts, which are all in [rows.csv](rows.csv).",
        f"Made by `{command}` on {platform.machine()}, {os.cpu_count()} cores.",
    ]
    for kind in kinds:
        lines += ["", f"## {TITLES[kind]}", "", "Microseconds per macro step:", ""]
        lines += by_master(times, kind)
        lines += ["", "Start-up in s, interpreter and imports included, FMUs in the cache:", ""]
        lines += by_master(starts, kind, ".2g")
        lines += ["", "Largest memory of the process in MB:", "", *by_master(memory, kind, ".0f")]
    lines += ["", "## The closed loop", "", *closed(whole)]
    figure(folder, times, kinds)
    return "\n".join([*lines, ""])


def closed(rows: Sequence[Row]) -> Iterator[str]:
    """What a haptic tick of `closed-loop-ideal` costs."""
    yield (
        "Microseconds of processor time per haptic tick of `closed-loop-ideal` with holds,\n"
        "energies, checks and every output recorded, beside a C loop that only sets, steps and\n"
        "gets its FMUs (all rounds in [closed-loop-ideal.csv](closed-loop-ideal.csv)):\n"
    )
    cells = []
    for kind in dict.fromkeys(row["packaging"] for row in rows):
        mine = [row for row in rows if row["packaging"] == kind]
        alone, ours = (
            min(float(row["tick_us"]) for row in mine if row["loop"] == of) for of in (ALONE, OURS)
        )
        real = f"{1e6 / 512 / ours:.0f}"
        cells.append((kind, f"{alone:.3g}", f"{ours:.3g}", f"{ours / alone:.2f}", real))
    yield from table("FMUs | C loop | hapticlink | ratio | times real time", "lrrrr", cells)


def title(times: Best) -> str:
    """What the figure shows."""
    native = [row for case, row in times.items() if case[0] == "native" and OURS in row]
    least = min(
        (min(row[p] for p in PEERS if p in row) / row[OURS] for row in native if len(row) > 2),
        default=math.nan,
    )
    return f"With FMUs in C every other master takes at least {least:.1f} times as long"


def figure(folder: Path, times: Best, kinds: Sequence[str]) -> None:
    """Time per macro step over the number of FMUs, by master."""
    drawn, panels = draw.panels(len(kinds), width=4.4, height=4.4)
    for axes, kind in zip(panels, kinds, strict=True):
        signals = 3 if kind == "native" else 12
        for name, colour in COLOURS.items():
            points = sorted(
                (n, row[name])
                for (of, n, k), row in times.items()
                if (of, k) == (kind, signals) and name in row
            )
            if points:
                line, width = "o:" if name == ALONE else "o-", 2.5 if name == OURS else 1.2
                x, y = zip(*points, strict=True)
                axes.loglog(x, y, line, ms=3, lw=width, color=colour, label=name)
        axes.set_title(f"{TITLES[kind]}, {signals} reals each", fontsize=10)
        axes.set_xlabel("FMUs")
        axes.set_xticks([2, 4, 16, 64], ["2", "4", "16", "64"])
        axes.minorticks_off()
    panels[0].set_ylabel("processor time per macro step, us")
    shown = panels[0].get_legend_handles_labels()
    drawn.legend(*shown, ncols=len(shown[1]), loc="outside lower center", fontsize=8)
    drawn.suptitle(title(times))
    draw.save(drawn, folder, "masters.png")
