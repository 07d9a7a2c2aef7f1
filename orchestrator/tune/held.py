"""A scene at rest in a pose, in a hand: its lifted map under changed gains, and what a hand feels.

The hand is cut off, and a wrench n cos(w t) + i n sin(w t) is held over each haptic period T in its
place, wherever the hand's goes. With z' = A z + b and the handle's pose x_k = C_k z + d_k over a
hyperperiod of N periods, the steady response and its part at w are

    z = (exp(i w N T) - A)^-1 b,   X = 1/N sum_k exp(-i w k T) x_k

X of the unit wrenches are the columns of the compliance; along n it is n' X n, and the dynamic
stiffness 1/|n' X n| (N/m for a wrench with a unit force).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.plan.operations import Get
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.stability import frozen
from hapticlink.orchestrator.stability.closures import Closures
from hapticlink.orchestrator.stability.equilibrium import NEUTRAL, rests
from hapticlink.orchestrator.stability.lifted_map import LiftedMap, long_enough, opened
from hapticlink.orchestrator.stability.linearise import Linear, linearised
from hapticlink.orchestrator.stability.modes import modes
from hapticlink.orchestrator.stability.state_vector import SIGNALS
from hapticlink.orchestrator.stability.tangent import Columns, Instruction
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.tune.gains import Gains, Scales

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]
DEVICE, HAND = "haptic_device", "hand"
STEPS = 12
"""Newton steps to rest."""
SHARED, NEARBY = 1e-4, 1e-2
"""Relative difference of numbers that share slopes: on the way to rest, and about the rest of the
scene's own gains, next to which that of others is."""
UNSTABLE = 50.0
"""Growth (1/s) that counts for gains with which the FMUs diverge at once."""


class Held:
    """A scene at rest in a spring hand, looked for from a `start`, such as the `rest` of the same
    scene at other rates. gains: those of its laws. Raises InputFault where it comes to no rest."""

    def __init__(
        self, map_: LiftedMap, system: System, T: float, start: Vector | None = None
    ) -> None:
        self._map, self._system, self.T = map_, system, T
        self.gains = Gains.of(system)
        if start is not None and len(start) != len(map_.start):  # holds keep more or fewer samples
            start = None
        self._at = linearised(map_, map_.start if start is None else start, SHARED)
        self._rest(SHARED)
        map_.forget()  # slopes of the states on the way, which may touch less
        self._home = self._at = linearised(map_, self._at.point, SHARED)
        self._set: tuple[Scales, float] = {}, 0.0

    @property
    def rest(self) -> Vector:
        """The state at rest with the scene's gains."""
        return self._home.point

    def growth(self, scales: Scales, hand: float) -> float:
        """The growth rate (1/s) of the leading mode, neutral ones aside, with gains scaled by
        `scales` in a spring hand of the stiffness `hand` (N/m)."""
        try:
            at = self._settled(scales, hand)
        except _GrownError as grown:
            return grown.rate
        except (FmuFault, InputFault):
            return UNSTABLE
        found = modes(at, self._map.period)  # an error as large as z says nothing of z = 1
        counted = [mode for mode in found if not (mode.neutral and mode.uncertainty < SURE)]
        return counted[0].growth if counted and np.isfinite(counted[0].growth) else UNSTABLE

    def signal(self, port: str) -> NDArray[np.float64]:
        """The values of an output `fmu.port` at rest, with the scene's gains; none where there is
        no such output."""
        found = [
            float(self._home.image[i])
            for i, c in enumerate(self._map.coordinates)
            if c.kind == "signal" and str(c).partition("[")[0] == port
        ]
        return np.array(found)

    def compliance(self, scales: Scales, hand: float, hertz: float) -> Complex:
        """The handle's pose of unit wrenches of the hand, (3, 3), at a frequency. Raises InputFault
        where it comes to no rest with these gains."""
        try:
            at = self._settled(scales, hand)
        except FmuFault as fault:
            raise InputFault(str(fault)) from None
        signals = SignalVector(self._system)
        F = signals.port(self._system.fmu[HAND], "F")
        x = signals.port(self._system.fmu[DEVICE], "x_true")
        k, wT = at.V.shape[1], 2 * np.pi * hertz * self.T
        seen: list[NDArray[np.float64]] = []

        def inject(operation: Instruction, M: Columns) -> None:
            if not (isinstance(operation, Get) and operation.fmu == HAND):
                return
            signal = M[SIGNALS].copy()
            signal[F] = 0.0
            turn = wT * len(seen)
            for i, row in enumerate(F):
                signal[row, k + i], signal[row, k + 3 + i] = np.cos(turn), np.sin(turn)
            seen.append(signal[x].copy())
            M[SIGNALS] = signal

        start = np.hstack([at.V, np.zeros((len(at.V), 6))])
        _, M, _ = self._map.slopes(at.point, start, after=inject)
        N = len(seen)
        end, poses = at.V.T @ M, np.stack(seen)
        b = end[:, k : k + 3] + 1j * end[:, k + 3 :]
        z = np.linalg.solve(np.exp(1j * wT * N) * np.eye(k) - end[:, :k], b)
        turned = np.exp(-1j * wT * np.arange(N))[:, None, None]
        response = poses[:, :, :k] @ z + poses[:, :, k : k + 3] + 1j * poses[:, :, k + 3 :]
        found: Complex = (turned * response).mean(axis=0)
        return found

    def _settled(self, scales: Scales, hand: float) -> Linear:
        """The map at rest with these gains, found from the rest of the scene's own, so that the
        result does not depend on what was asked before."""
        if (scales, hand) != self._set:
            self._map.set_parameters([*self.gains.parameters(scales), *self._held(hand)])
            self._set = {}, 0.0  # until all is done
            self._at = self._linear(self._home.point, NEARBY)
            self._rest(NEARBY)
            self._set = dict(scales), hand
        return self._at

    def _rest(self, same: float) -> None:
        """Newton's method from where the map is."""
        for _ in range(STEPS):
            if rests(self._at):
                return
            d = self._at.scales
            left = np.eye(len(d)) - self._at.A * d / d[:, None]
            step = d * np.linalg.lstsq(left, self._at.change / d, rcond=NEUTRAL)[0]
            self._at = self._linear(self._at.moved(np.asarray(step, float)), same)
        if not rests(self._at):
            raise InputFault("it comes to no rest in a hand that holds it")

    def _linear(self, point: Vector, same: float) -> Linear:
        """The map along the directions of the first linearisation, whatever the gains."""
        V = self._at.V
        image, M, D = self._map.slopes(point, V, same, after=_Bounded(self.T))
        return Linear(point, image, V, V.T @ M, V.T @ D)

    def _held(self, stiffness: float) -> Iterator[tuple[str, Scalar, float]]:
        """The hand's stiffness, the target moved so that it presses as before."""
        x = self.signal(f"{DEVICE}.x_true")
        scalars = self._system.fmu[HAND].description.scalars
        named = {s.name: s for s in scalars if s.causality == "parameter"}
        F = self.signal(f"{HAND}.F")
        for i, stiff in enumerate((stiffness, stiffness, stiffness * LEVER)):
            yield HAND, named[f"stiffness[{i + 1}]"], stiff
            yield HAND, named[f"target[{i + 1}]"], float(x[i] + F[i] / stiff)


class _Bounded:
    """Ends a pass over a hyperperiod in which perturbations grow so much that rounding errors do,
    too, and the state is no longer the one that was linearised."""

    def __init__(self, T: float) -> None:
        self._T, self._ticks, self._first = T, 0, 0.0

    def __call__(self, operation: Instruction, M: Columns) -> None:
        if not (isinstance(operation, Get) and operation.fmu == HAND):
            return
        self._ticks += 1
        size = float(np.abs(M[SIGNALS]).max())
        if self._ticks <= FIRST:
            self._first = max(self._first, size)
        elif not size < MOST * self._first:
            raise _GrownError(float(np.log(MOST)) / (self._ticks * self._T))


class _GrownError(InputFault):
    """Perturbations grow at a `rate` (1/s)."""

    def __init__(self, rate: float) -> None:
        super().__init__(f"unstable: small motions grow at {rate:.3g} 1/s")
        self.rate = rate


FIRST, MOST = 4, 1e7
"""Ticks whose largest perturbation is the size of all, and how much more is growth."""
SURE = 0.01
"""Uncertainty of an eigenvalue below which it may count as 1."""
LEVER = 1 / 300
"""Rotational stiffness of the hand (N.m/rad) over that of its translations (N/m)."""
DAMPING = (5.0, 5.0, 0.01)
"""Of the hand (N.s/m, N.m.s/rad)."""


def spring(pose: Sequence[float], wrench: Sequence[float], stiffness: float) -> dict[str, object]:
    """The [hand] table of a spring that presses with `wrench` on a handle at `pose`."""
    stiff = [stiffness, stiffness, stiffness * LEVER]
    target = [float(x + F / k) for x, F, k in zip(pose, wrench, stiff, strict=True)]
    return {
        "type": "spring",
        "stiffness": stiff,
        "damping": list(DAMPING),
        "target": [[0.0, *target]],
    }


@contextmanager
def held(read: Scene, start: Vector | None = None) -> Iterator[Held]:
    """A scene whose hand is a `spring`, at rest."""
    if read.haptics is None:
        raise InputFault("[haptics]: no rate")
    with built(read) as whole:
        system = long_enough(read, frozen.without(whole)[0])
        with opened(system, 0.0, Closures(read)) as map_:
            yield Held(map_, system, float(1 / exact(read.haptics.rate)), start)
