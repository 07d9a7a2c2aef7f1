"""Figures 3.3 and 3.4: the closure error without and with stabilisation."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from studies import draw
from studies.report import measures
from studies.report.report_page import Entry, Runs, command

SHORTEST_LINK = 0.0184  # m, l3 of Table 6.1
EULER = "mechanism.integrator=semi-implicit-euler"
PREMISES = ("the mechanism alone under the wrench of chapter 6, semi-implicit Euler at 512 Hz",)


def stabilised(kind: str) -> tuple[str, str]:
    """The options of figures 3.3 and 3.4."""
    return EULER, f"mechanism.stabilization={kind}"


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    made = {
        kind: runs("five-bar", *stabilised(kind)) for kind in ("none", "baumgarte", "projection")
    }
    time = made["none"].haptics["time"]
    error = {kind: measures.closure_gap(results) for kind, results in made.items()}
    worst = {kind: float(e.max()) for kind, e in error.items()}

    figure, (axis,) = draw.panels(1, width=6)
    axis.plot(time, 1e3 * error["none"], color=draw.BLUE)
    title = f"Without stabilisation the loop opens by {1e3 * worst['none']:.2g} mm in 3 s"
    axis.set(xlabel="time (s)", ylabel="closure error (mm)", title=title)
    yield Entry(
        "Figure 3.3, closure error without stabilisation",
        f"the loop opens by {1e3 * worst['none']:.2g} mm",
        draw.save(figure, folder, "figure_3_3.png"),
        "diverges from zero: hddot = 0 is marginally stable and numerical error drifts",
        f"grows to {1e3 * worst['none']:.2g} mm in 3 s, by the constraint equations of Appendix A "
        "at the recorded angles",
        PREMISES,
        command("five-bar", *stabilised("none")),
    )

    figure, (axis,) = draw.panels(1, width=6)
    floor = 1e-18  # a log axis has no zero
    for kind, label, colour in (
        ("none", "none", draw.GREY),
        ("baumgarte", "Baumgarte, dead beat", draw.BLUE),
        ("projection", "projection", draw.ORANGE),
    ):
        axis.semilogy(time, np.maximum(error[kind], floor), color=colour, label=label)
    title = f"Baumgarte holds the loop to {1e6 * worst['baumgarte']:.2g} um, projection to rounding"
    axis.set(xlabel="time (s)", ylabel="closure error (m)", title=title)
    axis.legend()
    share = worst["baumgarte"] / SHORTEST_LINK
    yield Entry(
        "Figure 3.4, closure error with Baumgarte stabilisation",
        f"the loop stays closed to {1e6 * worst['baumgarte']:.2g} um",
        draw.save(figure, folder, "figure_3_4.png"),
        "stays small with alpha, beta chosen to converge (neither is given)",
        f"at most {1e6 * worst['baumgarte']:.2g} um, {share:.1e} of the shortest link, with "
        f"alpha = 512 /s, beta = 1/2 (dead beat); projection {worst['projection']:.1e} m",
        PREMISES,
        command("five-bar", *stabilised("baumgarte")),
    )
