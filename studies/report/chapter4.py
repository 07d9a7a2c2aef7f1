"""Figure 4.6: the teleoperation controller at collision, where F_drift has to be small beside
F_env."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.signal_names import ENVIRONMENT_WRENCH
from hapticlink.orchestrator.results.read_results import Results
from studies import draw
from studies.report.report_page import Entry, Runs, command, premises

SCENES = {"enclosure": draw.BLUE, "obstacles": draw.ORANGE, "push-disc": draw.GREEN}
RATES = (10, 20, 30, 60)
TOUCH = 0.05
"""N of F_env from which on a sample counts as contact."""
SHOWN = "graphics.rate=30"
SMALL = 10
"""% of F_env below which F_drift counts as small."""
STATED = ("sensing=encoders", "mechanism.stabilization=baumgarte", "controller.bias=none")
SYSTEMS: dict[str, tuple[str, ...]] = {"as stated": STATED, "idealised": ()}


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    figure, (traces, *quotients) = draw.panels(3, height=4.4)
    trace(traces, runs("enclosure", *STATED, SHOWN))
    found, rests, medians = [], [], []
    for axis, (system, options) in zip(quotients, SYSTEMS.items(), strict=True):
        for scene, colour in SCENES.items():
            made = [runs(scene, *options, f"graphics.rate={rate}") for rate in RATES]
            middle, worst = 100 * np.array([ratio(results) for results in made]).T
            medians.append(middle.max())
            axis.loglog(RATES, middle, "o-", color=colour, label=f"{scene}, median")
            axis.loglog(RATES, worst, "^--", color=colour, label=f"{scene}, at the peaks")
            found.append(
                f"`{scene}` {system}: {_range(middle)} % of F_env in the median of a contact, "
                f"{_range(worst)} % at its peaks"
            )
        axis.axhline(100.0, color=draw.GREY, linewidth=0.8)
        axis.set(xlabel="graphics rate (Hz)", ylabel="F_drift over F_env in contact (%)")
        axis.set_xticks(RATES, [str(rate) for rate in RATES], minor=False)
        axis.minorticks_off()
        axis.set_title(f"{system}: F_drift over F_env", fontsize="medium")
        rests.append(premises(system, runs("enclosure", *options, SHOWN)))
    figure.legend(
        *quotients[0].get_legend_handles_labels(), loc="outside lower center", ncols=3,
        fontsize="small",
    )  # fmt: skip
    name = draw.save(figure, folder, "figure_4_6.png")
    small = sum(middle < SMALL for middle in medians)
    yield Entry(
        "Figure 4.6, the coupling at collision",
        f"F_drift stays below {SMALL} % of F_env in the median of a contact in {small} of "
        f"{len(medians)} cases",
        name,
        "F_drift needs to be small compared to F_env and F_h, such that the user feels the "
        "contact and not the coupling (4.2.3)",
        f"{small} of {len(medians)} cases have less than {SMALL} % in the median at all rates from "
        f"{RATES[0]} to {RATES[-1]} Hz; at the peaks largest F_drift over largest F_env: "
        f"{'; '.join(found)}",
        rests,
        f"{command('enclosure', *STATED, SHOWN)}; {command('enclosure', SHOWN)}",
    )


def forces(results: Results) -> tuple[Vector, Vector, Vector]:
    """Time (s), |F_drift| and |F_env| (N), moments left out, each (k,)."""
    table = results.haptics
    drift, contact = table["controller.F_drift"], table[ENVIRONMENT_WRENCH]
    return table["time"], np.hypot(*drift[:, :2].T), np.hypot(*contact[:, :2].T)


def ratio(results: Results) -> tuple[float, float]:
    """F_drift over F_env in contact: the median, and the quotient of the largest values."""
    _, drift, contact = forces(results)
    touching = contact > TOUCH
    drift, contact = drift[touching], contact[touching]
    return float(np.median(drift / contact)), float(drift.max() / contact.max())


def trace(axes: Any, results: Results) -> None:
    """F_drift and F_env over time."""
    time, drift, contact = forces(results)
    axes.plot(time, contact, color=draw.GREY, label="F_env, contact")
    axes.plot(time, drift, color=draw.BLUE, label="F_drift, coupling")
    axes.set(xlabel="time (s)", ylabel="force (N)")
    axes.set_title("enclosure as stated, 30 Hz", fontsize="medium")
    axes.legend(fontsize="small")


def _range(values: Vector) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"
