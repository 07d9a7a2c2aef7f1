"""The figure of the benchmark `cosimulation`: largest error against run time, with the front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.cosimulation.measure import APART, Measured, front
from benchmarks.cosimulation.points import ITERATED, NONE
from studies import draw

COLOURS = {
    "nothing held": "#1b6ca8",
    "held, zoh": "#d1495b",
    "held, other holds": "#e0a030",
    "local model": "#5a8f3c",
    "jacobi": "#8e6bbf",
    ITERATED: "#444444",
}


def write(folder: Path, name: str, found: Mapping[str, Sequence[Measured]]) -> None:
    from matplotlib.lines import Line2D

    figure, panels = draw.panels(len(found), width=6.2, height=5.2)
    for axes, (scene, points) in zip(panels, found.items(), strict=True):
        _panel(axes, scene, points)
    panels[0].set_ylabel("largest error of the handle in 3 s, mm")
    marks = [Line2D([], [], color=c, marker="o", ls="", ms=5, label=k) for k, c in COLOURS.items()]
    marks.append(Line2D([], [], color="0.3", marker="x", ls="", label="unstable"))
    marks.append(Line2D([], [], color="0.2", lw=1.2, label="front"))
    figure.legend(handles=marks, ncols=len(marks), loc="outside lower center", fontsize=8)
    figure.suptitle("; ".join(map(_share, found, found.values())), fontsize=11)
    draw.save(figure, folder, name)


def _share(scene: str, points: Sequence[Measured]) -> str:
    best = front(points)
    free = sum(m.point.frames == NONE for m in best)
    return f"{scene}: {free} of {len(best)} points on the front hold nothing between rates"


def _panel(ax: Any, scene: str, points: Sequence[Measured]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    top = 1.6 * APART
    for kind, colour in COLOURS.items():
        stable = [m for m in points if m.kind == kind and not m.unstable]
        times = [[_ms(t) for t in m.time] for m in stable]
        bars = [[t[1] - t[0] for t in times], [t[2] - t[1] for t in times]]
        style: dict[str, Any] = {"fmt": "o", "ms": 4, "lw": 0.8, "alpha": 0.7, "color": colour}
        middle, height = [t[1] for t in times], [m.most for m in stable]
        ax.errorbar(middle, height, xerr=bars if times else None, **style)
        lost = [_ms(m.time[1]) for m in points if m.kind == kind and m.unstable]
        ax.plot(lost, [top] * len(lost), "x", color=colour, ms=6)
    best = front(points)
    ax.plot([_ms(m.time[1]) for m in best], [m.most for m in best], "-", color="0.2", lw=1.2)
    for number, m in enumerate(best, 1):
        at, below = (_ms(m.time[1]), m.most), (-8, -9)
        ax.annotate(str(number), at, below, textcoords="offset points", fontsize=8, color="0.1")
    ax.axhline(APART, color="0.6", lw=0.8, ls=":")
    ax.set(xscale="log", yscale="log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    ax.set_title(scene, fontsize=10)
    ax.set_xlabel("run time per simulated second, ms, with quartiles (x: unstable)")


def _ms(time: float) -> float:
    """Of a run of 3 s, per simulated second."""
    return 1e3 * time / 3
