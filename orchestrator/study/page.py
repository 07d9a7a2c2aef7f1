"""The page of the study: the answer, why, the cases kept apart, and what it leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill

from hapticlink.orchestrator.study import apart, why
from hapticlink.orchestrator.study.choose import (
    LEAST,
    SHARE,
    choice,
    energy,
    margin,
    metric,
    quartiles,
)
from hapticlink.orchestrator.study.design import DIRECT, FLOOR, MOBILITY, REFERENCE, SUBSTEPS
from hapticlink.orchestrator.study.figures import short
from hapticlink.orchestrator.study.found import COMPENSATION, Found, both, named
from hapticlink.orchestrator.study.measure import APART, COUPLING, floor, stable
from hapticlink.orchestrator.study.methods import BIAS, COLUMNS, VARIABLE, Method

WIDTH = 108


def write(folder: Path, found: Found) -> Path:
    """Writes the page, README.md of `folder`, and its figures; returns its path."""
    parts = ["# The mismatch of rates: which hold, with which gains, at which graphics rate"]
    parts += [*_answer(found), *why.sections(folder, found), *_other_limits(found)]
    parts += [*apart.section(found), *_limits(found)]
    path = folder / "README.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def paragraph(text: str) -> str:
    return fill(text, WIDTH, break_on_hyphens=False)


def _answer(found: Found) -> Iterator[str]:
    at = {a: _median(found, a) for a in (DIRECT, MOBILITY)}
    yield paragraph(
        "Run the mechanism at the haptic rate if you can, with gains that are stable there: then "
        "only Lambda^-1 and P_c cross from the graphics rate, and with Coriolis compensation at 30 "
        f"Hz the handle stays within {short(at[MOBILITY])} mm of the operational point (median of "
        f"the stable cases; {short(at[DIRECT])} mm for a mechanism at 30 Hz, whose gains are "
        "softer). If the mechanism itself runs at the graphics rate, take the row of your rate, or "
        f"of the next lower one, from the first tables; {_where(found)}"
    )
    yield "## The mechanism at the graphics rate"
    for bias in BIAS:
        yield from _table(found, DIRECT, bias)
    yield paragraph(
        "Gains K_pc (N/m, N/m, N.m/rad) and B_pc (N.s/m, N.s/m, N.m.s/rad): soft (25, 25, .01) and "
        "(5, 5, .002); medium (100, 100, .1) and (20, 20, .02), as in `closed-loop-direct`; stiff "
        "(100, 100, .5) and (70, 70, .375), the report's. `a, b` is hold `a` from slow to fast and "
        "`b` from fast to slow, without `b` the latest sample; `slope` is of the velocity from "
        "slow to fast. Within the limits: cases that are stable and keep the limit of energy at "
        "the user's port (below); where that is not all of them nothing is advised, and the "
        "simplest of the methods with the most such cases is shown. Error: "
        "the largest |x_S - x_D| of a run, median of the stable cases (quartiles; worst). "
        "Handle off: distance of the handle from that of the same blocks run "
        "continuously, within 1 s, median. Energy: the largest peak at the user's port, as a part "
        "of what is allowed (below). Margin: decay rate of the slowest mode of the lifted map, in "
        "an arm of 300 N/m, the smallest of the linkages; it is bounded by the arm's own modes. "
        "An adaptive hold has no map. As good: other methods that the best one does not beat in "
        "more than three quarters of the cases; the simplest of all these is advised."
    )
    yield "## The mechanism at 512 Hz, Lambda^-1 and P_c held (the report)"
    for bias in BIAS:
        yield from _table(found, MOBILITY, bias)


def _median(found: Found, arrangement: str) -> float:
    """Tracking error (mm) of the stable cases at 30 Hz with Coriolis compensation."""
    cell = (arrangement, "full", "30")
    rows = found.cells[cell][found.methods[cell]].values()
    return quartiles(filter(stable, rows), metric(DIRECT))[1]


def _where(found: Found) -> str:
    """At which rates a method is advised."""
    told = []
    for bias in BIAS:
        rates = [r for r in COLUMNS if found.advice[DIRECT, bias, r].method]
        at = f"at {both(rates)} Hz" if rates else "nowhere"
        told.append(f"{at} with {COMPENSATION[bias]}")
    return f"there, a method keeps the limits in every case {' and '.join(told)}."


def _table(found: Found, arrangement: str, bias: str) -> Iterator[str]:
    lines = [
        f"| {COMPENSATION[bias]}: graphics rate (Hz) | take | within the limits | error (mm) "
        "| handle off (mm) | energy | margin (1/s) | as good |\n|---|---|---|---|---|---|---|---|"
    ]
    for rate in COLUMNS:
        cell = (arrangement, bias, rate)
        chosen = found.advice[cell]
        method = chosen.method or chosen.nearest
        rows = [r for r in found.cells[cell][method].values() if stable(r)]
        low, middle, high, worst = map(short, quartiles(rows, metric(DIRECT)))
        off = short(quartiles(rows, COUPLING)[1])
        least = margin(found.margins, arrangement, method, rate)
        ties = _ties(chosen.ties) if chosen.method else "-"
        lines.append(
            f"| {rate} | {named(method)} | {chosen.most} of {chosen.of} | "
            f"{middle} ({low} to {high}; {worst}) | {off} | "
            f"{short(max(map(energy, rows), default=None))} | {short(least) or '-'} | {ties} |"
        )
    yield "\n".join(lines)


SHARES = (0.1, SHARE, 0.5, 1.0)


def _other_limits(found: Found) -> Iterator[str]:
    """What other limits of the energy at the user's port would advise."""
    yield "## What the limit of energy decides"
    yield paragraph(
        f"The share of {SHARE:.0%} was set when runs had been seen, so that it is no part of the "
        "evidence. A mechanism at the graphics rate, with other shares of the hand's work:"
    )
    columns = [(bias, rate) for bias in BIAS for rate in COLUMNS]
    heads = [f"{COMPENSATION[bias].split()[-1]}, {rate}" for bias, rate in columns]
    lines = ["| | " + " | ".join(heads) + " |", "|---" * (1 + len(columns)) + "|"]
    for share in SHARES:
        row = []
        for bias, rate in columns:
            cell = (DIRECT, bias, rate)
            chosen = choice(cell, found.cells[cell], found.margins, share)
            row.append(named(chosen.method) if chosen.method else f"{chosen.most} of {chosen.of}")
        lines.append(f"| {share:.0%} | " + " | ".join(row) + " |")
    yield "\n".join(lines)
    yield paragraph(
        "Columns: Coriolis compensation, graphics rate (Hz). Where nothing is advised: the most "
        "cases within the limits."
    )


def _ties(ties: Sequence[Method]) -> str:
    others = [named(m) for m in ties[1:]]
    if not others:
        return "none"
    return "; ".join(others[:3]) + (f" and {len(others) - 3} more" if len(others) > 3 else "")


def _limits(found: Found) -> Iterator[str]:
    yield "## What it does not cover"
    yield paragraph(
        "One device, with assumed dimensions (`components/specs/`), at 512 Hz, with ideal sensing "
        "and without latency: encoders, delays and losses add to what is found here. Linkages of "
        "about 0.5 to 2 kg and 40 to 150 mm, wrenches up to 0.5 N, paths of 2 cm in half a second "
        "and slower. Gains in three steps, so that better ones may lie between them. Walls of 1000 "
        f"N/m and 10 N.s/m, with {SUBSTEPS} integration steps a frame where the mechanism runs at "
        f"the graphics rate. Three seconds. The rate {VARIABLE} draws each period between the "
        "two, with the case's seed; it has no margin (`hapticlink stability` judges such rates by "
        "their own measures)."
    )
    yield "## How it was measured"
    size = floor(found.runs)
    yield paragraph(
        "`hapticlink study` makes this page, [runs.csv](runs.csv) (a row for each run, with the "
        "seed of its hand), [maps.csv](maps.csv) (lifted maps) and "
        "[kept-apart.csv](kept-apart.csv). A case is a linkage in a hand; every method runs on the "
        "same cases, and errors are compared within a case. Graphics rates are whole haptic ticks "
        "a frame: 51, 26, 17 and 9 of 1/512 s. A run is stable if it reaches its end with handle "
        f"and operational point less than {APART[0]:g} mm and {APART[1]:g} rad apart. A method is "
        "admitted to a cell if every case is stable, the energy at the user's port peaks at most "
        f"at {SHARE:.0%} of the hand's work (its absolute values summed; peaks below "
        f"{1e3 * LEAST:g} mJ, which moves the handle at 8 cm/s, do not count), and the lifted map, "
        f"where it has one, is stable on {both(['five-bar', 'four-bar', 'serial arm'])}. A "
        "quarter: the continuous runs, which no hold disturbs, generate up to "
        f"{_continuous(found):.0%} without Coriolis compensation, and a limit below that would "
        "refuse the ideal. The report's gains and the integrators were tried without Coriolis "
        "compensation alone, to save runs. The continuous "
        f"runs are at {REFERENCE} Hz; those at {FLOOR} Hz differ from them by up to {size:.1g} mm "
        "within 1 s, so that smaller differences mean nothing."
    )


def _continuous(found: Found) -> float:
    return SHARE * max(
        energy(r) for r in found.runs
        if r["arrangement"] == "continuous" and r["rate"] == str(REFERENCE)
    )  # fmt: skip
