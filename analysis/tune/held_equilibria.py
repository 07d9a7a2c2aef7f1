"""A scene at rest in a pose, in a hand: its lifted map under changed gains, and its compliance.

With the hand cut off (stability/cut.py), the poses x of the handle at the N haptic periods T of a
hyperperiod answer to its stacked wrenches u by z' = A z + B u, x = C z + D u. The wrench n exp(i w
kT), held over each period, moves it at w by

    z = (exp(i w NT) - A)^-1 B W n,   X n = W' (C z + D W n),   W_k = exp(i w kT)/sqrt(N)

the sum over a hyperperiod first: where exp(i w NT) is 1, as the z of a neutral mode is, responses
to single wrenches leave few digits. X is the compliance (3, 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.closure_directions import Closures
from hapticlink.analysis.stability.equilibrium import newton_step, rests
from hapticlink.analysis.stability.lifted_map import LiftedMap, long_enough, opened
from hapticlink.analysis.stability.linearise import Linear, linearised
from hapticlink.analysis.stability.modes import modes
from hapticlink.analysis.stability.opened_ports import hand_port, response
from hapticlink.analysis.tune.gains import Gains, Scales
from hapticlink.analysis.tune.spring_hand import FIRM, LEVER
from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.loop_names import (
    ENVIRONMENT_WRENCH,
    HAND,
    HAND_WRENCH,
    HANDLE_POSE,
)
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.built import built

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]
SOFT = 0.25
"""Scale of the scene's gains with which rest is looked for where they throw the handle off."""
STEPS = 12
"""Newton steps to rest."""
SHARED, NEARBY = 1e-4, 1e-2
"""Relative difference of numbers that share slopes: on the way to rest, and about the rest of the
scene's own gains, next to which that of others is."""
SURE = 0.01
"""Uncertainty of an eigenvalue below which it may count as 1."""
GROWN = 1e7
"""Growth over a period with which rounding errors move the state that is linearised."""


class Held:
    """A scene at rest in a spring hand, looked for from a `start`, such as the `rest` of the same
    scene at other rates. T: the haptic period (s). gains: those of its laws; the map may
    begin with softer ones. Raises InputFault where it comes to no rest with them."""

    def __init__(
        self, map_: LiftedMap, gains: Gains, T: float, start: Vector | None = None
    ) -> None:
        self._map, self.gains, self._T = map_, gains, T
        if start is None or len(start) != len(map_.start):  # holds keep more or fewer samples
            start = map_.start
        self._at = linearised(map_, start, SHARED)
        self._rest(SHARED)
        map_.forget()  # slopes of the states on the way, which may touch less
        self._home = self._at = linearised(map_, self._at.point, SHARED)
        self._set: tuple[Scales, float] = {}, 0.0
        with suppress(InputFault, FmuFault):  # gains too stiff to rest with
            self._home = self._settled({}, FIRM)

    @property
    def rest(self) -> Vector:
        """The state at rest with the scene's gains, or with softer ones."""
        return self._home.point

    @property
    def touches(self) -> bool:
        """Whether a contact force acts at rest."""
        return bool(self.signal(ENVIRONMENT_WRENCH).any())

    def stable(self, scales: Scales, hand: float) -> bool:
        """Whether no mode grows, neutral ones aside, with gains scaled by `scales` in a spring hand
        of the stiffness `hand` (N/m)."""
        try:
            at = self._settled(scales, hand)
        except (FmuFault, InputFault):  # diverges at once
            return False
        found = modes(at, self._map.period)  # an error as large as z says nothing of z = 1
        counted = [mode for mode in found if not (mode.neutral and mode.uncertainty < SURE)]
        return bool(counted) and counted[0].growth <= 0.0

    def signal(self, port: str) -> NDArray[np.float64]:
        """The values of an output `fmu.port` at `rest`; none where there is no such output."""
        return self._home.image[self._places(port)]

    def _places(self, port: str) -> list[int]:
        return [
            i
            for i, c in enumerate(self._map.coordinates)
            if c.kind == "signal" and str(c).partition("[")[0] == port
        ]

    def compliance(self, scales: Scales, hand: float, hertz: float) -> Complex:
        """The compliance (3, 3) of the handle at a frequency. Raises InputFault where it comes to
        no rest with these gains."""
        try:
            at = self._settled(scales, hand)
        except FmuFault as fault:
            raise InputFault(str(fault)) from None
        found = response(self._map, at, hand_port(self._map.system))
        N, wT = found.forces // found.m, 2 * np.pi * hertz * self._T
        W = np.kron(np.exp(1j * wT * np.arange(N))[:, None], np.eye(found.m)) / np.sqrt(N)
        left = np.exp(1j * wT * N) * np.eye(len(found.A)) - found.A
        X: Complex = W.conj().T @ (found.C @ np.linalg.solve(left, found.B @ W) + found.D @ W)
        return X

    def _settled(self, scales: Scales, hand: float) -> Linear:
        """The map at rest with these gains, found from `rest`, so that the result does not depend
        on what was asked before."""
        if (scales, hand) != self._set:
            self._map.set_parameters([*self.gains.parameters(scales), *self._held(hand)])
            self._set = {}, 0.0  # until all is done
            self._at = self._linear(self._home.point, NEARBY)
            self._rest(NEARBY)
            if self.touches and not self._at.image[self._places(ENVIRONMENT_WRENCH)].any():
                raise InputFault("it comes off what it touches")
            self._set = dict(scales), hand
        return self._at

    def _rest(self, same: float) -> None:
        """Newton's method from where the map is."""
        for _ in range(STEPS):
            if rests(self._at):
                return
            self._at = self._linear(self._at.moved(newton_step(self._at)), same)
        if not rests(self._at):
            raise InputFault("it comes to no rest in a hand that holds it")

    def _linear(self, point: Vector, same: float) -> Linear:
        """The map along the directions of the first linearisation, whatever the gains. Raises
        InputFault where it is too unstable."""
        V = self._at.V
        image, M, D = self._map.slopes(point, V, same)
        found = Linear(point, image, V, V.T @ M, V.T @ D)
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
def held(read: Scene, start: Vector | None = None) -> Iterator[Held]:
    """A scene whose hand is a `spring`, at rest. Raises InputFault or FmuFault where it comes to
    none."""
    with built(read) as whole, ExitStack() as stack:
        system = long_enough(read, frozen_nonlinearities.without(whole)[0])
        gains, T = Gains(system), float(1 / exact(read.haptics.rate))

        def rested(scale: float) -> Held:
            softer = gains.applied(system, dict.fromkeys(gains.laws, scale))
            map_ = stack.enter_context(opened(softer, 0.0, Closures(read)))
            return Held(map_, gains, T, start)

        try:
            place = rested(1.0)
        except (InputFault, FmuFault):
            place = rested(SOFT)
        yield place
