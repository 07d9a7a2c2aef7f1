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
from studies.report.report_page import Entry, Runs, command

SCENES = {"enclosure": draw.BLUE, "obstacles": draw.ORANGE, "push-disc": draw.GREEN}
RATES = (10, 20, 30, 60)
TOUCH = 0.05
"""N of F_env from which on a sample counts as contact."""
SHOWN = "graphics.rate=30"


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    ratios = {
        scene: np.array([ratio(runs(scene, f"graphics.rate={rate}")) for rate in RATES])
        for scene in SCENES
    }
    figure, (traces, quotients) = draw.panels(2, height=4.4)
    trace(traces, runs("enclosure", SHOWN))
    for scene, colour in SCENES.items():
        middle, worst = ratios[scene].T
        quotients.loglog(RATES, 100 * middle, "o-", color=colour, label=f"{scene}, median")
        quotients.loglog(RATES, 100 * worst, "^--", color=colour, label=f"{scene}, at the peaks")
    quotients.axhline(100.0, color=draw.GREY, linewidth=0.8)
    quotients.set(xlabel="graphics rate (Hz)", ylabel="F_drift over F_env in contact (%)")
    quotients.set_xticks(RATES, [str(rate) for rate in RATES], minor=False)
    quotients.minorticks_off()
    quotients.set_title("small where the hand presses, not at an impact", fontsize="medium")
    figure.legend(
        *quotients.get_legend_handles_labels(), loc="outside lower center", ncols=3,
        fontsize="small",
    )  # fmt: skip
    name = draw.save(figure, folder, "figure_4_6.png")
    found = "; ".join(
        f"`{scene}`: {_range(100 * ratios[scene][:, 0])} % of F_env in the median of a contact, "
        f"{_range(100 * ratios[scene][:, 1])} % at its peaks"
        for scene in SCENES
    )
    yield Entry(
        "Figure 4.6, the coupling at collision",
        name,
        "F_drift needs to be small compared to F_env and F_h, such that the user feels the "
        "contact and not the coupling (4.2.3)",
        f"it is where the hand rests against a wall, and not at impacts or against what moves: "
        f"{found} (largest F_drift over largest F_env, {RATES[0]} to {RATES[-1]} Hz)",
        command("enclosure", SHOWN),
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
    axes.set_title("enclosure at 30 Hz", fontsize="medium")
    axes.legend(fontsize="small")


def _range(values: Vector) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"
