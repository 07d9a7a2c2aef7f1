"""The figure of the benchmark `cosimulation`: largest error against run time, with the front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks.cosimulation.front import Measured, front
from benchmarks.cosimulation.measure import APART
from benchmarks.cosimulation.points import ITERATED, NONE

COLOURS = {
    "nothing held": "#1b6ca8",
    "held, zoh": "#d1495b",
    "held, other holds": "#e0a030",
    "local model": "#5a8f3c",
    "jacobi": "#8e6bbf",
    ITERATED: "#444444",
}


def draw(path: Path, found: Mapping[str, Sequence[Measured]]) -> None:
    figure, axes = plt.subplots(1, len(found), figsize=(6.2 * len(found), 5.2), squeeze=False)
    for ax, (scene, points) in zip(axes[0], found.items(), strict=True):
        _panel(ax, scene, points)
    axes[0][0].set_ylabel("largest error of the handle in 3 s, mm")
    marks = [Line2D([], [], color=c, marker="o", ls="", ms=5, label=k) for k, c in COLOURS.items()]
    marks.append(Line2D([], [], color="0.3", marker="x", ls="", label="unstable"))
    marks.append(Line2D([], [], color="0.2", lw=1.2, label="front"))
    figure.legend(handles=marks, ncols=len(marks), loc="lower center", frameon=False, fontsize=8)
    figure.suptitle("; ".join(map(_share, found, found.values())), fontsize=11)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path, dpi=130, metadata={"Software": None})
    plt.close(figure)


def _share(scene: str, points: Sequence[Measured]) -> str:
    best = front(points)
    free = sum(m.point.frames == NONE for m in best)
    return f"{scene}: {free} of {len(best)} points on the front hold nothing between rates"


def _panel(ax: Axes, scene: str, points: Sequence[Measured]) -> None:
    top = 1.6 * APART
    for kind, colour in COLOURS.items():
        mine = [m for m in points if m.kind == kind]
        stable = [m for m in mine if not m.unstable]
        _spread(ax, stable, "o", colour, [m.most for m in stable])
        lost = [m for m in mine if m.unstable]
        ax.plot([1e3 * m.time[1] / 3 for m in lost], [top] * len(lost), "x", color=colour, ms=6)
    best = front(points)
    ax.plot([1e3 * m.time[1] / 3 for m in best], [m.most for m in best], "-", color="0.2", lw=1.2)
    for number, m in enumerate(best, 1):
        at, below = (1e3 * m.time[1] / 3, m.most), (-8, -9)
        ax.annotate(str(number), at, below, textcoords="offset points", fontsize=8, color="0.1")
    ax.axhline(APART, color="0.6", lw=0.8, ls=":")
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    ax.set_title(scene, fontsize=10)
    ax.set_xlabel("run time per simulated second, ms, with quartiles (x: unstable)")
    ax.grid(alpha=0.3, which="major")


def _spread(
    ax: Axes, points: Sequence[Measured], mark: str, colour: str, height: Sequence[float]
) -> None:
    times = [[1e3 * t / 3 for t in m.time] for m in points]
    middle = [t[1] for t in times]
    bars = [[t[1] - t[0] for t in times], [t[2] - t[1] for t in times]]
    xerr = bars if times else None
    ax.errorbar(middle, height, xerr=xerr, fmt=mark, ms=4, lw=0.8, alpha=0.7, color=colour)
