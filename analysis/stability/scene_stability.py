"""The stability of a scene: equilibrium, map, modes and verdict."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.equilibrium_location import EquilibriumLocation, location
from hapticlink.analysis.stability.forward_sensitivity import KINK
from hapticlink.analysis.stability.lifted_map import LiftedMap, lifted_map, long_enough
from hapticlink.analysis.stability.linearisation import Linearisation
from hapticlink.analysis.stability.mode_frequency import traced
from hapticlink.analysis.stability.modes import NEAR, Mode, counted, leading, modes
from hapticlink.analysis.stability.radius_verdict import verdict
from hapticlink.analysis.stability.trajectory import trajectory
from hapticlink.analysis.stability.varying_rate import VaryingStability, varies, varying_stability
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import built
from hapticlink.orchestrator.system.system import System

SHOWN = 6
"""Modes that are reported."""
LOST = 1e-6
"""Modes with a smaller |z| have vanished within a period."""


@dataclass(frozen=True)
class Stability:
    """The stability of a scene around its equilibrium."""

    title: str
    period: float
    """The hyperperiod (s)."""
    radius: float
    """The spectral radius over the hyperperiod, without neutral modes."""
    uncertainty: float
    """Of the spectral radius."""
    modes: tuple[Mode, ...]
    """The leading modes."""
    neutral: tuple[Mode, ...]
    """Modes with z = 1."""
    names: tuple[str, ...]
    """The coordinates that the modes move."""
    equilibrium: dict[str, float]
    """By coordinate."""
    frozen: tuple[str, ...]
    """Lines of text on what is removed or stays as at the equilibrium."""
    kinks: tuple[str, ...]
    """The coordinates in which the lifted map has no slope."""
    linearised: dict[str, str]
    """By FMU, whether its slopes are those of its graph or differences."""
    where: EquilibriumLocation
    """The pose of the equilibrium, and whether the run from the start rests there."""

    @property
    def growth(self) -> float:
        """The growth rate (1/s), ln(radius)/period."""
        return float(np.log(self.radius)) / self.period if self.radius else -np.inf

    @property
    def verdict(self) -> str:
        """stable, unstable, or marginal where the radius is 1 within its uncertainty."""
        return verdict(self.radius, self.uncertainty)

    def record(self) -> dict[str, Any]:
        """The content of stability.json."""
        return {
            "title": self.title,
            "verdict": self.verdict,
            "spectral_radius": self.radius,
            "uncertainty": self.uncertainty,
            "growth_rate": self.growth,
            "margin": -self.growth,
            "hyperperiod": self.period,
            "modes": [self._mode(mode) for mode in self.modes],
            "neutral_modes": [self._mode(mode) for mode in self.neutral],
            "frozen": list(self.frozen),
            "not_differentiable": list(self.kinks),
            "linearised": self.linearised,
            "where": self.where.record(),
            "equilibrium": self.equilibrium,
        }

    def _mode(self, mode: Mode) -> dict[str, Any]:
        return {
            "eigenvalue": [mode.z.real, mode.z.imag],
            "uncertainty": mode.uncertainty,
            "growth_rate": mode.growth,
            "frequency": mode.omega / (2 * np.pi),
            "damping_ratio": mode.damping,
            "participation": dict(leading(mode, self.names, 6)),
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield (
            f"spectral radius {self.radius:.8g} +- {self.uncertainty:.1g} over "
            f"{self.period:.6g} s, growth rate {self.growth:.5g} 1/s"
        )
        yield from self.where.lines()
        if self.verdict == "unstable" and self.where.run == "rests there":
            yield "and leaves it at the slightest push: that it rests shows no stability"
        neutral = "neutral modes"
        if self.neutral:
            most = max(min(mode.uncertainty, NEAR) for mode in self.neutral) / self.period
            neutral += f", of which growth up to {most:.2g} 1/s cannot be distinguished from none"
        for title, found in (("modes", self.modes), (neutral, self.neutral)):
            if found:
                yield f"{title}: growth rate (1/s), frequency (Hz), damping ratio, participation"
            for mode in found:
                who = ", ".join(f"{n} {share:.2f}" for n, share in leading(mode, self.names))
                hertz = mode.omega / (2 * np.pi)
                yield f"  {mode.growth:10.4g} {hertz:9.4g} {mode.damping:7.3f}  {who}"
        if self.frozen:
            yield "frozen:"
            yield from (f"  {line}" for line in self.frozen)
        if self.kinks:
            yield "the lifted map has two slopes at the equilibrium, so that the verdict is only of"
            yield f"their mean, in: {', '.join(self.kinks)}"


def equilibrium_stability(
    scene: str | Path | Scene, options: Options = (), *, at: float = 0.0
) -> Stability | VaryingStability:
    """The stability of a scene, changed by `options` (see `scene`), around its equilibrium.

    The scene is run up to the time `at` (s) before, from which on no target, drive or wrench may
    change with time. For a rate that is drawn at random the result is that of all its periods.

    Raises InputFault for a scene without an equilibrium, and for one whose co-simulation has no map
    of a period: latencies or steps that vary, an FMU that does not declare its state.
    """
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, options)
        if varies(read):
            if at:
                raise InputFault(f"at = {at:g}: a rate that varies is judged from the start on")
            return varying_stability(read)
        with built(read) as whole:
            return at_rest(read, whole, at, read.duration)


def at_rest(scene: Scene, whole: System, at: float, seconds: float) -> Stability:
    """The stability of a scene's system around the equilibrium that is found within `seconds` of
    simulated time, as in `stability`."""
    system, removed = frozen_nonlinearities.without(whole)
    with lifted_map(long_enough(scene, system, at), at, scene) as map_:
        run = trajectory(map_, seconds)
        linear = equilibrium(map_, run)
        where = location(scene, map_, linear, run)
        frozen = [*removed, *frozen_nonlinearities.kept(system)]
        return _result(scene.title, map_, linear, frozen, where)


def _result(
    title: str, map_: LiftedMap, linear: Linearisation, lines: list[str], where: EquilibriumLocation
) -> Stability:
    all_modes = [mode for mode in modes(linear, map_.period) if abs(mode.z) > LOST]
    neutral = [mode for mode in all_modes if mode.neutral]
    others = [mode for mode in all_modes if not mode.neutral]
    names = tuple(str(map_.coordinates[i]) for i in linear.taken)
    kinked = np.abs(linear.V[:, linear.kink > KINK]).max(axis=1, initial=0.0)
    kinks = tuple(str(c) for c, share in zip(map_.coordinates, kinked, strict=True) if share)
    first = next(iter(counted(all_modes)), None)
    return Stability(
        title=title,
        period=map_.period,
        radius=abs(first.z) if first else 0.0,
        uncertainty=first.uncertainty if first else 0.0,
        modes=tuple(traced(map_, linear, mode) for mode in others[:SHOWN]),
        neutral=tuple(neutral),
        names=names,
        equilibrium={n: float(linear.point[i]) for n, i in zip(names, linear.taken, strict=True)},
        frozen=tuple(lines),
        kinks=kinks,
        linearised=map_.ways(),
        where=where,
    )
