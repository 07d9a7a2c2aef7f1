"""Figures B.5 and B.6: the experiment with Table B.1, stiffness and impedance control."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator.results.read_results import Results
from studies import draw
from studies.report import measures
from studies.report.chapter6 import OFF, ON, path
from studies.report.report_page import Entry, Runs, command

SCENE = "closed-loop-b1"


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    on, off = runs(SCENE, *ON), runs(SCENE, *OFF)
    count = measures.count(on)
    two = np.asarray(on.haptics["virtual_mechanism.n_constraints"]) >= 2
    wrench = on.haptics["controller.F_constraint"]
    force = np.hypot(wrench[:, 0], wrench[:, 1])
    yield Entry(
        "Figure B.5, joint constraints by stiffness control",
        _draw(on, folder, "figure_b_5.png"),
        "at least one constraint throughout, two while the loop closure is active; the device "
        "follows the operational point; the constraint wrench is larger while two are active",
        f"one constraint throughout, two in {len(count.episodes)} episodes "
        f"({count.listed} s), of which {count.unseen} "
        f"fall between the frames; at most {tracking(on)[1].max():.2g} mm apart; |F_T| "
        f"{measures.rms(force[two]) if two.any() else 0:.2g} N RMS while the mechanism has two, "
        f"{measures.rms(force[~two]):.2g} N otherwise",
        command(SCENE, *ON),
    )
    time, gap = tracking(off)
    own = measures.count(off)
    yield Entry(
        "Figure B.6, joint constraints by impedance control",
        _draw(off, folder, "figure_b_6.png"),
        "significant drift between the trajectories; ended after approximately 3 s, just after "
        "the loop closure constraint becomes active, before the device's workspace limit",
        f"{gap.max():.0f} mm apart at {time[-1]:.2f} s ({off.run['end']['reason']}), "
        f"{gap.max() / tracking(on)[1].max():.0f} times more than under stiffness control; two "
        f"constraints in {len(own.episodes)} episodes",
        command(SCENE, *OFF),
    )


def _draw(results: Results, folder: Path, name: str) -> str:
    haptics, graphics = results.haptics, results.graphics
    wrench = "controller.F_constraint" in haptics
    figure, axes = draw.panels(3 if wrench else 2)
    own = haptics["virtual_mechanism.n_constraints"]
    seen = graphics["virtual_environment.n_constraints"]
    axes[0].step(haptics["time"], own, where="post", color=draw.GREY, label="mechanism, 512 Hz")
    axes[0].step(graphics["time"], seen, where="post", color=draw.BLUE, label="frames, 30 Hz")
    axes[0].set(xlabel="time (s)", ylabel="constrained directions", yticks=[0, 1, 2, 3])
    axes[0].set_title(f"(a) two in {100 * np.mean(own >= 2):.1f} % of the time")
    axes[0].legend(fontsize="small")
    path(axes[1], results, "operational point (OP)")
    axes[1].set_title(f"(b) apart by at most {tracking(results)[1].max():.3g} mm")
    axes[1].legend(fontsize="small")
    if wrench:
        force = haptics["controller.F_constraint"]
        for i, (label, colour) in enumerate((("x", draw.BLUE), ("y", draw.ORANGE))):
            axes[2].plot(haptics["time"], force[:, i], color=colour, label=f"F_{label} (N)")
        axes[2].plot(haptics["time"], 10 * force[:, 2], color=draw.GREEN, label="10 T_z (N.m)")
        axes[2].set(xlabel="time (s)", ylabel="constraint wrench")
        axes[2].set_title(f"(c) up to {np.abs(force[:, :2]).max():.2g} N")
        axes[2].legend(fontsize="small")
    return draw.save(figure, folder, name)
