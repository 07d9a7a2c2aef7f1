"""The figure of a tuning: felt stiffness before and after, and the margin at each rate."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hapticlink.orchestrator.tune import Tuned


def draw(tuned: Tuned) -> Figure:
    """Bars of the felt stiffnesses (none where nothing gives way), and of the margins."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    names = list(tuned.felt)
    for offset, (label, felt) in enumerate(
        (("the scene's gains", tuned.felt_before), ("tuned", tuned.felt))
    ):
        values = [felt[n] if np.isfinite(felt[n]) else np.nan for n in names]
        bars = left.bar(np.arange(len(names)) + 0.4 * offset, values, 0.36, label=label)
        said = [f"{felt[n]:.3g}" if np.isfinite(felt[n]) else "rigid" for n in names]
        if np.isfinite(values).all():
            left.bar_label(bars, said, fontsize="small")
        else:
            for i, (text, value) in enumerate(zip(said, values, strict=True)):
                height = value if np.isfinite(value) else 1.0
                left.text(
                    i + 0.4 * offset, height, text, ha="center", va="bottom", fontsize="small"
                )
    left.set_yscale("log")
    left.set_xticks(np.arange(len(names)) + 0.2, names)
    left.set_ylabel(f"felt stiffness at {tuned.hertz:g} Hz (N/m)")
    left.margins(y=0.2)
    left.legend(fontsize="small")
    margins = {"the scene's rates": tuned.margin, **tuned.neighbours}
    right.barh([fill(name, 22) for name in margins], list(margins.values()), 0.5)
    right.axvline(1.0, color="tab:red", lw=1.0, label="unstable below")
    right.axvline(tuned.asked, color="0.3", lw=1.0, ls="--", label="asked for")
    right.set_xlabel("margin: factor on all stiffnesses up to instability")
    right.invert_yaxis()
    right.legend(fontsize="small")
    figure.suptitle(_title(tuned), fontsize="medium")
    return figure


def _title(tuned: Tuned) -> str:
    felt = [value for value in tuned.felt.values() if np.isfinite(value)]
    said = f"margin {tuned.margin:.3g} with the tuned gains, {tuned.own:.3g} with the scene's"
    if len(tuned.felt) == 2 and len(felt) == 2:
        apart = 100 * (max(felt) / min(felt) - 1)
        return f"{tuned.title}: contact and constraint feel alike to {apart:.1f} %, {said}"
    return f"{tuned.title}: {said}"
