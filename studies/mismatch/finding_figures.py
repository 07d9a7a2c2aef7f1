"""The figures of the study, each with its finding in its title and in a sentence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import product
from pathlib import Path
from textwrap import fill

import numpy as np

from hapticlink.analysis.sweep.row import METRIC, Row
from studies.mismatch.design import CONTINUOUS, DIRECT, MOBILITY, REFERENCE, mapped
from studies.mismatch.figures import Panel, Square, maps, short
from studies.mismatch.findings import COMPENSATION, Found, both
from studies.mismatch.measure import COUPLING, KICK, MARGIN, RUN, draw, stable
from studies.mismatch.method_choice import LEAST, SHARE, energy, margin, within
from studies.mismatch.methods import (
    BIAS,
    COLUMNS,
    COMPARED,
    GAINS,
    HOLDS,
    INTEGRATORS,
    OF_MATRICES,
    RATES,
    REPORT,
    Method,
)

UNSTABLE = "unstable in some draw; number of stable draws"
Rows = Mapping[str, Row]


def sections(folder: Path, found: Found) -> Iterator[str]:
    """The part of the page that says why; writes the figures."""
    yield "## Why"
    for part in (_gains, _tracking, _energy, _margins, _integrators, _mobility):
        yield from part(folder, found)
    yield _modelling(found)


def _rows(found: Found, arrangement: str, bias: str, rate: str, method: Method) -> Rows:
    return found.cells[arrangement, bias, rate][method]


def _all_stable(rows: Iterable[Row]) -> bool:
    return all(map(stable, rows))


def _square(rows: Rows, value: Callable[[Row], float], of: Callable[..., float]) -> Square:
    """A number of the draws; where one is unstable, how many are not."""
    if not _all_stable(rows.values()):
        return Square(None, f"{sum(map(stable, rows.values()))}/{len(rows)}")
    return Square(float(of([value(r) for r in rows.values()])))


def _by_hold(
    found: Found, arrangement: str, value: Callable[[Row], float], of: Callable[..., float]
) -> list[Panel]:
    """Panels by model: holds against rates, with the gains that were taken for the cell."""
    panels: list[Panel] = []
    for bias in BIAS:
        squares: dict[str, dict[str, Square]] = {}
        holds = OF_MATRICES if arrangement == MOBILITY else HOLDS
        for hold, rate in product(holds, COLUMNS):
            taken = found.methods[arrangement, bias, rate]
            rows = _rows(found, arrangement, bias, rate, Method(hold, taken.gains))
            advised = found.advice[arrangement, bias, rate].method
            marked = advised is not None and advised.hold == hold
            squares.setdefault(hold, {})[rate] = _square(rows, value, of)._replace(marked=marked)
        panels.append((COMPENSATION[bias], squares))
    return panels


def _text(text: str, figure: str, alt: str) -> str:
    return f"{fill(text, 108, break_on_hyphens=False)}\n\n![{alt}]({figure})"


def _gains(folder: Path, found: Found) -> Iterator[str]:
    panels: list[Panel] = []
    for bias in BIAS:
        squares = {g: {r: Square(_share(found, bias, g, r)) for r in COLUMNS} for g in GAINS}
        panels.append((COMPENSATION[bias], squares))
    low = [short(_share(found, "none", g, "10")) for g in GAINS]
    title = (
        f"Gains decide before holds: at 10 Hz, without Coriolis compensation, {low[0]} % of the "
        f"runs keep the limits with soft gains, {low[1]} % with medium, {low[2]} % with stiff ones"
    )
    unit = "runs within the limits (%), all holds"
    made = maps(folder, "gains.png", title, panels, unit, "not tried", scale="linear")
    yield _text(f"{title}.", made, "Runs within the limits by gains and rate")


def _share(found: Found, bias: str, gains: str, rate: str) -> float | None:
    """Runs within the limits (%), over holds and draws; None where there are none."""
    cell = found.cells[DIRECT, bias, rate]
    rows = [r for hold in HOLDS for r in cell.get(Method(hold, gains), {}).values()]
    return 100 * float(np.mean([within(r) for r in rows])) if rows else None


def _tracking(folder: Path, found: Found) -> Iterator[str]:
    panels = _by_hold(found, DIRECT, lambda r: r[METRIC], np.median)
    cells = [(b, r) for b in BIAS for r in COLUMNS]
    first = sum(found.methods[DIRECT, b, r].hold == "zoh" for b, r in cells)
    none = [r for r in COLUMNS if all(by[r].value is None for _, p in panels for by in p.values())]
    title = f"zoh is what the answer takes in {first} of {len(cells)} columns"
    if none:
        title += f"; at {both(none)} Hz no hold is stable in every draw"
    unit = "largest |x_S - x_D| (mm), median"
    made = maps(folder, "tracking.png", title, panels, unit, UNSTABLE, "advised")
    text = (
        f"{title}. Each column has the gains that the answer takes for it. `foh` has a smaller "
        f"median than `zoh` in {_fewer(panels)} columns in which both are stable in every draw."
    )
    yield _text(text, made, "Tracking error by hold and rate")


def _fewer(panels: Iterable[Panel]) -> str:
    """In how many columns `foh` has a smaller number than `zoh`, of those with both."""
    both_known = [
        (foh, zoh)
        for _, squares in panels
        for rate in COLUMNS
        if (foh := squares["foh"][rate].value) is not None
        and (zoh := squares["zoh"][rate].value) is not None
    ]
    return f"{sum(foh < zoh for foh, zoh in both_known)} of {len(both_known)}"


def _energy(folder: Path, found: Found) -> Iterator[str]:
    panels = _by_hold(found, DIRECT, lambda r: 100 * energy(r), np.max)
    squares = [s for _, p in panels for by in p.values() for s in by.values()]
    known = [s.value for s in squares if s.value is not None]
    over = sum(v > 100 for v in known)
    title = (
        f"{over} of {len(known)} combinations that are stable in every draw generate more "
        "energy at the user's port than is allowed"
    )
    unit = "peak generated (% of what is allowed)"
    shown = [
        (h, {n: {r: _at_least(s) for r, s in by.items()} for n, by in p.items()}) for h, p in panels
    ]
    made = maps(folder, "energy.png", title, shown, unit, UNSTABLE, "advised")
    text = (
        f"{title}: {SHARE:.0%} of the hand's work, and at least {1e3 * LEAST:g} mJ. `foh` "
        f"generates less than `zoh` in {_fewer(panels)} columns. A stable run is not yet a passive "
        "one, which tracking errors do not show."
    )
    yield _text(text, made, "Energy at the user's port by hold and rate")


def _at_least(square: Square) -> Square:
    """A square whose number fits a logarithmic scale."""
    return square if square.value is None else square._replace(value=max(square.value, 1.0))


def _margins(folder: Path, found: Found) -> Iterator[str]:
    holds = [h for h in HOLDS if mapped(Method(h, "soft"))]
    panels: list[Panel] = []
    for gains in GAINS:
        squares: dict[str, dict[str, Square]] = {}
        for hold, rate in product(holds, RATES):
            least = margin(found.margins, DIRECT, Method(hold, gains), rate)
            square = Square(least, marked=least is not None and least < 0)
            squares.setdefault(hold, {})[rate] = square
        panels.append((f"{gains} gains", squares))
    every = [s for _, p in panels for by in p.values() for s in by.values()]
    bad = sum(s.marked for s in every)
    title = (
        f"At rest in an arm of 300 N/m, {bad} of {len(every)} combinations are unstable on "
        "some linkage"
    )
    unit = "margin (1/s), colours end at 20"
    made = maps(
        folder, "margins.png", title, panels, unit, "no equilibrium found", "unstable", "signed"
    )
    yield _text(f"{title}. {_signs(found)}", made, "Stability margin by hold, rate and gains")


def _signs(found: Found) -> str:
    """Whether runs agree with the maps, and where not."""
    rows = [r for by in found.margins.values() for r in by.values() if MARGIN in r]
    wrong = [r for r in rows if r["verdict"] != r[RUN]]
    text = (
        f"Whether a run decays after a kick of {KICK:g} rad/s is as the map says in "
        f"{len(rows) - len(wrong)} of {len(rows)} scenes at rest; growth that saturated motors end "
        "in a limit cycle is no decay"
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
    ratios: dict[str, list[float]] = {i: [] for i in INTEGRATORS}
    squares: dict[str, dict[str, Square]] = {}
    for hold, integrator, rate in product(COMPARED, INTEGRATORS, COLUMNS):
        rows = _rows(found, DIRECT, "none", rate, Method(hold, "medium", integrator))
        by_rk4 = _rows(found, DIRECT, "none", rate, Method(hold, "medium"))
        ratios[integrator] += [
            rows[c][METRIC] / by_rk4[c][METRIC]
            for c in rows
            if stable(rows[c]) and stable(by_rk4[c])
        ]
        square = _square(rows, lambda r: r[METRIC], np.median)
        squares.setdefault(f"{hold}; {integrator}", {})[rate] = square
    others = [i for i in INTEGRATORS if i != "rk4"]
    middle = {i: float(np.median(ratios[i])) for i in others if ratios[i]}
    stated = ", ".join(f"{short(v)} with {i}" for i, v in middle.items())
    title = f"Tracking error relative to rk4 with the same hold and medium gains: {stated}"
    unit = "largest |x_S - x_D| (mm), median"
    panels: list[Panel] = [(COMPENSATION["none"], squares)]
    made = maps(folder, "integrators.png", title, panels, unit, UNSTABLE)
    quarters = "; ".join(
        f"{i} {' to '.join(short(q) for q in np.quantile(ratios[i], [0.25, 0.75]))}" for i in middle
    )
    sound = [(name, square) for name, by in squares.items() for square in by.values()]
    counts = {i: sum(s.value is not None for n, s in sound if n.endswith(i)) for i in INTEGRATORS}
    kept = ", ".join(f"{count} with {i}" for i, count in counts.items())
    text = (
        f"{title} (medians within draws; quartiles {quarters}). Of {len(COMPARED) * len(COLUMNS)} "
        f"cells, stable in every draw: {kept}. The passive midpoint rule makes no energy of its "
        "own; what the holds make is not its matter."
    )
    yield _text(text, made, "Tracking error by integrator")


def _mobility(folder: Path, found: Found) -> Iterator[str]:
    panels = _by_hold(found, MOBILITY, lambda r: r[COUPLING], np.median)
    ratios = []
    for (_, squares), rate in product(panels, COLUMNS):
        values = [v for by in squares.values() if (v := by[rate].value) is not None]
        if own := squares["zoh"][rate].value:
            ratios.append(min(values) / own)
    gain = 100 * (1 - float(np.median(ratios))) if ratios else float("nan")
    title = (
        "With Lambda^-1 and P_c held, the best hold of a rate moves the handle off by "
        f"{gain:.0f} % less than zoh"
    )
    unit = "handle off (mm), median"
    made = maps(folder, "mobility.png", title, panels, unit, UNSTABLE, "advised")
    text = (
        f"{title} (median of the columns). It is the distance from the continuous run within 1 s. "
        "Each column has the gains that the answer takes for it."
    )
    yield _text(f"{text}{_lost(found)}", made, "Coupling error with Lambda^-1 held")


def _lost(found: Found) -> str:
    """The draws that no hold and no rate keeps stable at the report's gains, and whether they are
    where nothing is held."""
    every = [
        _rows(found, MOBILITY, bias, rate, Method(hold, REPORT))
        for bias, rate, hold in product(BIAS, COLUMNS, OF_MATRICES)
    ]
    lost = [name for name in every[0] if not any(stable(rows[name]) for rows in every)]
    if not lost:
        return ""
    by_case = Counter(every[0][name]["case"] for name in lost)
    where = "; ".join(f"{case} ({n})" for case, n in by_case.items())
    alone = [r for r in found.runs if r["arrangement"] == CONTINUOUS and draw(r) in lost]
    sound = sum(stable(r) for r in alone if r["rate"] == str(REFERENCE))
    return (
        f" With the report's gains, {len(lost)} of {len(every[0])} draws are unstable with every "
        f"hold at every graphics rate: {where}. Of the same blocks at {REFERENCE} Hz {sound} of "
        f"{len(lost) * len(BIAS)} runs are stable: where these are, it is not the graphics rate, "
        "but 512 Hz that is too slow for these gains."
    )


def _modelling(found: Found) -> str:
    """What leaving out Coriolis and centrifugal terms costs where nothing is held."""
    rows = [r for r in found.runs if r["arrangement"] == CONTINUOUS and r["rate"] == str(REFERENCE)]
    by = {b: [r[METRIC] for r in rows if r["bias"] == b] for b in BIAS}
    worst = max((r for r in rows if r["bias"] == "full"), key=lambda r: r[METRIC])
    text = (
        "The two models are ranked apart since they differ by more than the holds: where nothing "
        f"is held, the tracking error is {short(float(np.median(by['none'])))} mm (median; up to "
        f"{short(max(by['none']))}) without Coriolis compensation and "
        f"{short(float(np.median(by['full'])))} mm with it (up to {short(worst[METRIC])}, "
        f"{worst['case']})."
    )
    return fill(text, 108, break_on_hyphens=False)
