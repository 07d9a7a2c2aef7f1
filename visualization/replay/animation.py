"""An animation of one or two recorded runs: the mechanism as in their figures, over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.episodes import episodes
from hapticlink.orchestrator.results.numbers import short
from hapticlink.visualization.figure_axes import plain
from hapticlink.visualization.mechanism.drawing import paint
from hapticlink.visualization.mechanism.mark_places import MM, on_page, place
from hapticlink.visualization.mechanism.marks import KINDS, RED
from hapticlink.visualization.replay.recorded_frames import Recorded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL.Image import Image

MAX_FRAMES, MIN_PERIOD = 60, 1 / 20
"""Largest number of frames, and the least time (s) of one."""
MIN_DURATION, LAST_FRAME = 2.0, 1.0
"""Times (s) that an animation takes at least, and for which its last frame stays."""
COLORS = 64
WIDTH, DPI = 4.6, 80
"""Of the picture of one run (in); its height is that of what moves, with TEXT (in) for the
title and the legend."""
TEXT = (0.6, 0.35)
LEGEND = (
    "dashed: the graphics copy of the linkage; dotted: from the handle (circle) to the "
    "point that it should be at (cross); arrow: force of the hand"
)
ARROW = 60.0
"""Length (pt) of the largest force of the hand."""
LEFT_OUT = ("centre", "directions", "cut")
"""Roles of marks that are too small for an animation."""
FITTED = ("obstacle", "body", "handle")
"""Roles of marks that the picture contains."""

Array = NDArray[np.float64]


def write_animation(runs: Sequence[Recorded], names: Sequence[str], path: Path) -> None:
    """Writes a GIF, WebP or animated PNG, by the ending of the path's name, which begins anew after
    its end. The same runs give the same bytes."""
    begin = min(float(run.times[0]) for run in runs)
    end = max(float(run.times[-1]) for run in runs)
    frames = int(np.clip(np.ceil((end - begin) / MIN_PERIOD) + 1, 2, MAX_FRAMES))
    times = np.linspace(begin, end, frames)
    panels = [_Panel(run, name, times) for run, name in zip(runs, names, strict=True)]
    first, *others = _with_palette(list(_pictures(panels, times)))
    milliseconds = round(1e3 * max(end - begin, MIN_DURATION) / len(times))
    first.save(
        path, save_all=True, append_images=others, loop=0, optimize=True, lossless=True,
        duration=[milliseconds] * (len(times) - 1) + [round(1e3 * LAST_FRAME)],
    )  # fmt: skip


class _Panel:
    """One run at the times of the frames."""

    def __init__(self, run: Recorded, name: str, times: Array) -> None:
        self.run, self.name, self.times = run, name, times
        self._rows = np.maximum(np.searchsorted(run.times, times + 1e-9, "right") - 1, 0)
        values = run.values()
        self._view = run.picture.view
        self._x, self._handle = self._places(values["x"]), values.get("handle")
        self._frames = run.frames()
        forces = self._places(values.get("F_hand", np.zeros((0, self._view.dimension))))
        most = float(np.hypot.reduce(forces, axis=1).max(initial=0.0)) / MM
        self._marks = [
            m._replace(size=ARROW / most) if m.kind == "arrow" and most else m
            for m in run.picture.marks
            if m.role not in LEFT_OUT
        ]
        self._episodes = episodes(run.results)

    def _places(self, poses: Array) -> Array:
        """Places (mm) of poses, (k, d), or forces (mN) of wrenches."""
        return poses[..., : self._view.dimension] * MM

    def limits(self) -> Array:
        """Least and largest x and y (mm) of all that moves, (2, 2)."""
        fixed = [mark for mark in self._marks if mark.role in FITTED]
        points = [on_page(self._x, self._view)]
        for row in self._rows:
            at = (place(self._frames[row], each, self._view) for mark in fixed for each in mark.at)
            points.append(np.array([each for each in at if each is not None]))
        every = np.vstack(points)
        return np.array([every.min(axis=0), every.max(axis=0)]).T

    def draw(self, axes: Axes, k: int, limits: Array) -> None:
        """The k-th frame, within limits of x and y (mm)."""
        axes.clear()
        row = self._rows[k]
        axes.set(xlim=limits[0], ylim=limits[1], xticks=[], yticks=[], aspect="equal")
        path = on_page(self._x[: row + 1], self._view)
        axes.plot(*path.T, color=RED, lw=0.8, alpha=0.5)
        paint(axes, self._marks, self._frames[row], view=self._view)
        axes.set_title(plain(self.name), fontsize="medium", fontweight="bold", y=1.0, pad=22)
        for text, y, color in zip(self._said(k, row), (1.02, 0.02), ("0.3", None), strict=True):
            color = color or self._now(k)[1]
            axes.text(
                0.5, y, plain(text), color=color, ha="center", transform=axes.transAxes, zorder=9
            )

    def _said(self, k: int, row: int) -> tuple[str, str]:
        """Time and tracking error, and what happens."""
        text = f"{self.run.times[row]:.2f} s"
        if self._handle is not None:
            apart = np.hypot.reduce(self._places(self._handle[row]) - self._x[row])
            text += f", handle {short(round(float(apart), 1))} mm away"
        return text, fill(self._now(k)[0], 46)

    def _now(self, k: int) -> tuple[str, str]:
        """The first episode at the k-th frame, or how the run has ended; and its colour."""
        time, end = self.times[k], self.run.times[-1]
        if time > end:
            return summary.ending(self.run.results), "k"
        episodes = [e for e in self._episodes if e.begin <= time <= e.end]
        return (episodes[0].said, KINDS[episodes[0].kind][0]) if episodes else ("", "k")


def _pictures(panels: Sequence[_Panel], times: Array) -> Iterator[Image]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    both = np.array([panel.limits() for panel in panels])
    low, high = both[:, :, 0].min(axis=0), both[:, :, 1].max(axis=0)
    half = 0.6 * np.maximum(high - low, 0.6 * float((high - low).max()) + 10.0)
    limits = ((low + high) / 2)[:, None] + half[:, None] * np.array([[-1.0, 1.0]])
    height = 0.98 * WIDTH * half[1] / half[0] + sum(TEXT)
    figure = Figure(figsize=(WIDTH * len(panels), height), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    every = figure.subplots(1, len(panels), squeeze=False)[0]
    figure.subplots_adjust(0.01, TEXT[1] / height, 0.99, 1 - TEXT[0] / height, wspace=0.03)
    legend = fill(LEGEND, int(17 * figure.get_figwidth()))
    figure.text(0.01, 0.08 / height, legend, fontsize="x-small", color="0.3")
    for k in range(len(times)):
        for axes, panel in zip(every, panels, strict=True):
            panel.draw(axes, k, limits)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _with_palette(pictures: Sequence[Image]) -> list[Image]:
    """The pictures in the colours of the first, middle and last, without dithering, which would
    flicker."""
    from PIL import Image

    chosen = [pictures[i] for i in (0, len(pictures) // 2, -1)]
    width, height = chosen[0].size
    montage = Image.new("RGB", (width, height * len(chosen)))
    for i, picture in enumerate(chosen):
        montage.paste(picture, (0, i * height))
    palette = montage.quantize(COLORS, method=Image.Quantize.FASTOCTREE)
    return [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
