"""Figures 1.4 and 1.5: discrete equivalents, and the energy of a sampled spring."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hapticlink.fmus.blocks import build_block
from hapticlink.fmus.check import session
from hapticlink.orchestrator.base import temporary_folders
from studies import draw
from studies.report.report_page import Entry, Runs, command

RULES = ("forward", "backward", "trapezoidal")
STATED = {
    "forward": "the left half plane goes to the half plane left of z = 1",
    "backward": "it goes into the circle on [0, 1]",
    "trapezoidal": "it goes onto the unit circle's inside",
}


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    yield _figure_1_4(folder)
    yield _figure_1_5(runs, folder)


def images(rule: str, poles: np.ndarray) -> np.ndarray:
    """The discrete pole z of each pole s (T = 1 s), from one step of the FMU from x = 1."""
    settings = {"rule": rule}
    with temporary_folders.temporary_folder() as room:
        path = build_block("discrete_equivalent", settings, room)
        with session(path, room / "fmu") as opened:
            reference = {v.name: v.valueReference for v in opened.description.modelVariables}
            gains = [reference["re"], reference["im"]]
            state = [reference["x[1]"], reference["x[2]"]]
            slave = opened.instance()
            found = []
            for s in poles:
                slave.setupExperiment()
                slave.setReal(gains, [s.real, s.imag])
                slave.enterInitializationMode()
                slave.exitInitializationMode()
                slave.doStep(0.0, 1.0)
                found.append(complex(*slave.getReal(state)))
                slave.reset()
    return np.array(found)


def _figure_1_4(folder: Path) -> Entry:
    rng = np.random.default_rng(14)
    poles = -(10 ** rng.uniform(-2, 2, 600)) + 1j * rng.choice([-1, 1], 600) * 10 ** rng.uniform(
        -2, 2, 600
    )
    edge = 1j * np.tan(np.linspace(-1.55, 1.55, 161))
    figure, axes = draw.panels(3, width=3.6)
    unstable = {}
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    for axis, rule in zip(axes, RULES, strict=True):
        inside, border = images(rule, poles), images(rule, edge)
        unstable[rule] = float(np.mean(np.abs(inside) >= 1 + 1e-12))
        axis.plot(inside.real, inside.imag, ".", color=draw.BLUE, ms=3, label="stable poles")
        axis.plot(border.real, border.imag, "-", color=draw.ORANGE, label="imaginary axis")
        axis.plot(circle.real, circle.imag, "--", color=draw.GREY, label="unit circle")
        axis.set(xlim=(-3, 2), ylim=(-2.5, 2.5), xlabel="Re z", aspect="equal")
        axis.set_title(f"{rule}: {100 * unstable[rule]:.0f} % leave the unit circle")
    axes[0].set_ylabel("Im z")
    axes[0].legend(fontsize="small", loc="lower left")
    name = draw.save(figure, folder, "figure_1_4.png")
    found = "; ".join(
        f"{rule}: {100 * unstable[rule]:.0f} % of 600 stable poles become unstable"
        for rule in RULES
    )
    stated = "; ".join(f"{rule}: {STATED[rule]}" for rule in RULES)
    return Entry(
        "Figure 1.4, stable regions of the three rules",
        f"{100 * unstable['forward']:.0f} % of stable poles become unstable by the forward rule",
        name,
        stated,
        found,
        ("steps of the FMU `discrete_equivalent`, one pole each",),
        "hapticlink reproduce",
    )


def _figure_1_5(runs: Runs, folder: Path) -> Entry:
    table = runs("sampled-spring").haptics
    time, x, F = table["time"], table["virtual_mechanism.x[1]"], table["hand.F[1]"]
    stiffness = -F[0] / x[0]
    energy = table["virtual_mechanism.energy"] + 0.5 * stiffness * x**2
    gained = np.r_[0, np.cumsum(0.5 * stiffness * np.diff(x) ** 2)]
    figure, axes = draw.panels(2)
    shown = slice(0, 14)
    steps = np.repeat(x[shown], 2)[1:], np.repeat(F[shown], 2)[:-1]
    line = np.array([x[shown].min(), x[shown].max()])
    axes[0].plot(1e3 * line, -stiffness * line, "--", color=draw.GREY, label="spring")
    axes[0].plot(1e3 * steps[0], steps[1], color=draw.BLUE, label="held force")
    axes[0].set(xlabel="position (mm)", ylabel="force (N)", title="The held force lags the spring")
    axes[0].legend()
    axes[1].plot(time, energy - energy[0], color=draw.BLUE, label="energy of mass and spring")
    axes[1].plot(time, gained, "--", color=draw.ORANGE, label="1/2 K sum dx^2")
    title = f"The hold generates {energy[-1] - energy[0]:.2g} J in {time[-1]:g} s"
    axes[1].set(xlabel="time (s)", ylabel="energy generated (J)", title=title)
    axes[1].legend()
    error = np.abs(energy - energy[0] - gained).max() / gained[-1]
    return Entry(
        "Figure 1.5, energy of a sampled spring",
        f"the hold generates {energy[-1] - energy[0]:.3g} J in {time[-1]:g} s",
        draw.save(figure, folder, "figure_1_5.png"),
        "a virtual spring with a zero-order hold always generates energy",
        f"energy rises from {energy[0]:.3g} J to {energy[-1]:.3g} J in {time[-1]:g} s at "
        f"20 Hz, as 1/2 K sum dx^2 says to {error:.0e} of it",
        ("a mass on a spring that is sampled at 20 Hz and held",),
        command("sampled-spring"),
    )
