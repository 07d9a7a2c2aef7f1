"""The page of the study: the answer, why, the draws kept apart, and what it leaves out."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.user_port import NOTICEABLE_J, SHARE
from hapticlink.analysis.sweep.row import METRIC, Row
from studies.mismatch import finding_figures, held_out_draws, robustness
from studies.mismatch.cases import SEEDS
from studies.mismatch.design import DIRECT, FLOOR, MOBILITY, REFERENCE, SUBSTEPS
from studies.mismatch.figures import short
from studies.mismatch.findings import COMPENSATION, Found, both, named, paragraph
from studies.mismatch.measure import APART, COUPLING, MARGIN, floor, stable
from studies.mismatch.method_choice import (
    LEVEL,
    NEAR,
    Choice,
    choice,
    energy,
    margin,
    metric,
    over_seeds,
    quartiles,
    relative,
)
from studies.mismatch.methods import BIAS, COLUMNS, FEW, LIKELY, TICKS, VARIABLE


def write(folder: Path, found: Found) -> Path:
    """Writes the page, README.md of `folder`, and its figures; returns its path."""
    parts = ["# The mismatch of rates: which hold, with which gains, at which graphics rate"]
    parts += [*_answer(found), *finding_figures.sections(folder, found), *_other_limits(found)]
    parts += [*robustness.section(found), *held_out_draws.section(found), *_limits(found)]
    path = folder / "README.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def _answer(found: Found) -> Iterator[str]:
    yield paragraph(
        "Limits: the coupling stays stable, and sampling and holding generate at most "
        f"{SHARE:.0%} of the hand's work at the user's port. A method is advised if it keeps "
        "them in every [draw](../../docs/glossary.md#words). Where none does, the best is named, "
        "with the number of draws in which it keeps them. For a rate that is not in a table take "
        "the row next to it."
    )
    yield "\n".join(
        paragraph(
            f"- The mechanism at {place}, {COMPENSATION[bias]}: {_kept(found, arrangement, bias)}"
        )
        for arrangement, place in ((DIRECT, "the graphics rate"), (MOBILITY, "512 Hz"))
        for bias in BIAS
    )
    yield paragraph(held_out_draws.worth(found))
    yield paragraph(_where_to_run(found))
    yield "## The mechanism at the graphics rate"
    for bias in BIAS:
        yield _table(found, DIRECT, bias)
    yield paragraph(
        "Gains K_pc (N/m, N/m, N.m/rad) and B_pc (N.s/m, N.s/m, N.m.s/rad): soft (25, 25, .01) and "
        "(5, 5, .002); medium (100, 100, .1) and (20, 20, .02), as in `closed-loop-direct`; stiff "
        "(100, 100, .5) and (70, 70, .375), the report's. `a, b` is hold `a` from slow to fast and "
        "`b` from fast to slow, without `b` the latest sample; `slope` holds the velocity from "
        "slow to fast."
    )
    yield "\n".join(
        f"| {column} | {meaning} |"
        for column, meaning in (
            ("column", "meaning"),
            ("---", "---"),
            (
                "within the limits",
                "draws that are stable and keep the limit of energy at the user's port (below)",
            ),
            ("error", "largest distance of x_S and x_D in a run, median of stable draws (worst)"),
            (
                "take any of these",
                "the method whose numbers the row has, first, and those that it does not beat "
                "beyond the spread. If it is advised, it beats another by a smaller error in more "
                "than three quarters of the draws; if not, by keeping the limits in more draws "
                f"(sign test at {LEVEL:.0%}): [how sure that is](#how-sure-is-a-row)",
            ),
            (
                "try, too",
                "no method is the most accurate in every hand: run these on your scene, and take "
                "the smallest error within the limits. Each adds most cases in which the best of "
                "the row and these is within a tenth of the best of all methods",
            ),
        )
    )
    yield paragraph(
        "[advice.csv](advice.csv) has quartiles, spread over seeds, coupling error, energy and "
        "margin of each row."
    )
    yield "## The mechanism at 512 Hz, Lambda^-1 and P_c held (the report)"
    for bias in BIAS:
        yield _table(found, MOBILITY, bias)


def _kept(found: Found, arrangement: str, bias: str) -> str:
    """At which rates a method is advised, and what the best one keeps at the others."""
    chosen = {rate: found.advice[arrangement, bias, rate] for rate in COLUMNS}
    advised = [rate for rate in COLUMNS if chosen[rate].method]
    others = [f"{c.most} of {c.of} at {rate} Hz" for rate, c in chosen.items() if not c.method]
    sentences = [f"advised at {both(advised)} Hz"] if advised else []
    sentences += (
        [f"nothing keeps the limits elsewhere, the best in {both(others)}"] if others else []
    )
    return "; ".join(sentences) + "."


def _where_to_run(found: Found) -> str:
    """Which arrangement keeps the limits in more draws, with the errors at 30 Hz."""
    pairs = [
        (found.advice[MOBILITY, b, r].most, found.advice[DIRECT, b, r].most)
        for b, r in product(BIAS, COLUMNS)
    ]
    more, fewer = sum(m > d for m, d in pairs), sum(m < d for m, d in pairs)
    text = (
        "With the mechanism at the haptic rate only Lambda^-1 and P_c cross from the graphics "
        f"rate. Its best method keeps the limits in more draws than the best at the graphics rate "
        f"in {more} of {len(pairs)} rows, in fewer in {fewer}."
    )
    for bias in BIAS:
        at = []
        for arrangement, place in ((MOBILITY, "512 Hz"), (DIRECT, "30 Hz")):
            taken = found.advice[arrangement, bias, "30"].best
            rows = found.cells[arrangement, bias, "30"][taken].values()
            error = short(quartiles(filter(stable, rows), metric(DIRECT))[1])
            at.append(f"{error} mm for the mechanism at {place} ({named(taken)})")
        text += f" Median error with graphics at 30 Hz, {COMPENSATION[bias]}: {both(at)}."
    return text


def _table(found: Found, arrangement: str, bias: str) -> str:
    lines = [
        f"| {COMPENSATION[bias]}: graphics rate (Hz) | take any of these | within the limits "
        "| error (mm) | try, too |",
        "|---" * 5 + "|",
    ]
    for rate in COLUMNS:
        cell = (arrangement, bias, rate)
        chosen = found.advice[cell]
        rows = [r for r in found.cells[cell][chosen.best].values() if stable(r)]
        _, middle, _, worst = map(short, quartiles(rows, METRIC))
        error = f"{middle} ({worst})" if rows else "-"
        alike = robustness.by_gains((chosen.best, *chosen.ties))
        taken = alike if chosen.admitted else f"nothing; nearest: {alike}"
        lines.append(
            f"| {rate} | {taken} | {_within(chosen)} | {error} | "
            f"{'; '.join(map(named, found.listed[cell][1:]))} |"
        )
    return "\n".join(lines)


def _within(chosen: Choice) -> str:
    """How many draws keep the limits, and why the others do not."""
    over = chosen.of - chosen.most - chosen.lost
    why = [f"{chosen.lost} unstable"] * (chosen.lost > 0) + [f"{over} by energy"] * (over > 0)
    return f"{chosen.most} of {chosen.of}" + (f" ({', '.join(why)})" if why else "")


def table_rows(found: Found) -> Iterator[Row]:
    """What is known of the method of each row of the tables, for advice.csv."""
    for (arrangement, bias, rate), chosen in found.advice.items():
        if rate not in COLUMNS:
            continue
        cell = (arrangement, bias, rate)
        rows = [r for r in found.cells[cell][chosen.best].values() if stable(r)]
        low, middle, high, worst = quartiles(rows, METRIC)
        yield {
            "arrangement": arrangement,
            "bias": bias,
            "rate": rate,
            **chosen.best._asdict(),
            "advised": chosen.admitted,
            "within": chosen.most,
            "of": chosen.of,
            "unstable": chosen.lost,
            "tracking_mm": middle,
            "tracking_lower_mm": low,
            "tracking_upper_mm": high,
            "tracking_worst_mm": worst,
            "over_seeds": over_seeds(rows, METRIC),
            COUPLING: quartiles(rows, COUPLING)[1],
            "energy": max(map(energy, rows), default=float("nan")),
            MARGIN: margin(found.margins, arrangement, chosen.best, rate),
            "as_good": "; ".join(map(named, chosen.ties)),
            "try": "; ".join(map(named, found.listed[cell])),
        }


SHARES = (0.1, SHARE, 0.5, 1.0)


def _other_limits(found: Found) -> Iterator[str]:
    """What other limits of the energy at the user's port would advise."""
    yield "## What the limit of energy decides"
    yield paragraph(
        f"The share of {SHARE:.0%} was set after runs had been seen: it is no part of the "
        "evidence. A mechanism at the graphics rate, with other shares of the hand's work:"
    )
    heads = [f"{COMPENSATION[bias].split()[-1]}, {share:.0%}" for bias in BIAS for share in SHARES]
    lines = ["| Hz | " + " | ".join(heads) + " |", "|---" * (1 + len(heads)) + "|"]
    for rate in COLUMNS:
        row = [rate]
        for bias, share in product(BIAS, SHARES):
            cell = (DIRECT, bias, rate)
            chosen = choice(cell, found.cells[cell], found.margins, share)
            row.append(named(chosen.best) if chosen.admitted else f"{chosen.most} of {chosen.of}")
        lines.append("| " + " | ".join(row) + " |")
    yield "\n".join(lines)
    yield paragraph(
        "Columns: Coriolis compensation, share. Where nothing is advised: the most draws within "
        "the limits."
    )


def _limits(found: Found) -> Iterator[str]:
    yield "## What it does not cover"
    yield paragraph(
        "The study has one device, with assumed dimensions (`components/specs/`), at 512 Hz, with "
        "ideal sensing and without latency: encoders, delays and losses add errors. Linkages of "
        "about 0.5 to 2 kg and 40 to 150 mm, wrenches up to 0.5 N, paths of 2 cm in half a second "
        "and slower. Gains in three steps, so that better ones may lie between them. Walls of 1000 "
        f"N/m and 10 N.s/m, with {SUBSTEPS} integration steps a frame where the mechanism runs at "
        f"the graphics rate. Three seconds. The rate {VARIABLE} draws each period between the "
        "two, with the draw's seed; it has no margin (`hapticlink stability` judges such rates by "
        "their own measures)."
    )
    yield "## How it was measured"
    sizes = floor(found.runs)
    yield paragraph(
        "`hapticlink study` makes this page, [runs.csv](runs.csv) (a row for each run, with the "
        "seed of its draw), [maps.csv](maps.csv) (lifted maps) and "
        "[kept-apart.csv](kept-apart.csv). A case is a linkage in a hand, with or without contact; "
        f"each has {SEEDS} draws, of the wrench or path of the hand and of the periods of a rate "
        "that varies. Every method runs on the same draws, and methods are compared within a draw. "
        "Graphics rates are whole haptic ticks a frame: "
        f"{both(list(map(str, TICKS)))} of 1/512 s. A run is "
        "stable if it reaches its end with handle and operational point less than "
        f"{APART[0]:g} mm and {APART[1]:g} rad apart. A method is "
        "advised if every draw is stable, the energy at the user's port peaks at most "
        f"at {SHARE:.0%} of the hand's work (its absolute values summed; peaks below "
        f"{1e3 * NOTICEABLE_J:g} mJ, which moves the handle at 8 cm/s, do not count), and the "
        f"lifted map, where it has one, is stable on "
        f"{both(['five-bar', 'four-bar', 'serial arm'])}. A quarter: the continuous "
        "runs, which no hold disturbs, generate up to "
        f"{_continuous(found):.0%} without Coriolis compensation, so that a lower limit would "
        "refuse the ideal. All holds, the report's gains and, with the mechanism at the graphics "
        f"rate, the integrators were tried at {both(FEW)} Hz without Coriolis compensation alone. "
        f"Elsewhere the holds {both([f'`{hold}`' for hold in LIKELY])} were: one of them is within "
        f"a tenth of the best of all in {_likely(found)} cases in which any keeps the limits. "
        f"The continuous runs are at {REFERENCE} Hz; those at {FLOOR} Hz differ from them by "
        f"{np.median(sizes):.1g} mm within 1 s (median; up to {max(sizes):.1g}), so that smaller "
        "differences of the handle mean nothing."
    )


def _likely(found: Found) -> str:
    """In how many cases one of the holds that are tried everywhere is nearly the best."""
    least = []
    for rate in FEW:
        off = relative(found.cells[DIRECT, "none", rate], METRIC)
        known = [ratios for m, ratios in off.items() if m.hold in LIKELY and m.integrator == "rk4"]
        least += np.min(known, axis=0).tolist()
    return f"{sum(value <= NEAR for value in least)} of {len(least)}"


def _continuous(found: Found) -> float:
    return SHARE * max(
        energy(r) for r in found.runs
        if r["arrangement"] == "continuous" and r["rate"] == str(REFERENCE)
    )  # fmt: skip
