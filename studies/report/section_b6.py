"""Figures B.5 and B.6: the experiment with Table B.1, stiffness and impedance control."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator.results.read_results import Results
from studies import draw
from studies.report import measures
from studies.report.chapter6 import describe_end, describe_premises, path
from studies.report.report_page import Entry, Runs
from studies.report.systems import IDEAL_B6, OF_SECTION_B6, OFF, ON, STATED_B6


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    yield _stiffness(runs, folder)
    yield _impedance(runs, folder)


def _stiffness(runs: Runs, folder: Path) -> Entry:
    found = []
    for system in OF_SECTION_B6:
        results = system.run(runs, ON)
        by_count = measures.by_count(results)
        apart = tracking(results)[1].max()
        found.append(
            f"{system.name}: {measures.count(results).described}; at most {apart:.2g} mm apart; "
            f"|F_T| {by_count.wrench[1]:.2g} N RMS while the mechanism has two, "
            f"{by_count.wrench[0]:.2g} N otherwise; {describe_end(results)}"
        )
    apart, ideal = (tracking(s.run(runs, ON))[1].max() for s in (STATED_B6, IDEAL_B6))
    return Entry(
        "Figure B.5, joint constraints by stiffness control",
        f"the device follows within {apart:.2g} mm, idealised {ideal:.2g}",
        _draw(runs, ON, folder, "figure_b_5.png"),
        "at least one constraint throughout, two while the loop closure is active; the device "
        "follows the operational point; the constraint wrench is larger while two are active",
        "; ".join(found),
        describe_premises(runs, OF_SECTION_B6),
        "; ".join(system.command(ON) for system in OF_SECTION_B6),
    )


def _impedance(runs: Runs, folder: Path) -> Entry:
    found = []
    for system in OF_SECTION_B6:
        off, on = (system.run(runs, way) for way in (OFF, ON))
        gap, under = tracking(off)[1].max(), tracking(on)[1].max()
        found.append(
            f"{system.name}: {gap:.0f} mm apart, {gap / under:.0f} times more than under stiffness "
            f"control, {describe_end(off)}; {measures.count(off).described}"
        )
    off = STATED_B6.run(runs, OFF)
    return Entry(
        "Figure B.6, joint constraints by impedance control",
        f"{tracking(off)[1].max():.0f} mm apart, {describe_end(off)}",
        _draw(runs, OFF, folder, "figure_b_6.png"),
        "significant drift between the trajectories; ended after approximately 3 s, just after "
        "the loop closure constraint becomes active, before the device's workspace limit",
        "; ".join(found),
        describe_premises(runs, OF_SECTION_B6),
        "; ".join(system.command(OFF) for system in OF_SECTION_B6),
    )


def _draw(runs: Runs, way: str, folder: Path, name: str) -> str:
    columns = 3 if way == ON else 2
    figure, axes = draw.panels(columns, rows=len(OF_SECTION_B6), width=4.4, height=3.2)
    for system, row in zip(OF_SECTION_B6, axes.reshape(-1, columns), strict=True):
        results = system.run(runs, way)
        _count(row[0], results)
        row[0].set_ylabel(f"{system.name}\nconstrained directions")
        path(row[1], results)
        apart = tracking(results)[1].max()
        row[1].set_title(f"(b) apart by at most {apart:.3g} mm", fontsize="medium")
        if way == ON:
            _wrench(row[2], results)
    for axis in (axes[-columns], *axes[1:columns]):
        axis.legend(fontsize="small")
    return draw.save(figure, folder, name)


def _count(axis: Any, results: Results) -> None:
    haptics, graphics = results.haptics, results.graphics
    own = haptics["virtual_mechanism.n_constraints"]
    seen = graphics["virtual_environment.n_constraints"]
    if not results.record.scene["local_model"]:  # whose mechanism counts by the frames' matrices
        axis.step(haptics["time"], own, where="post", color=draw.GREY, label="mechanism")
    axis.step(graphics["time"], seen, where="post", color=draw.BLUE, label="frames")
    axis.set(xlabel="time (s)", yticks=[0, 1, 2, 3], ylim=(0, 3))
    axis.set_title(f"(a) two in {100 * np.mean(own >= 2):.0f} % of the time", fontsize="medium")


def _wrench(axis: Any, results: Results) -> None:
    time, force = results.haptics["time"], results.haptics["controller.F_constraint"]
    for i, (label, colour) in enumerate((("x", draw.BLUE), ("y", draw.ORANGE))):
        axis.plot(time, force[:, i], color=colour, label=f"F_{label} (N)")
    axis.plot(time, 10 * force[:, 2], color=draw.GREEN, label="10 T_z (N.m)")
    axis.set(xlabel="time (s)", ylabel="constraint wrench (N; 0.1 N.m)")
    axis.set_title(f"(c) up to {np.abs(force[:, :2]).max():.2g} N", fontsize="medium")
