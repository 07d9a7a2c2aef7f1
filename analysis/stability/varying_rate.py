"""The stability of a scene in which the period of one rate is drawn at random, in whole ticks.

Between the starts of two steps of that rate the state is carried by the matrix of a frame, A_pN: of
N ticks, after one of p ticks. Holds that extrapolate read two samples, and so depend on p; with the
others A_pN is A_N. All matrices are of the co-simulation that runs, around the same equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.hand_cases import SLIGHT
from hapticlink.analysis.stability.lifted_map import behind_start, open_lifted_map
from hapticlink.analysis.stability.linear_period import linear_period
from hapticlink.analysis.stability.smooth_scene import linearisable
from hapticlink.analysis.stability.switching import (
    Edge,
    lyapunov,
    mean_square,
)
from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Clock, Frames, Timeline, bounds, exact
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.system.timeline import clocks

SAME = 1e-6
"""Difference of the matrices after frames of different lengths, relative, that is none."""


@dataclass(frozen=True)
class VaryingStability:
    """The stability of a scene with a rate that varies."""

    title: str
    frames: tuple[int, ...]
    """The periods that may occur (ticks)."""
    tick: float
    """(s)"""
    second_moment: float
    """The spectral radius of the map of second moments, per frame."""
    exponent: float
    """The Lyapunov exponent (1/s) of a sequence that is drawn with `seed`."""
    confidence: float
    """The half-width of its 95 % confidence interval (1/s)."""
    seed: int
    frozen: tuple[str, ...]
    """Lines of text on what is removed or stays as at the equilibrium."""

    @property
    def mean_square(self) -> str:
        """Marginal where it takes more than a minute to double, as at fixed rates."""
        return _verdict(growth(self.second_moment, self.frames, self.tick), SLIGHT, "marginal")

    @property
    def almost_surely(self) -> str:
        """By the Lyapunov exponent; undecided where its confidence interval holds 0."""
        return _verdict(self.exponent, self.confidence, "undecided")

    @property
    def verdict(self) -> str:
        """In mean square, for the rate as the scene draws it."""
        return self.mean_square

    finding = verdict

    def record(self) -> dict[str, Any]:
        """The content of stability.json."""
        return {
            "title": self.title,
            "verdict": self.verdict,
            "frames": list(self.frames),
            "tick": self.tick,
            "second_moment_radius": self.second_moment,
            "mean_square": self.mean_square,
            "lyapunov_exponent": self.exponent,
            "confidence": self.confidence,
            "seed": self.seed,
            "almost_surely": self.almost_surely,
            "frozen": list(self.frozen),
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield f"the period varies: {self.frames[0]} to {self.frames[-1]} ticks of {self.tick:.6g} s"
        yield (
            f"mean square: {self.mean_square}; second moments times {self.second_moment:.6g} a "
            "frame"
        )
        yield (
            f"almost surely: {self.almost_surely}; Lyapunov exponent {self.exponent:.4g} +- "
            f"{self.confidence:.2g} 1/s (95 %, seed {self.seed})"
        )
        if self.frozen:
            yield "frozen:"
            yield from (f"  {line}" for line in self.frozen)


def growth(second_moment: float, frames: Sequence[int], tick: float) -> float:
    """The rate (1/s) at which root mean squares grow, ln(radius)/2 a frame. By Jensen's inequality
    no Lyapunov exponent exceeds it; a sequence that is drawn can, by what it has grown before its
    directions have settled."""
    per_frame = math.log(second_moment) / 2 if second_moment else -math.inf
    return per_frame / (float(np.mean(frames)) * tick)


def _verdict(rate: float, slight: float, otherwise: str) -> str:
    return otherwise if abs(rate) <= slight else "stable" if rate < 0.0 else "unstable"


def varies(scene: Scene) -> bool:
    """Whether a rate of the scene is drawn at random."""
    return any(isinstance(pace.rate, VariableRate) for pace in clocks(scene).paces.values())


def varying_stability(scene: str | Path | Scene, options: Options = ()) -> VaryingStability:
    """The stability of a scene in which one rate is drawn between bounds and all others are the
    haptic one.

    Raises InputFault for a scene without an equilibrium, with further rates, and where holds reach
    back by more than two frames.
    """
    with linearisable(scene, options) as (read, system, removed):
        place = _clock(system)
        rates = (pace.rate for pace in clocks(read).paces.values())
        rate = next(rate for rate in rates if isinstance(rate, VariableRate))
        # All that may be drawn, not only what this run draws.
        low, high = bounds(exact(rate.min), exact(rate.max), system.timeline.base)
        lengths, seed = range(low, high + 1), rate.seed
        edges = edges_of(read, system, place, list(lengths))
    exponent, width = lyapunov(edges, seed)
    second, tick = mean_square(edges), float(system.timeline.base)
    return VaryingStability(
        title=read.title,
        frames=tuple(lengths),
        tick=tick,
        second_moment=second,
        exponent=min(exponent, growth(second, lengths, tick)),
        confidence=width,
        seed=seed,
        frozen=(*removed, *frozen_nonlinearities.describe_switches(system)),
    )


def _clock(system: System) -> int:
    """The place of the clock that varies. Raises InputFault unless the haptic clock alone is beside
    it."""
    paces = system.timeline.clocks
    found = [i for i, clock in enumerate(paces) if not isinstance(clock.starts, range | Frames)]
    if len(found) != 1 or len(paces) > 2:
        names = ", ".join(clock.name for clock in paces)
        raise InputFault(
            f"clocks {names}: the matrices of frames need one rate that varies beside the haptic "
            "one; give the other FMUs one of both"
        )
    return found[0]


def edges_of(scene: Scene | None, system: System, place: int, lengths: list[int]) -> list[Edge]:
    """The matrices of frames of the clock at `place`, of equally probable lengths (ticks)."""
    middle = lengths[len(lengths) // 2]
    seconds = system.timeline.seconds
    with open_lifted_map(alternating(system, place, middle, middle), scene) as map_:
        point = equilibrium(map_, map_.start).point
        V = np.stack(list(map_.directions(point)), axis=1)

        def frame(before: int, length: int, further: int | None = None) -> Matrix:
            other = alternating(system, place, before, length, further)
            period = linear_period(map_.over(other, window(other, place)), point)
            X = np.zeros((period.rows, V.shape[1]))
            X[period.order] = V
            return V.T @ period.carried(X)[period.order]

        low, high = lengths[0], lengths[-1]
        remembers = not _close(frame(low, middle), frame(high, middle))
        if remembers and not _close(frame(low, middle, low), frame(low, middle, high)):
            raise InputFault(
                "holds reach back by more than two frames: matrices of frames know the last one "
                "only; take hold=zoh where the rate varies"
            )
        before = lengths if remembers else [middle]
        made = {(p, n): frame(p, n) for p in before for n in lengths}
    acting = np.any([A.any(axis=0) for A in made.values()], axis=0)
    still = np.all([(np.eye(len(A)) == A).all(axis=1) for A in made.values()], axis=0)
    kept = np.flatnonzero(acting & ~still)
    edges = []
    for (p, n), A in made.items():
        A = A[np.ix_(kept, kept)]
        ends = n if remembers else middle
        edges.append(Edge(p, ends, A, 1 / len(lengths), seconds(n)))
    return edges


def _close(A: Matrix, B: Matrix) -> bool:
    return bool(np.abs(A - B).max() <= SAME * max(1.0, np.abs(A).max()))


def alternating(
    system: System, place: int, before: int, length: int, further: int | None = None
) -> System:
    """The system with frames of `further`, `before`, `length`, ... ticks at the clock `place`."""
    cycle = [before, length] if further is None else [further, before, length]
    ends = np.cumsum(cycle).tolist()
    whole, count = ends[-1], len(cycle)
    starts = [0, *ends[:-1]]
    base = system.timeline
    rounds = 4 + -(-_settling_ticks(system) // whole)
    frames = Frames(lambda i: i // count * whole + starts[i % count], (rounds + 2) * count, count)
    paces = list(base.clocks)
    paces[place] = Clock(paces[place].name, frames)
    step = paces[1 - place].starts[1] if len(paces) == 2 else whole
    for i, clock in enumerate(paces):
        if i != place:
            paces[i] = Clock(clock.name, range(0, (rounds + 1) * whole + 2 * step, step))
    return replace(system, timeline=Timeline(base.base, rounds * whole, tuple(paces), base.of))


def _settling_ticks(system: System) -> int:
    """Ticks after which frames are taken: so many that lengths, which holds keep beside stamps, are
    far smaller than those, and slopes of one length are not taken for another
    (forward_sensitivity.py)."""
    return 4 * behind_start(system)


def window(system: System, place: int) -> tuple[int, int]:
    """The first tick of the last frame of a cycle behind the start, and its length."""
    frames = system.timeline.clocks[place].starts
    assert isinstance(frames, Frames)
    i = next(
        i
        for i in range(len(frames))
        if i % frames.round == frames.round - 1 and frames[i] >= _settling_ticks(system)
    )
    return frames[i], frames[i + 1] - frames[i]
