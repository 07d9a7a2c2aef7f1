"""The hold that knows the model, with the mechanism at the graphics rate, against shipped holds.

    python -m studies.model_hold results/model

Every method runs on the same fresh draws of hands (SEED on, of which no choice was made) on each
linkage of the study of the mismatch, with Coriolis compensation and ideal sensing. Cells, in which
the rates and gains are those of below; the oracle has the mechanism at 512 Hz, so that nothing of
it is held. Limits are those of `advise`. Writes README.md, runs.csv and model.png.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.search.acceptance import AcceptanceLimits, judged_numbers
from hapticlink.analysis.search.settings import EARLY, HOLDS
from hapticlink.analysis.search.settings import GAINS as NAMED
from hapticlink.analysis.sweep import table
from hapticlink.analysis.sweep.job import Job, job
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.analysis.sweep.run_sweep import Means, sweep
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.results.numbers import short
from studies.draw import BLUE, GREY, ORANGE, panels, save
from studies.mismatch.cases import LINKAGES, Case
from studies.mismatch.measure import rounded

SEED = 44001
DRAWS = 3
"""The first was run alone; two more for the spread, with nothing changed between."""
HANDS = ("constant", "profile", "arm 300")
RATES = ("10", "20", "30", "10..50")
FIRM = (
    "controller.teleoperation.stiffness=[400, 400, 0.4]",
    "controller.teleoperation.damping=[40, 40, 0.04]",
)
GAINS = {"soft": NAMED["soft"], "medium": NAMED["medium"], "firm": FIRM}
SHIPPED = ("zoh", "foh", "second-order", "passive")
METHODS = (*SHIPPED, "model")
ORACLE = "oracle"
WORSE = 1.05
"""Ratio of errors from which on a method counts as worse."""
OTHERWISE = {
    "encoders and observer": ("sensing=encoders",),
    "no Coriolis compensation": ("controller.bias=none",),
    "result after half a frame": ("computing_time=0.025",),
}
"""What the grid leaves out, tried at OTHER_RATE on the first draw of each linkage and hand."""
OTHER_RATE = "20"
ACCOUNTS = {
    "`passive` F_drift": ("holds.virtual_mechanism.F_drift=passive",),
    "`passive` F_hand": ("holds.virtual_mechanism.F_hand=passive",),
}
"""Forces on the mechanism with the account of another hold, tried in all cells of `model`."""
COMPARED = ("foh", "passive", "model")
Cell = tuple[str, str, str]
"""Case, rate and gains."""


def cases() -> list[Case]:
    """The draws, DRAWS of each linkage in each hand, each with a seed of its own."""
    kinds = [kind for _ in range(DRAWS) for kind in product(LINKAGES, HANDS)]
    return [Case(*kind, False, SEED + i) for i, kind in enumerate(kinds)]


def others() -> Iterator[Job]:
    """The runs of OTHERWISE; without a computing time those of the grid are compared with it."""
    for case, (name, options) in product(cases()[: len(LINKAGES) * len(HANDS)], OTHERWISE.items()):
        for gains, method in product(GAINS, COMPARED):
            if method == "model" or "computing" not in options[0]:
                yield _run(case, method, gains, OTHER_RATE, name, options)


def accounted() -> Iterator[Job]:
    """The runs of ACCOUNTS."""
    for case, gains, rate in product(cases(), GAINS, RATES):
        for name, options in ACCOUNTS.items():
            yield _run(case, "model", gains, rate, name, options)


def runs() -> Iterator[Job]:
    """All runs, case by case; the oracle's has no rate, and is taken at the first one."""
    for case, gains, rate in product(cases(), GAINS, RATES):
        for method in (*METHODS, *((ORACLE,) if rate == RATES[0] else ())):
            yield _run(case, method, gains, rate)


def _run(
    case: Case, method: str, gains: str, rate: str, name: str = "", otherwise: Sequence[str] = ()
) -> Job:
    options = [*case.options, *GAINS[gains], "controller.bias=full", "sensing=ideal", *otherwise]
    options.append("directions_from=mechanism")
    varies = f"{{ min = 10, max = 50, seed = {case.seed} }}"
    options.append(f"graphics.rate={varies if '..' in rate else rate}")
    if method != ORACLE:
        options += ["mechanism_at=graphics", *HOLDS[EARLY if method == "model" else method]]
    point = {"case": case.name, "linkage": case.linkage, "hand": case.hand, "seed": str(case.seed)}
    point |= {"method": method, "gains": gains, "rate": rate, "otherwise": name}
    return job(case.scene, options, point)


def _measure(experiment: Experiment) -> Row:
    return judged_numbers(experiment.results)


class Found:
    """The runs by cell and method: errors (mm), and which are within the limits."""

    def __init__(self, rows: Iterable[Row]) -> None:
        device = open_scene.load("closed-loop").device
        assert device is not None
        limits = AcceptanceLimits.of(device)
        self.error: dict[Cell, dict[str, float]] = {}
        for row in rows:
            value = float(row[METRIC]) if not limits.why_not(row) else np.inf
            for rate in RATES if row["method"] == ORACLE else (row["rate"],):
                name = f"{row['case']}, seed {row['seed']}"
                of = self.error.setdefault((name, rate, row["gains"]), {})
                of[row["method"]] = value

    def within(self, method: str, cells: Iterable[Cell]) -> int:
        return sum(np.isfinite(self.error[cell][method]) for cell in cells)

    def best(self, case: str, rate: str, methods: Iterable[str]) -> float:
        """The least error over gains and methods, infinite where none is within the limits."""
        every = (self.error[case, rate, g][m] for g, m in product(GAINS, methods))
        return float(min(every))

    @property
    def kept(self) -> list[Cell]:
        """The cells in which the oracle keeps the limits."""
        return [cell for cell, of in self.error.items() if np.isfinite(of[ORACLE])]

    def ratios(self, rate: str) -> list[tuple[float, str]]:
        """Best shipped over best `model` of each case, where one of both is within the limits."""
        names = {case for case, *_ in self.error}
        found = []
        for case in sorted(names):
            shipped, own = (self.best(case, rate, m) for m in (SHIPPED, ("model",)))
            if np.isfinite(min(shipped, own)):
                found.append((float(np.inf if np.isinf(shipped) else shipped / own), case))
        return found


def _quartiles(values: Sequence[float]) -> str:
    if not values:
        return ""
    return ", ".join(
        short(float(q)) for q in np.quantile(values, (0, 0.25, 0.5, 0.75, 1), method="nearest")
    )


def page(
    found: Found, elsewhere: Mapping[str, Found], accounts: Mapping[str, Found]
) -> Iterator[str]:
    """The lines of README.md."""
    yield "# The hold that knows the model, mechanism at the graphics rate"
    yield f"`python -m studies.model_hold results/model`: {len(cases())} draws from seed {SEED} on"
    ratios = {rate: found.ratios(rate) for rate in RATES}
    every = [value for each in ratios.values() for value, _ in each]
    worse = [(v, case, rate) for rate, each in ratios.items() for v, case in each if v < 1 / WORSE]
    yield "## Where it loses"
    yield (
        f"With the best gains of each, `model` is worse than the best of {', '.join(SHIPPED)} by "
        f"more than 5 % in {len(worse)} of {len(every)} (draw, rate):"
    )
    told = (f"- {c} at {r} Hz: {short(v) if v else 'none within the limits'}" for v, c, r in worse)
    yield "\n".join(sorted(told)) or "none"
    by_gains = []
    for gains in GAINS:
        pairs = _pairs(found, gains)
        lost = sum(a < b / WORSE for a, b in pairs)
        by_gains.append(f"{gains} {lost} of {len(pairs)}")
    both = "With the same gains, of the cells in which both are within the limits"
    yield f"{both}: {', '.join(by_gains)}."
    yield f"## Outside of its premises, at {OTHER_RATE} Hz"
    yield (
        "Draws of the first of each hand within the limits with some gains, and the median of "
        "their least errors (mm):"
    )
    draws = {case for each in elsewhere.values() for case, *_ in each.error}
    settings = {"as in the grid": found, **elsewhere}
    rows = (_elsewhere(name, of, draws) for name, of in settings.items())
    yield _table(("", *COMPARED), rows)
    kept = found.kept
    yield "## With an energy account"
    yield (
        "With the passivity observer and controller of the hold `passive` in the place of `mid` "
        f"(F_drift) or `reaction` (F_hand), of the {len(kept)} cells in which the oracle is within "
        "the limits; errors relative to those of `model` where both are:"
    )
    yield _table(
        ("", "within", "gained", "lost", "relative error: least, quartiles, largest"),
        (_account(name, of, found, kept) for name, of in accounts.items()),
    )
    yield "## Within the limits"
    yield _table(
        ("gains, Hz", "oracle", *METHODS),
        (
            (
                f"{g}, {r}",
                *(
                    str(found.within(m, [c for c in kept if c[1:] == (r, g)]))
                    for m in (ORACLE, *METHODS)
                ),
            )
            for g, r in product(GAINS, RATES)
        ),
    )
    counts = ", ".join(f"`{m}` {found.within(m, kept)}" for m in METHODS)
    yield f"Of the {len(kept)} cells in which the oracle is within the limits: {counts}."
    for hand in HANDS:
        of = [cell for cell in kept if f", {hand}," in cell[0]]
        shares = ", ".join(f"`{m}` {found.within(m, of)}" for m in METHODS)
        yield f"Of the {len(of)} of these in hands `{hand}`: {shares}."
    yield "## Errors"
    yield "Median of the largest distance of handle and point (mm) where the limits are kept:"
    yield _table(("gains, Hz", ORACLE, *METHODS), _errors(found))
    yield "## With the best gains"
    yield (
        "Best shipped over best `model` by draw: least, quartiles, largest (inf: no shipped hold "
        "keeps the limits, 0: `model` does not)."
    )
    by_rate = [(r, str(len(each)), _quartiles([v for v, _ in each])) for r, each in ratios.items()]
    yield _table(("Hz", "draws", "ratio"), [*by_rate, ("all", str(len(every)), _quartiles(every))])
    yield "![Errors with the best gains, by rate](model.png)"
    yield (
        "[theorem.csv](theorem.csv) and [orders.csv](orders.csv) are of the [theorem](../../docs/"
        "model-hold.md), by `python -m studies.model_theorem`; [growth.csv](growth.csv) has growth "
        "rates by the lifted map and of runs, by `python -m studies.model_growth`."
    )


def _elsewhere(name: str, found: Found, draws: Iterable[str]) -> tuple[str, ...]:
    """The row of a setting that the grid leaves out."""
    row = [name]
    for method in COMPARED:
        ran = any(method in of for of in found.error.values())
        every = [found.best(case, OTHER_RATE, [method]) for case in draws] if ran else []
        known = [value for value in every if np.isfinite(value)]
        row.append(
            f"{short(float(np.median(known)))} ({len(known)} of {len(every)})" if known else ""
        )
    return tuple(row)


def _account(name: str, of: Found, found: Found, kept: Iterable[Cell]) -> tuple[str, ...]:
    """The row of an account: which cells it gains and loses, and what it costs in the others."""
    pairs = [(of.error[cell]["model"], found.error[cell]["model"]) for cell in kept]
    both = [a / b for a, b in pairs if np.isfinite((a, b)).all()]
    within, without = (sum(np.isfinite(each)) for each in zip(*pairs, strict=True))
    counts = within, within - len(both), without - len(both)
    return (name, *map(str, counts), _quartiles(both))


def _pairs(found: Found, gains: str) -> list[tuple[float, float]]:
    """Errors of the best shipped hold and of `model` where both are within the limits."""
    each = (of for cell, of in found.error.items() if cell[2] == gains)
    pairs = ((min(of[m] for m in SHIPPED), of["model"]) for of in each)
    return [pair for pair in pairs if np.isfinite(pair).all()]


def _errors(found: Found) -> Iterator[tuple[str, ...]]:
    for gains, rate in product(GAINS, RATES):
        row = [f"{gains}, {rate}"]
        for method in (ORACLE, *METHODS):
            of = [e[method] for c, e in found.error.items() if c[1:] == (rate, gains)]
            known = [value for value in of if np.isfinite(value)]
            row.append(f"{short(float(np.median(known)))} ({len(known)})" if known else "")
        yield tuple(row)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def draw(found: Found, folder: Path) -> None:
    """The errors with the best gains by rate, each draw a point, medians as bars."""
    figure, (axes,) = panels(1, width=7.0, height=4.2)
    methods: Mapping[str, tuple[Any, str]] = {
        "best shipped": (SHIPPED, ORANGE),
        "model": (("model",), BLUE),
        "mechanism at 512 Hz": ((ORACLE,), GREY),
    }
    names = sorted({case for case, *_ in found.error})
    for i, (label, (of, colour)) in enumerate(methods.items()):
        for x, rate in enumerate(RATES):
            values = [found.best(case, rate, of) for case in names]
            known = [v for v in values if np.isfinite(v)]
            at = x + 0.27 * (i - 1)
            spread = np.linspace(-0.08, 0.08, max(len(known), 1))
            axes.plot(at + spread[: len(known)], known, ".", color=colour, alpha=0.6)
            if known:
                axes.plot(
                    [at - 0.1, at + 0.1],
                    [np.median(known)] * 2,
                    color=colour,
                    lw=2.5,
                    label=label if x == 0 else None,
                )
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xticks(range(len(RATES)), RATES)
    axes.set_xlabel("graphics rate (Hz)")
    axes.set_ylabel("largest distance of handle and point (mm)")
    ratio = float(np.median([value for rate in RATES for value, _ in found.ratios(rate)]))
    axes.set_title(
        f"The mechanism at the graphics rate: the hold model has 1/{short(ratio)} of the\n"
        "error of the best shipped hold (median over draws, with the best gains of each)",
        fontsize="medium",
    )
    axes.set_ylim(top=600)
    axes.legend(fontsize="small", ncols=3)
    save(figure, folder, "model.png")


def study(folder: Path, room: Path, processes: int = 2) -> None:
    """Runs what has no row in `room` yet, and writes the results to `folder`."""
    folders.ensure(folder)
    every = list(runs())

    def tell(done: int, of: int) -> None:
        if done % max(1, of // 100) == 0:
            print(f"{done} of {of}", flush=True)

    further = [*others(), *accounted()]
    rows = sweep([*every, *further], Means(room, processes, tell), _measure)
    kept = ("end", METRIC, "theta_max_rad", "port_peak_J", "hand_work_J")
    columns = ("case", "seed", "method", "gains", "rate", "otherwise", *kept)
    table.write(
        folder / "runs.csv", [{k: rounded(row).get(k, "") for k in columns} for row in rows]
    )
    found = Found(rows[: len(every)])
    elsewhere, accounts = (
        {name: Found(r for r in rows if r["otherwise"] == name) for name in names}
        for names in (OTHERWISE, ACCOUNTS)
    )
    draw(found, folder)
    lines = "\n\n".join(page(found, elsewhere, accounts))
    (folder / "README.md").write_text(f"{lines}\n", encoding="utf-8")
