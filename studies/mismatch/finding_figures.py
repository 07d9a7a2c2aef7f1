"""The figures of the study, each with its finding in its title and in a sentence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.user_port import NOTICEABLE_J, SHARE
from hapticlink.analysis.sweep.row import METRIC, Row
from studies.mismatch.design import CONTINUOUS, DIRECT, MOBILITY, REFERENCE, mapped
from studies.mismatch.figures import Panel, Point, lines, short
from studies.mismatch.findings import COMPENSATION, Found, both, paragraph
from studies.mismatch.measure import COUPLING, KICK, MARGIN, RUN, draw, stable
from studies.mismatch.method_choice import energy, margin, within
from studies.mismatch.methods import (
    BIAS,
    COLUMNS,
    COMPARED,
    EARLY,
    FEW,
    GAINS,
    INTEGRATORS,
    LIKELY,
    OF_MATRICES,
    OF_MOTION,
    RATES,
    REPORT,
    Method,
)

SOME = "some draws unstable; of the others"
NAMED = ("zoh", "foh", "second-order", "passive", EARLY)
"""The holds that have a colour."""
STRONGEST = 20.0
"""Growth (1/s) at which the figure of margins ends."""
Rows = Mapping[str, Row]


def sections(folder: Path, found: Found) -> Iterator[str]:
    """The part of the page that says why; writes the figures."""
    yield "## Why"
    for part in (_gains, _tracking, _energy, _margins, _integrators, _mobility):
        yield from part(folder, found)
    yield _modelling(found)


def _point(rows: Rows, value: Callable[[Row], float], of: Callable[..., float]) -> Point | None:
    """A number of the stable draws, if that is half of them at least."""
    good = [value(row) for row in rows.values() if stable(row)]
    whole = len(good) == len(rows)
    return Point(float(of(good)), whole) if good and 2 * len(good) >= len(rows) else None


def _by_hold(
    found: Found, arrangement: str, value: Callable[[Row], float], of: Callable[..., float]
) -> list[Panel]:
    """Panels by model: a line for each hold, with the gains that were taken for the cell."""

    def at(bias: str, hold: str, rate: str) -> Point | None:
        chosen = found.advice[arrangement, bias, rate]
        rows = found.cells[arrangement, bias, rate].get(Method(hold, chosen.best.gains), {})
        point = _point(rows, value, of)
        return point and point._replace(taken=chosen.admitted and chosen.best.hold == hold)

    holds = OF_MATRICES if arrangement == MOBILITY else OF_MOTION
    return [_panel(COMPENSATION[bias], holds, COLUMNS, partial(at, bias)) for bias in BIAS]


def _panel(
    heading: str,
    lines: Iterable[str],
    rates: Iterable[str],
    at: Callable[[str, str], Point | None],
) -> Panel:
    """The points of each line that has any."""
    by_line = {x: {r: point for r in rates if (point := at(x, r))} for x in lines}
    return heading, {x: points for x, points in by_line.items() if points}


def _text(text: str, figure: str, alt: str) -> str:
    return f"{paragraph(text)}\n\n![{alt}]({figure})"


def _gains(folder: Path, found: Found) -> Iterator[str]:
    def at(bias: str, gains: str, rate: str) -> Point | None:
        share = _share(found, bias, gains, rate)
        return None if share is None else Point(share)

    drawn = [_panel(COMPENSATION[bias], GAINS, COLUMNS, partial(at, bias)) for bias in BIAS]
    low = [short(_share(found, "none", g, "10")) for g in GAINS]
    title = (
        f"Gains decide before holds: at 10 Hz, without Coriolis compensation, {low[0]} % of the "
        f"runs keep the limits with soft gains, {low[1]} % with medium, {low[2]} % with stiff ones"
    )
    unit = f"runs within the limits (%), {len(LIKELY)} holds"
    made = lines(folder, "gains.png", title, drawn, unit, list(GAINS), scale="linear")
    yield _text(f"{title}.", made, "Runs within the limits by gains and rate")


def _share(found: Found, bias: str, gains: str, rate: str) -> float | None:
    """Runs within the limits (%), over LIKELY holds and draws; None where there are none."""
    cell = found.cells[DIRECT, bias, rate]
    rows = [r for hold in LIKELY for r in cell.get(Method(hold, gains), {}).values()]
    return 100 * float(np.mean([within(r) for r in rows])) if rows else None


def _tracking(folder: Path, found: Found) -> Iterator[str]:
    drawn = _by_hold(found, DIRECT, lambda r: r[METRIC], np.median)
    cells = [(b, r) for b in BIAS for r in COLUMNS]
    best = Counter(found.advice[DIRECT, b, r].best.hold for b, r in cells)
    (hold, first), *_ = best.most_common(1)
    title = f"{hold.partition(',')[0]} is the best hold in {first} of {len(cells)} rows"
    none = [
        r for r in COLUMNS if not any(r in p and p[r].whole for _, by in drawn for p in by.values())
    ]
    if none:
        title += f"; at {both(none)} Hz no hold is stable in every draw"
    unit = "largest |x_S - x_D| (mm), median"
    made = lines(folder, "tracking.png", title, drawn, unit, NAMED, hollow=SOME)
    text = (
        f"{title}. Each rate has the gains that the table takes for it; errors change with them. "
        f"`foh` has a smaller median than `zoh` at {_fewer(drawn)} rates "
        "at which both are stable in every draw."
    )
    yield _text(text, made, "Tracking error by hold and rate")


def _fewer(drawn: Iterable[Panel]) -> str:
    """At how many rates `foh` has a smaller number than `zoh`, of those with both."""
    pairs = [
        (by["foh"][rate], by["zoh"][rate])
        for _, by in drawn
        for rate in by.get("foh", {})
        if rate in by.get("zoh", {})
    ]
    whole = [(foh.value, zoh.value) for foh, zoh in pairs if foh.whole and zoh.whole]
    return f"{sum(foh < zoh for foh, zoh in whole)} of {len(whole)}"


def _energy(folder: Path, found: Found) -> Iterator[str]:
    drawn = _by_hold(found, DIRECT, lambda r: max(1.0, 100 * energy(r)), np.max)
    known = [p.value for _, by in drawn for ps in by.values() for p in ps.values() if p.whole]
    over = sum(v > 100 for v in known)
    title = (
        f"{over} of {len(known)} combinations that are stable in every draw generate more "
        "energy at the user's port than is allowed"
    )
    unit = "peak generated (% of what is allowed)"
    made = lines(folder, "energy.png", title, drawn, unit, NAMED, hollow=SOME)
    text = (
        f"{title}: {SHARE:.0%} of the hand's work, and at least {1e3 * NOTICEABLE_J:g} mJ. `foh` "
        f"generates less than `zoh` at {_fewer(drawn)} rates. A stable run need not be "
        "passive; tracking errors do not show this."
    )
    yield _text(text, made, "Energy at the user's port by hold and rate")


def _margins(folder: Path, found: Found) -> Iterator[str]:
    holds = [h for h in OF_MOTION if mapped(Method(h, "soft"))]

    def at(gains: str, hold: str, rate: str) -> Point | None:
        least = margin(found.margins, DIRECT, Method(hold, gains), rate)
        return None if least is None else Point(max(-STRONGEST, least), least > 0)

    drawn = [_panel(f"{gains} gains", holds, RATES, partial(at, gains)) for gains in GAINS]
    every = [p for _, by in drawn for points in by.values() for p in points.values()]
    bad = sum(not p.whole for p in every)
    title = (
        f"At rest in an arm of 300 N/m, {bad} of {len(every)} combinations are unstable on "
        "some linkage"
    )
    unit = f"margin (1/s), drawn from {-STRONGEST:g} on"
    made = lines(
        folder, "margins.png", title, drawn, unit, NAMED, hollow="unstable", scale="symlog"
    )
    yield _text(f"{title}. {_signs(found)}", made, "Stability margin by hold, rate and gains")


def _signs(found: Found) -> str:
    """Whether runs agree with the maps, and where not."""
    rows = [r for by in found.margins.values() for r in by.values() if MARGIN in r]
    wrong = [r for r in rows if r["verdict"] != r[RUN]]
    text = (
        f"Whether a run decays after a kick of {KICK:g} rad/s is as the map says in "
        f"{len(rows) - len(wrong)} of {len(rows)} scenes at rest (a limit cycle in which saturated "
        "motors end a growth is no decay)"
    )
    if not wrong:
        return f"{text}."
    where = Counter((r["linkage"], r["rate"], r["arrangement"]) for r in wrong)
    listed = "; ".join(f"{n} on the {k[0]} at {k[1]} Hz ({k[2]})" for k, n in where.most_common(6))
    largest = max(abs(r[MARGIN]) for r in wrong)
    return (
        f"{text}. The others: {listed}{'; ...' if len(where) > 6 else ''}, with margins of up to "
        f"{short(largest)} 1/s (maps.csv)."
    )


def _integrators(folder: Path, found: Found) -> Iterator[str]:
    ratios: dict[str, list[float]] = {i: [] for i in INTEGRATORS if i != "rk4"}
    by_line: dict[str, dict[str, Point]] = {}
    sound = Counter[str]()
    for hold, integrator, rate in product(COMPARED, INTEGRATORS, FEW):
        cell = found.cells[DIRECT, "none", rate]
        rows = cell[Method(hold, "medium", integrator)]
        by_rk4 = cell[Method(hold, "medium")]
        sound[integrator] += all(map(stable, rows.values()))
        good = [c for c in rows if stable(rows[c]) and stable(by_rk4[c])]
        if integrator != "rk4" and good:
            found_here = [rows[c][METRIC] / by_rk4[c][METRIC] for c in good]
            ratios[integrator] += found_here
            point = Point(float(np.median(found_here)))
            by_line.setdefault(f"{hold}; {integrator}", {})[rate] = point
    middle = {i: float(np.median(r)) for i, r in ratios.items() if r}
    stated = ", ".join(f"{short(v)} with {i}" for i, v in middle.items())
    title = f"Tracking error relative to rk4 with the same hold and medium gains: {stated}"
    drawn: list[Panel] = [(COMPENSATION["none"], by_line)]
    unit = "error relative to rk4, median"
    made = lines(folder, "integrators.png", title, drawn, unit, list(by_line), scale="linear")
    quarters = "; ".join(
        f"{i} {' to '.join(short(q) for q in np.quantile(ratios[i], [0.25, 0.75]))}" for i in middle
    )
    kept = ", ".join(f"{count} with {i}" for i, count in sound.items())
    text = (
        f"{title} (medians within draws; quartiles {quarters}). Of {len(COMPARED) * len(FEW)} "
        f"cells, stable in every draw: {kept}. The passive midpoint rule generates no energy of "
        "its own, but does not prevent what the holds generate."
    )
    yield _text(text, made, "Tracking error by integrator")


def _mobility(folder: Path, found: Found) -> Iterator[str]:
    drawn = _by_hold(found, MOBILITY, lambda r: r[COUPLING], np.median)
    ratios = []
    for (_, by_line), rate in product(drawn, COLUMNS):
        values = {h: p[rate].value for h, p in by_line.items() if rate in p and p[rate].whole}
        if "zoh" in values:
            ratios.append(min(values.values()) / values["zoh"])
    gain = 100 * (1 - float(np.median(ratios))) if ratios else float("nan")
    title = (
        "With Lambda^-1 and P_c held, the best hold of a rate moves the handle off by "
        f"{gain:.0f} % less than zoh"
    )
    unit = "handle off (mm), median"
    made = lines(folder, "mobility.png", title, drawn, unit, OF_MATRICES, hollow=SOME)
    text = (
        f"{title} (median of the rates). It is the distance from the continuous run within 1 s. "
        "Each rate has the gains that the table takes for it."
    )
    yield _text(f"{text}{_lost(found)}", made, "Coupling error with Lambda^-1 held")


def _lost(found: Found) -> str:
    """The draws that no hold and no rate keeps stable at the report's gains, and whether they are
    where nothing is held."""
    every = [
        found.cells[MOBILITY, "none", rate][Method(hold, REPORT)]
        for rate, hold in product(FEW, OF_MATRICES)
    ]
    lost = [name for name in every[0] if not any(stable(rows[name]) for rows in every)]
    if not lost:
        return ""
    by_case = Counter(every[0][name]["case"] for name in lost)
    where = "; ".join(f"{case} ({n})" for case, n in by_case.items())
    alone = (r for r in _continuous(found) if r["bias"] == "none" and draw(r) in lost)
    sound = sum(map(stable, alone))
    return (
        f" With the report's gains, {len(lost)} of {len(every[0])} draws are unstable with every "
        f"hold at {both(FEW)} Hz: {where}. Of the same blocks at {REFERENCE} Hz {sound} of "
        f"{len(lost)} runs are stable: for these, not the graphics rate but 512 Hz "
        "is too slow at these gains."
    )


def _continuous(found: Found) -> list[Row]:
    every = (r for r in found.runs if r["arrangement"] == CONTINUOUS)
    return [r for r in every if r["rate"] == str(REFERENCE)]


def _modelling(found: Found) -> str:
    """What leaving out Coriolis and centrifugal terms costs where nothing is held."""
    rows = _continuous(found)
    by = {b: [r[METRIC] for r in rows if r["bias"] == b] for b in BIAS}
    worst = max((r for r in rows if r["bias"] == "full"), key=lambda r: r[METRIC])
    text = (
        "The two models are ranked apart since they differ by more than the holds: where nothing "
        f"is held, the tracking error is {short(float(np.median(by['none'])))} mm (median; up to "
        f"{short(max(by['none']))}) without Coriolis compensation and "
        f"{short(float(np.median(by['full'])))} mm with it (up to {short(worst[METRIC])}, "
        f"{worst['case']})."
    )
    return paragraph(text)
