"""The answers of a blind trial over its levels, with psychometric curves and thresholds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.analysis.trials.blind_trial import BlindTrial
from hapticlink.analysis.trials.psychometric import GUESS, PsychometricFit, Vector
from hapticlink.visualization.figure_axes import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(trial: BlindTrial) -> Figure:
    """Share of right answers of each setting, with exact 95 % intervals; with levels over these,
    and the curve of each group with its threshold."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.2), layout="constrained")
    axes = figure.subplots()
    shares = {_key(trial, row): row for row in trial.shares()}
    thresholds = trial.thresholds()
    for i, (common, group) in enumerate(trial.groups().items()):
        keys = (_key(trial, trial.settings[k]) for k in group)
        rows = [shares[key] for key in keys if key in shares]
        x = np.arange(float(len(rows)))
        if trial.level:
            x = np.array([float(row[trial.level]) for row in rows])
        else:
            x += i
            axes.text(i, 0.03, plain(common), ha="center", fontsize="small")
        share, low, high = (np.array([r[k] for r in rows]) for k in ("share", "low", "high"))
        ends, label = (share - low, high - share), plain(common) or None
        axes.errorbar(x, share, ends, fmt="o", ms=4, lw=1, capsize=2, color=f"C{i}", label=label)
        if isinstance(fit := thresholds.get(common), PsychometricFit):
            _draw_curve(axes, fit, x, f"C{i}")
    axes.axhline(GUESS, color="0.5", lw=1, ls=":")
    axes.set(xlabel=plain(trial.level or ""), ylabel="share of right answers", ylim=(0, 1.03))
    title = f"{len(trial.answers)} answers; bar: 95 % interval of a threshold"
    axes.set_title(title if trial.level else f"{len(trial.answers)} answers", fontsize="medium")
    if trial.level:
        levels = dict.fromkeys(setting[trial.level] for setting in trial.settings)
        axes.set_xticks([float(level) for level in levels], [*levels])
        axes.minorticks_off()
    if trial.level and any(trial.groups()):
        axes.legend(fontsize="small")
    elif not trial.level:
        axes.set_xticks([])
    return figure


def _key(trial: BlindTrial, row: Mapping[str, Any]) -> tuple[str, ...]:
    """What a row has of a trial's settings, as text."""
    return tuple(f"{key}={row[key]}" for key in trial.settings[0])


def _draw_curve(axes: Axes, fit: PsychometricFit, x: Vector, colour: str) -> None:
    """A psychometric curve over these levels, with its threshold."""
    space = np.geomspace if fit.logarithmic else np.linspace
    fine = space(x.min(), x.max(), 200)
    axes.plot(fine, fit.share(fine), color=colour)
    half = float(fit.share(np.array(fit.threshold)))
    ends = fit.low or x.min(), fit.high or x.max()
    axes.plot(ends, [half, half], color=colour, lw=4, alpha=0.4)
    axes.plot([fit.threshold], [half], "|", ms=14, color=colour)
    if fit.logarithmic:
        axes.set_xscale("log")
