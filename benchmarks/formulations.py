"""The three ways of section B.2 to simulate a closed loop, beside each other: error, operations and
time over random five-bars."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from benchmarks import code_version
from benchmarks.five_bar import NEWTON, PAIRS, FiveBar
from benchmarks.our_mechanism import Ours, compiled
from benchmarks.page import Progress, table
from benchmarks.rows import Rows
from hapticlink.components.specs.linkage import Mechanism
from studies import draw

SEED, END, RATE = 1, 2.0, 512
METHODS = {
    "multipliers, Baumgarte": "#d1495b",
    "multipliers, projection": "#1b6ca8",
    "coordinate partitioning": "#2a9d5c",
    "symbolic embedding": "#8a6fb0",
}
STABILIZATIONS: tuple[Literal["baumgarte", "projection"], ...] = ("baumgarte", "projection")
"""Of the first two methods."""
UNKNOWNS = dict(zip(METHODS, ("n + m = 6", "n + m = 6", "n - m = 2", "n - m = 2"), strict=True))
COLUMNS = ("case", "method", "straightness", "error_mm", "operations", "us_a_step")
LOST = 10.0  # mm
SAME = 1e-7  # rad by which references of two tolerances may differ


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes cases.csv and formulations.png to `out`."""
    code_version.begin(out, ("cases.csv",))
    rows = Rows(out / "cases.csv", COLUMNS, keys=2)
    measure(rows, 6 if quick else 60, out / ".compiled", progress)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
    return page(out, rows, command)


def cases(count: int) -> Iterator[tuple[int, FiveBar, np.ndarray]]:
    """Number, five-bar and closed start (q, qd) of random cases, away from singular poses."""
    rng = np.random.default_rng(SEED)
    made = 0
    while made < count:
        lengths = rng.uniform(0.02, 0.06, 4)
        masses = rng.uniform(0.2, 1.0, 4)
        shoulders, side = rng.uniform(-np.pi, np.pi, 2), rng.choice([-1.0, 1.0])
        direction = rng.uniform(-np.pi, np.pi)
        wrench = (0.5 * float(np.cos(direction)), 0.5 * float(np.sin(direction)), 0.0)
        bar = FiveBar(
            tuple(lengths), tuple(masses), tuple(masses * lengths**2 / 12 + 1e-4), wrench
        )  # fmt: skip
        x = np.zeros(8)
        x[[0, 2, 4, 6]] = [*shoulders, *rng.uniform(-3.0, 3.0, 2)]
        start = np.concatenate([np.array(v).ravel() for v in bar.embedded(side)(x[:4], x[4:], 0.0)])
        if np.isfinite(start).all() and bar.straightness(start[None, :4])[0] > 0.2:
            yield made, bar, start
            made += 1


def steps(
    bar: FiveBar, start: np.ndarray, folder: Path
) -> Iterator[tuple[str, int, Callable[..., np.ndarray], Callable[..., np.ndarray]]]:
    """Of each method name, operations of a step, (state, steps) -> state, and the same of which the
    time is taken: partitioning with the pair of dependent coordinates that it has at the start."""
    h = 1 / RATE
    for name, stabilization in zip(METHODS, STABILIZATIONS, strict=False):
        settings = Mechanism(integrator="rk4", stabilization=stabilization)
        ours = Ours(bar.linkage(start[:4], start[4:]), bar.wrench, settings, h)
        advance = ours.advance(folder)
        yield name, ours.component.step.n_instructions(), advance, advance
    x, u, p, t, size = (ca.MX.sym(n, k) for n, k in zip("xupth", (8, 6, 1, 1, 1), strict=True))

    def own(method: ca.Function) -> Callable[..., np.ndarray]:
        step = ca.Function("step", [x, u, p, t, size], [ca.vertcat(*method(x[:4], x[4:], size))])
        return compiled(step, np.zeros(6), np.zeros(1), h, folder)

    W = np.array(bar.tree(start[:4], start[4:])[2])
    pair = max(PAIRS, key=lambda pair: abs(np.linalg.det(W[:, pair])))
    one = bar.partitioned(pair)
    yield "coordinate partitioning", one.n_instructions(), own(bar.repartitioned()), own(one)
    embedded = bar.embedded(bar.side(start))
    advance = own(embedded)
    yield "symbolic embedding", embedded.n_instructions(), advance, advance


def measure(rows: Rows, count: int, folder: Path, progress: Progress) -> None:
    """A row for each case and method; cases whose own reference is not certain are left out."""
    every = RATE // 16
    times = np.arange(0, int(END * RATE) + 1, every) / RATE
    for case, bar, start in cases(count):
        progress("random five-bars", case, count)
        if all((case, name) in rows for name in METHODS) or (case, "left out") in rows:
            continue
        exact, check = (bar.reference(start, times, tol) for tol in (1e-12, 1e-11))
        straightness = float(bar.straightness(exact[:, :4]).min())
        if not np.abs(exact - check)[:, :4].max() < SAME:
            rows.add(case, "left out", straightness, np.nan, 0, np.nan)
            continue
        tip = _tip(bar, exact)
        for name, operations, advance, timed in steps(bar, start, folder):
            state, reached = start.copy(), [start.copy()]
            for _ in times[1:]:
                state = advance(state, every)
                reached.append(state.copy())
            error = np.hypot(*(_tip(bar, np.array(reached)) - tip).T)
            worst = 1e3 * float(error.max()) if np.isfinite(error).all() else np.inf
            spent = min(_seconds(timed, start) for _ in range(5))
            rows.add(case, name, straightness, worst, operations, 1e6 * spent)


def _tip(bar: FiveBar, states: np.ndarray) -> np.ndarray:
    """The operational point, (k, 2), of states (k, 8)."""
    first, second = states[:, 0], states[:, 0] + states[:, 1]
    l1, l2 = bar.lengths[:2]
    return np.stack([l1 * f(first) + l2 / 2 * f(second) for f in (np.cos, np.sin)], axis=1)


def _seconds(advance: Callable[..., np.ndarray], start: np.ndarray, count: int = 2000) -> float:
    """CPU time of a step at the start, with steps so small that the pose stays."""
    began = time.process_time()
    advance(start.copy(), count, 1e-9)
    return (time.process_time() - began) / count


def page(out: Path, rows: Rows, command: str) -> str:
    """Writes formulations.png."""
    kept = [r for r in rows.rows.values() if r["method"] in METHODS]
    by = {
        name: np.array([[float(r[c]) for c in COLUMNS[2:]] for r in kept if r["method"] == name])
        for name in METHODS
    }
    count, left = len(by["symbolic embedding"]), len(rows.rows) - len(kept)
    lost = {name: int((~(v[:, 1] < LOST)).sum()) for name, v in by.items()}
    near = np.median(by["symbolic embedding"][:, 0])
    cells = []
    for name, v in by.items():
        apart = (_quartiles(v[v[:, 0] >= near, 1]), _quartiles(v[v[:, 0] < near, 1]))
        costs = f"{np.median(v[:, 2]):.0f}", f"{np.median(v[:, 3]):.2f}"
        cells.append((name, UNKNOWNS[name], *apart, lost[name], *costs))
    heads = "formulation | unknowns | error, far | error, near | lost | operations | us a step"
    lines = "\n".join(table(heads, "llllrrr", cells))
    _figure(out, by, lost)
    projected, partitioned, embedded = (np.median(by[n][:, 3]) for n in list(METHODS)[1:])
    return f"""# Multipliers, partitioning and embedding

Of {count} random five-bars, run for {END:g} s at {RATE} Hz, symbolic embedding loses
{lost["symbolic embedding"]}, coordinate partitioning {lost["coordinate partitioning"]}, multipliers
{lost["multipliers, projection"]} with projection and {lost["multipliers, Baumgarte"]} with
Baumgarte's stabilisation. A step of the projection takes {projected:.2f} us, of partitioning
{partitioned:.2f}, of embedding {embedded:.2f}.

![Error over the distance from a singular pose](formulations.png)

The three categories of the report's section B.2, each by the classical Runge-Kutta method, in
compiled C: Lagrange multipliers as `mechanism.stabilization` has them; generalised coordinate
partitioning (Wehage and Haug, J. Mechanical Design 104 (1982), 247) with the pair of dependent
coordinates chosen anew at each step and {NEWTON} Newton iterations a stage (its time without that
choice, six determinants of two by two); embedding of the elbows as closed forms of the shoulders,
whose chart ends where links 2 and 4 are in line. Lengths of 20 to 60 mm, masses of 0.2 to 1 kg,
shoulders that start with up to 3 rad/s, a constant force of 0.5 N on the operational point, seed
{SEED}.

Error: largest distance (mm) of the operational point from DOP853 at a tolerance of 1e-12, median
(quartiles); lost: above {LOST:g} mm, or no number. Near and far: |sin| of the angle between links 2
and 4 gets below {near:.2f}, or not. {left} cases are left out, whose references at 1e-12 and 1e-11
differ by more than {SAME:g} rad. Operations are those of CasADi's graph of a step; time is that of
the processor, the least of five rounds of 2,000 steps, median over cases.

{lines}

Made by `{command}`; every case is in [cases.csv](cases.csv).
"""


def _figure(out: Path, by: dict[str, np.ndarray], lost: dict[str, int]) -> None:
    """The error over the distance from a singular pose."""
    drawn, (axes,) = draw.panels(1, width=7.0, height=4.4)
    for (name, colour), marker in zip(METHODS.items(), "osv^", strict=True):
        v = by[name]
        shown = np.where(v[:, 1] < LOST, v[:, 1], LOST)
        axes.scatter(v[:, 0], shown, s=18, color=colour, marker=marker, label=name, alpha=0.8)
    axes.axhline(LOST, color="#8a8a8a", linewidth=0.8)
    at = {"ha": "right", "va": "bottom", "xycoords": ("axes fraction", "data")}
    axes.annotate("lost", (0.99, LOST), color="#555555", **at)
    axes.set(xscale="log", yscale="log", ylabel="largest error of the operational point (mm)")
    axes.set_xlabel("least |sin| of the angle between links 2 and 4 along the motion")
    axes.set_title(
        f"Symbolic embedding loses {lost['symbolic embedding']} of "
        f"{len(by['symbolic embedding'])} five-bars, multipliers with projection "
        f"{lost['multipliers, projection']}",
        fontsize="medium",
    )
    axes.legend(loc="upper left", bbox_to_anchor=(0.01, 0.93))
    draw.save(drawn, out, "formulations.png")


def _quartiles(values: np.ndarray) -> str:
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75], method="lower")
    return f"{middle:.1g} ({low:.1g} to {high:.1g})"
