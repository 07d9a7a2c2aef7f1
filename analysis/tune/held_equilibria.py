"""A scene at its equilibrium in a pose, in a hand: its lifted map under changed gains, and its
compliance with the hand cut off (stability/port_response.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability.equilibrium import newton_step, rests
from hapticlink.analysis.stability.lifted_map import LiftedMap, lifted_map, long_enough
from hapticlink.analysis.stability.linearisable_scene import linearisable
from hapticlink.analysis.stability.linearisation import Linearisation, linearised
from hapticlink.analysis.stability.mode_frequency import traced
from hapticlink.analysis.stability.modes import Mode, modes
from hapticlink.analysis.stability.port_response import hand_port, response
from hapticlink.analysis.tune.gains import Gains, Scales
from hapticlink.analysis.tune.spring_hand import FIRM, LEVER
from hapticlink.orchestrator.base.arrays import Complex, Matrix, Vector
from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.loop_names import (
    ENVIRONMENT_WRENCH,
    HAND,
    HAND_WRENCH,
    HANDLE_POSE,
)
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

SOFT = 0.25
"""Scale of the scene's gains with which an equilibrium is searched where they throw the handle
off."""
STEPS = 12
"""Newton steps to the equilibrium."""
SHARED, NEARBY = 1e-4, 1e-2
"""Relative difference of numbers that share slopes: on the way to the equilibrium, and about that
of the scene's own gains, next to which that of others is."""
SURE = 0.01
"""Uncertainty of an eigenvalue below which it may count as 1."""
DRIFT, DRIFT_HERTZ = 0.2, 1.0
"""Growth (1/s) and frequency (Hz) below which a mode is drift."""
GROWN = 1e7
"""Growth over a period with which rounding errors move the state that is linearised."""


class Held:
    """A scene at its equilibrium in a spring hand, searched from a `start`, such as the
    `equilibrium` of the same scene at other rates. T: the haptic period (s). gains: those of its
    laws; the map may begin with softer ones. Raises InputFault where there is none with them."""

    def __init__(
        self, map_: LiftedMap, gains: Gains, T: float, start: Vector | None = None
    ) -> None:
        self._map, self.gains, self._T = map_, gains, T
        if start is None or len(start) != len(map_.start):  # holds keep more or fewer samples
            start = map_.start
        self._at = linearised(map_, start, SHARED)
        self._iterate(SHARED)
        map_.forget()  # slopes of the states on the way, which may touch less
        self._home = self._at = linearised(map_, self._at.point, SHARED)
        self._set: tuple[Scales, float] = {}, 0.0
        with suppress(InputFault, FmuFault):  # gains too stiff for an equilibrium
            self._home = self._settled({}, FIRM)

    @property
    def equilibrium(self) -> Vector:
        """The state at the equilibrium with the scene's gains, or with softer ones."""
        return self._home.point

    @property
    def touches(self) -> bool:
        """Whether a contact force acts at the `equilibrium`."""
        return bool(self.signal(ENVIRONMENT_WRENCH).any())

    def stable(self, scales: Scales, hand: float) -> bool:
        """Whether no mode grows, neutral ones and slow drift aside, with gains scaled by `scales`
        in a spring hand of the stiffness `hand` (N/m)."""
        try:
            at = self._settled(scales, hand)
        except (FmuFault, InputFault):  # diverges at once
            return False
        found = modes(at, self._map.period)  # an error as large as z says nothing of z = 1
        counted = [mode for mode in found if not (mode.neutral and mode.uncertainty < SURE)]
        growing = (mode for mode in counted if mode.growth > 0.0)
        return bool(counted) and all(self._drifts(at, mode) for mode in growing)

    def _drifts(self, at: Linearisation, mode: Mode) -> bool:
        """Whether a mode is slow drift, which a hand does not feel: no vibration."""
        if mode.growth >= DRIFT or mode.omega >= 2 * np.pi * DRIFT_HERTZ:
            return False
        return traced(self._map, at, mode).omega < 2 * np.pi * DRIFT_HERTZ

    def signal(self, port: str) -> Matrix:
        """The values of an output `fmu.port` at the `equilibrium`; none without such an output."""
        return self._home.image[self._places(port)]

    def _places(self, port: str) -> list[int]:
        return [
            i
            for i, c in enumerate(self._map.coordinates)
            if c.kind == "signal" and str(c).partition("[")[0] == port
        ]

    def compliance(self, scales: Scales, hand: float, hertz: float) -> Complex:
        """The compliance (3, 3) of the handle at a frequency. Raises InputFault where it has no
        equilibrium with these gains."""
        try:
            at = self._settled(scales, hand)
        except FmuFault as fault:
            raise InputFault(str(fault)) from None
        found = response(self._map, at, hand_port(self._map.system))
        return found.compliance(hertz, self._T)

    def _settled(self, scales: Scales, hand: float) -> Linearisation:
        """The map linearised at the equilibrium with these gains, searched from `equilibrium`, so
        that the result does not depend on what was asked before."""
        if (scales, hand) != self._set:
            self._map.set_parameters([*self.gains.parameters(scales), *self._held(hand)])
            self._set = {}, 0.0  # until all is done
            self._at = self._linear(self._home.point, NEARBY)
            self._iterate(NEARBY)
            if self.touches and not self._at.image[self._places(ENVIRONMENT_WRENCH)].any():
                raise InputFault("it comes off what it touches")
            self._set = dict(scales), hand
        return self._at

    def _iterate(self, same: float) -> None:
        """Newton's method from where the map is."""
        for _ in range(STEPS):
            if rests(self._at):
                return
            self._at = self._linear(self._at.moved(newton_step(self._at)), same)
        if not rests(self._at):
            raise InputFault("it has no equilibrium in a hand that holds it")

    def _linear(self, point: Vector, same: float) -> Linearisation:
        """The map along the directions of the first linearisation, whatever the gains. Raises
        InputFault where it is too unstable."""
        V = self._at.V
        image, M, D = self._map.slopes(point, V, same)
        found = Linearisation(point, image, V, V.T @ M, V.T @ D)
        d = found.scales
        if not np.abs(found.A * d / d[:, None]).max() < GROWN:
            raise InputFault("unstable: small motions grow at once")
        return found

    def _held(self, stiffness: float) -> Iterator[tuple[str, Scalar, float]]:
        """The hand's stiffness, the target moved so that it presses as before."""
        x, F = self.signal(HANDLE_POSE), self.signal(HAND_WRENCH)
        scalars = self._map.system.fmu[HAND].description.scalars
        named = {s.name: s for s in scalars if s.causality == "parameter"}
        for i, stiff in enumerate((stiffness, stiffness, stiffness * LEVER)):
            yield HAND, named[f"stiffness[{i + 1}]"], stiff
            yield HAND, named[f"target[{i + 1}]"], float(x[i] + F[i] / stiff)


@contextmanager
def held(
    scene: str | Path | Scene, options: Options = (), start: Vector | None = None
) -> Iterator[Held]:
    """A scene with `options`, whose hand is a `spring`, at its equilibrium. Raises InputFault or
    FmuFault where it has none."""
    with linearisable(scene, options) as (read, system, _), ExitStack() as stack:
        system = long_enough(read, system)
        gains, T = Gains(system), float(1 / exact(read.haptics.rate))

        def rested(scale: float) -> Held:
            softer = gains.applied(system, dict.fromkeys(gains.laws, scale))
            map_ = stack.enter_context(lifted_map(softer, 0.0, read))
            return Held(map_, gains, T, start)

        try:
            place = rested(1.0)
        except (InputFault, FmuFault):
            place = rested(SOFT)
        yield place
