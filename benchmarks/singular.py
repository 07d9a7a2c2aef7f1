"""Tip error after motion through singular poses, over many rates, since it depends on how close a
step comes to the pose.

N-four-bar (IFToMM A02) of two windows, its ground line turned off the axes of the frame, under
projection: the tip after 10 s against the closed form, at every seventh rate from 400 to 2400 Hz,
with one mu for all right-hand sides and with each its own
(`components/dynamics/closed_loop_solver.py`).
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks import code_version, mechanisms
from benchmarks.our_mechanism import Ours
from benchmarks.page import Progress, table
from benchmarks.rows import Rows
from hapticlink.components.dynamics import closed_loop_solver, projection
from hapticlink.components.specs.linkage import Linkage, Mechanism
from hapticlink.components.specs.quantities import in_plane
from studies import draw

N, END, TURN = 2, 10.0, math.radians(30)
RATES = range(400, 2401, 7)
LOST = 0.1  # m
OWN = "rk4, each its own"
MUS: dict[str, tuple[str, float | None]] = {
    "rk4, 1e-8 for all": ("rk4", 1e-8),
    "rk4, 1e-13 for all": ("rk4", 1e-13),
    OWN: ("rk4", None),
    "dormand-prince-8, each its own": ("dormand-prince-8", None),
}
COLUMNS = ("mu", "rate", "error_m")
COLOURS = dict(zip(MUS, ("#8a8a8a", "#d1495b", "#1b6ca8", "#2a9d5c"), strict=True))


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes rates.csv and tip-error.png to `out`."""
    code_version.begin(out, ("rates.csv",))
    rows = Rows(out / "rates.csv", COLUMNS, keys=2)
    rates = RATES[::10] if quick else RATES
    exact = turned(mechanisms.n_four_bar_tip(N, END))
    for k, (name, (integrator, mu)) in enumerate(MUS.items()):
        advance = None
        for i, rate in enumerate(rates):
            progress(f"singular poses: {name}", k * len(rates) + i, len(MUS) * len(rates))
            if (name, rate) in rows:
                continue
            if advance is None:
                with one_mu(mu):
                    ours = Ours(
                        linkage(), (0.0, 0.0, 0.0), Mechanism(integrator=integrator), 1 / rate
                    )
                    advance = ours.advance(out / ".compiled")
            x = advance(ours.start.copy(), round(END * rate), 1 / rate)
            rows.add(name, rate, float(np.hypot(*(ours.outputs(x)["x"][:2] - exact))))
    wanted = {str(r) for r in rates}
    errors = {n: np.array([float(r["error_m"]) for r in rows.rows.values() if r["mu"] == n
                           and r["rate"] in wanted]) for n in MUS}  # fmt: skip
    figure(out, errors)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
    return page(errors, command)


def linkage() -> Linkage:
    """The benchmark's, turned as a whole, gravity too."""
    straight = mechanisms.n_four_bar(N)
    joints = tuple(
        replace(j, at_parent=turned(in_plane(j.at_parent))) if j.parent == "ground" else j
        for j in straight.joint
    )
    start = {
        name: float(angle) + TURN * name.startswith("pivot")  # type: ignore[arg-type]
        for name, angle in straight.start.items()
    }
    gravity = turned(in_plane(straight.gravity))
    return replace(straight, joint=joints, start=start, gravity=gravity)


def turned(at: tuple[float, float]) -> tuple[float, float]:
    c, s = math.cos(TURN), math.sin(TURN)
    return c * at[0] - s * at[1], s * at[0] + c * at[1]


@contextmanager
def one_mu(mu: float | None) -> Iterator[None]:
    """Within, every right-hand side of a step is solved with `mu`; None leaves each its own."""
    if mu is None:
        yield
        return
    solver = closed_loop_solver.ClosedLoopSolver
    with (
        patch.object(closed_loop_solver, "MU_FOLLOWING", mu),
        patch.object(projection, "MU", mu),
        patch.object(solver.__init__, "__defaults__", (mu, closed_loop_solver.PIVOT)),
    ):
        yield


def page(errors: dict[str, np.ndarray], command: str) -> str:
    own = max(e.max() for name, e in errors.items() if name.endswith("each its own"))
    one = max(e.max() for name, e in errors.items() if name.endswith("for all"))
    head = (
        "# Singular poses at many rates\n\nWith a shift mu of its own for each right-hand side "
        f"the tip errs by at most {own:.1g} m at every one of {len(errors[OWN])} rates;\nwith "
        f"one for all by up to {one:.1g} m.\n\n"
        "![Tip error over rates](tip-error.png)\n\n"
        f"N-four-bar of two windows, ground line turned by 30 degrees, projection: tip error after "
        f"{END:g} s at rates from\n{RATES[0]} to {RATES[-1]} Hz, m. It passes a singular pose ten "
        "times; how close a stage comes to one depends on the rate.\nMade by "
        f"`{command}`; every run is in [rates.csv](rates.csv), the method on\n"
        "[the page of the theory](../../docs/theory.md#mechanism).\n\n"
    )
    rows = []
    for name, e in errors.items():
        numbers = (np.median(e), np.quantile(e, 0.97), e.max())
        lost = f"{int((e > LOST).sum())} of {len(e)}"
        rows.append((name, *(f"{number:.1e}" for number in numbers), lost))
    heads = "integrator, mu | median | 97 % below | worst | branch lost"
    return head + "\n".join(table(heads, "lrrrr", rows)) + "\n"


def figure(folder: Path, errors: dict[str, np.ndarray]) -> None:
    drawn, (axes,) = draw.panels(1, width=6.4, height=4.2)
    for name, e in errors.items():
        share = 100 * np.arange(1, len(e) + 1) / len(e)
        axes.step(np.sort(e), share, where="post", color=COLOURS[name], label=name)
    axes.set(xscale="log", xlabel="tip error after 10 s (m)", ylabel="rates with less (%)")
    axes.set_title(
        f"rk4, each right-hand side its own mu: at most {errors[OWN].max():.1g} m at any of "
        f"{len(errors[OWN])} rates",
        fontsize="medium",
    )
    axes.legend(loc="lower right")
    draw.save(drawn, folder, "tip-error.png")
