"""Draws the waveform of every hold to docs/figures/, by running the holds on one signal:

python docs/draw_holds.py
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from hapticlink.orchestrator.holds import HOLDS, HoldContext, HoldRow
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold, make_tank
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.energy.bonds import Reader
from hapticlink.orchestrator.run.hold_parts import HoldParts, SpringParts

Vector = NDArray[np.float64]
FOLDER = Path(__file__).with_name("figures")
TICK, PERIOD, END = 1e-3, 40, 400
"""s; ticks between two samples; ticks that are drawn."""
STIFFNESS = 100.0
"""Of the spring of which the signal is the force, or the set position (N/m)."""
NOTES = {
    "zoh": ", latest",
    "slope": " (a velocity, from its pose)",
    "model": " (sinh of a coordinate)",
    "passive": " (force of a spring)",
    "nepce": " (force of a spring)",
    "pspm": " (dotted: near end)",
    "ahead": " (sample of a frame's end at its begin)",
    "mean": " (fast source, slow target)",
    "half-lead": " (fast source, slow target)",
}
BLUE, RED = "#0077bb", "#cc3311"
COLOURS = 64


def signal(tick: float) -> float:
    t = tick * TICK
    return float(np.sin(14 * t) + 0.4 * np.sin(35 * t + 1))


def rate(tick: float) -> float:
    t = tick * TICK
    return float(14 * np.cos(14 * t) + 14 * np.cos(35 * t + 1))


def near_end(tick: float) -> float:
    """Of the spring that the signal sets: a hand leads it, then lets it follow."""
    return signal(tick + 30 * np.cos(2 * np.pi * tick / END))


class Signals:
    """What holds read besides their samples: a position."""

    def __init__(self) -> None:
        self.values, self.loop = np.zeros(1), structures.Loop(numerator=TICK, denominator=1.0)
        self.loop.fill(self, "values")

    def hold(self, name: str, size: int = 1, **parts: Any) -> CompiledHold:
        """A hold, which lives as long as these signals."""
        kind, position = HOLDS[name], Reader(self, [0])  # type: ignore[arg-type]
        width, tank = {"derivative": 2, "integral": 2, "gradient": 3}.get(kind.needs or "", 1), None
        if kind.needs == "power":
            parts["displacement"] = position
        elif kind.needs == "gradient":
            parts["beside"] = position
        elif kind.needs == "step":
            width, parts["relation"] = 2, "WITH_RATE"
        elif kind.needs == "spring":
            stiffness = np.full(1, STIFFNESS)
            spring = SpringParts(stiffness, np.zeros(1), position, np.zeros(1), TICK, sampled=True)
            tank = make_tank(spring)
        every = HoldParts(name, kind, tuple(range(width * size)), HoldContext(size), **parts)
        loop = ctypes.addressof(self.loop)
        return CompiledHold(load(), loop, every, np.zeros(size), "", tank)


def waveform(name: str) -> tuple[Vector, Vector]:
    """The values of a hold at every tick, and the stamps of its samples."""
    signals, kind, values = Signals(), HOLDS[name], list[float]()
    assert isinstance(kind, HoldRow)
    hold = signals.hold(name)
    fast = kind.push == "mean"
    every = 1 if fast else PERIOD
    for tick in range(END):
        # The near end of the spring, the coordinate q of the signal sinh(q), or the target on the
        # spring of which the signal is the force.
        reads = {"spring": near_end(tick), "gradient": np.arcsinh(signal(tick))}
        signals.values[0] = reads.get(kind.needs or "", -signal(tick) / STIFFNESS)
        if tick % every == 0:
            early = PERIOD if kind.needs == "step" else 0
            for of in (tick, tick + early) if early and not tick else (tick + early,):
                hold.push(of, sample(kind, of), tick)
        read = not fast or tick % PERIOD == 0
        values.append(float(hold.value(tick)[0]) if read else values[-1])
    return np.array(values), np.arange(0, END, PERIOD)


def sample(kind: HoldRow, tick: int) -> Vector:
    """The signal at `tick`, and beside it what the hold needs."""
    if kind.needs in ("derivative", "step"):
        return np.array([signal(tick), rate(tick)])
    if kind.needs == "gradient":
        q = np.arcsinh(signal(tick))
        return np.array([signal(tick), q, np.cosh(q)])
    if kind.needs == "integral":  # the signal is a velocity, held as the slope of its pose
        return np.array([rate(tick), signal(tick)])
    return np.array([signal(tick)])


def scalars() -> Figure:
    """A panel for each hold."""
    names = [name for name in HOLDS if name not in ("latest", "mid", "reaction")]  # both ends
    rows = -(-len(names) // 3)
    figure = Figure(figsize=(9, 1.75 * rows), layout="constrained")
    panels = figure.subplots(rows, 3, sharex=True)
    ticks = np.arange(END)
    for axes, name in zip(panels.flat, names, strict=False):
        values, stamps = waveform(name)
        true = rate if HOLDS[name].needs == "integral" else signal
        source = np.array([true(t) for t in ticks])
        axes.plot(ticks, source, color="0.6", lw=1)
        if HOLDS[name].needs == "spring":
            axes.plot(ticks, [near_end(t) for t in ticks], color="0.6", lw=1, ls=":")
        axes.plot(ticks, values, color=BLUE, lw=1.4, drawstyle="steps-post")
        if HOLDS[name].push != "mean":
            axes.plot(stamps, source[stamps], "o", color=RED, ms=3.5)
        axes.set_title(name + NOTES.get(name, ""), fontsize="medium")
        axes.tick_params(labelsize="x-small")
        if axes in panels[:, 0]:
            axes.set_ylabel("signal", fontsize="small")
    for axes in panels.flat[len(names) :]:
        axes.axis("off")
    for axes in panels[-1]:
        axes.set_xlabel("time (ms)", fontsize="small")
    for axes in panels[-2][len(names) - 3 * (rows - 1) :]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("time (ms)", fontsize="small")
    figure.suptitle(
        "Every hold on one signal (grey), sampled every 40 ms (red), read every ms (blue)",
        fontsize="large",
    )
    return figure


def held(hold: CompiledHold, source: Callable[[int], Vector]) -> Vector:
    """The values of a hold whose source is sampled each period, (END, n)."""
    found = []
    for tick in range(END):
        if tick % PERIOD == 0:
            hold.push(tick, source(tick), tick)
        found.append(hold.value(tick).copy())
    return np.array(found)


def _wrapped(tick: float) -> Vector:
    angle = 3.0 * np.sin(9 * tick * TICK) + 2.0
    return np.array([(angle + np.pi) % (2 * np.pi) - np.pi])


def _direction(tick: float) -> Vector:
    angle = 2.5 * np.sin(9 * tick * TICK)
    along = np.array([np.cos(angle), np.sin(angle)])
    return np.outer(along, along).ravel()


def _mobility(tick: float) -> Vector:
    angle = 2.5 * np.sin(9 * tick * TICK)
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, -s], [s, c]])
    return (turned @ np.diag([1.0, 0.05]) @ turned.T).ravel()


def manifolds() -> Figure:
    """Signals that have no extrapolation by entry: `foh` with and without their kind."""
    figure = Figure(figsize=(9, 2.9), layout="constrained")
    panels = figure.subplots(1, 3)
    ticks = np.arange(END)

    signals = Signals()

    def pair(size: int, **kind: Any) -> tuple[CompiledHold, CompiledHold]:
        return signals.hold("foh", size), signals.hold("foh", size, **kind)

    angle: Any = (*pair(1, turns={0: 2 * np.pi}), _wrapped)
    projector: Any = (*pair(4, matrix="projector"), _direction)
    mobility: Any = (*pair(4, matrix="semidefinite"), _mobility)

    def beyond(values: Vector) -> Vector:
        """The largest entry of P P - P."""
        matrices = values.reshape(-1, 2, 2)
        return np.abs(matrices @ matrices - matrices).max((1, 2))

    def least(values: Vector) -> Vector:
        return np.linalg.eigvalsh(values.reshape(-1, 2, 2))[:, 0]

    shown: list[tuple[Any, Callable[[Vector], Vector], str, str]] = [
        (angle, lambda v: v[:, 0], "a wrapped angle (rad)", "angle: whole turns are taken out"),
        (projector, beyond, "largest entry of |P P - P|", "projector: the nearest one"),
        (mobility, least, "least eigenvalue", "semidefinite: none below 0"),
    ]
    for axes, ((plain, kind, source), measure, what, title) in zip(panels, shown, strict=True):
        true = measure(np.array([source(t) for t in ticks]))
        axes.plot(ticks, true, color="0.6", lw=1, label="source")
        axes.plot(ticks, measure(held(plain, source)), color=RED, lw=1, label="by entry")
        axes.plot(ticks, measure(held(kind, source)), color=BLUE, lw=1.4, label="by kind")
        axes.set(xlabel="time (ms)", ylabel=what)
        axes.set_title(title, fontsize="medium")
        axes.tick_params(labelsize="small")
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        ncols=3,
        loc="outside lower center",
        fontsize="small",
    )
    return figure


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, figure in (("holds", scalars()), ("holds-by-kind", manifolds())):
        path, drawn = FOLDER / f"{name}.png", BytesIO()
        figure.savefig(drawn, dpi=90)
        # A third of the bytes, so that further holds fit (tests/docs/test_pictures.py).
        Image.open(drawn).convert("RGB").quantize(COLOURS).save(path, optimize=True)
        print(path)
