"""The figure of a transparency: felt inertia over the mechanism's, and the error of its force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from hapticlink.analysis.transparency.mobility_at_hand import FORCE, HERTZ, Transparency
from hapticlink.orchestrator.results.numbers import short
from hapticlink.visualization.curve_colours import CURVES
from hapticlink.visualization.figure_axes import headline


def draw(found: Sequence[Transparency]) -> Figure:
    """By pose and direction over the frequency, with the threshold of a force, and the felt
    stiffness of constrained directions."""
    stiff = [c.stiffness for pose in found for c in pose.constrained]
    shown = any(np.isfinite(k).any() for k in stiff)
    figure = Figure(figsize=(4.2 * (2 + shown), 3.8), layout="constrained")
    felt, error, *third = figure.subplots(1, 2 + shown)
    for i, pose in enumerate(found):
        colour = CURVES[i % len(CURVES)]
        for j, direction in enumerate(pose.free):
            style = {"color": colour, "ls": ("-", "--", ":")[j]}
            name = f"{pose.pose}, {direction.inertia:.3g} kg"
            felt.semilogx(HERTZ, direction.felt.real / direction.inertia, label=name, **style)
            error.loglog(HERTZ, 100 * direction.error, **style)
        for constraint in pose.constrained if shown else ():
            third[0].loglog(HERTZ, constraint.stiffness, color=colour, label=pose.pose)
    felt.axhspan(1 - FORCE, 1 + FORCE, color="0.9", zorder=0)
    within = {"fontsize": "small", "ha": "right"}  # where the curves have gone down
    felt.text(HERTZ[-1], 1.01 - FORCE, "within what a person can tell", **within)
    felt.set_ylabel("felt inertia / that of the mechanism")
    felt.legend(fontsize="small")
    error.axhline(100 * FORCE, color="tab:red", lw=1.0)
    error.text(HERTZ[0], 110 * FORCE, "what a person can tell", color="tab:red", fontsize="small")
    error.set_ylabel("error of the force along the motion (%)")
    for axes in third:
        axes.set_ylabel("felt stiffness of the constraint (N/m)")
    for axes in (felt, error, *third):
        axes.set_xlabel("frequency (Hz)")
    headline(figure, f"{found[0].title}: {_finding(found)}", 90)
    return figure


def _finding(found: Sequence[Transparency]) -> str:
    if growing := [pose for pose in found if pose.growing]:
        loose = f"unstable in some hands at {', '.join(pose.pose for pose in growing)}"
        if all(pose.steady_in for pose in growing):
            return f"{loose}; shown is what those feel that keep it steady"
        return f"{loose}, and in all that were tried at one: no steady feel"
    worst = min(pose.right_up_to for pose in found)
    if np.isinf(worst):
        return f"force and direction are right up to {HERTZ[-1]:g} Hz"
    if not worst:
        return f"the inertia is wrong already at {HERTZ[0]:g} Hz"
    return f"the inertia is felt right up to {short(worst)} Hz"
