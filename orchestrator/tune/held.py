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
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.plan.operations import Get
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.stability import frozen
from hapticlink.orchestrator.stability.closures import Closures
from hapticlink.orchestrator.stability.equilibrium import COARSE, equilibrium, rests
from hapticlink.orchestrator.stability.lifted_map import LiftedMap, long_enough, opened
from hapticlink.orchestrator.stability.linearise import Linear
from hapticlink.orchestrator.stability.modes import modes
from hapticlink.orchestrator.stability.state_vector import SIGNALS
from hapticlink.orchestrator.stability.tangent import SAME, Columns, Instruction
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.tune.gains import Gains, Scales

Complex = NDArray[np.complex128]
DEVICE, HAND = "haptic_device", "hand"
STEPS = 3
"""Newton steps from the equilibrium of other gains."""
SETTLING = 3.0
RESTLESS = 1e-3
"""Seconds to settle; change over a period of what has not come to rest."""
UNSTABLE = 50.0
"""Growth (1/s) that counts for gains with which the FMUs diverge at once."""


class Held:
    """A scene at rest. gains: those of its laws."""

    def __init__(self, map_: LiftedMap, system: System, T: float, seconds: float) -> None:
        self._map, self._system, self.T = map_, system, T
        map_.start = _settling(map_, map_.start)
        self._home = self._at = equilibrium(map_, seconds)
        self.gains = Gains.of(system)
        self._scales: dict[str, float] = {}
        self._hand = 0.0

    def growth(self, scales: Scales, hand: float) -> float:
        """The growth rate (1/s) of the leading mode, neutral ones aside, with gains scaled by
        `scales` in a spring hand of the stiffness `hand` (N/m)."""
        try:
            at = self._settled(scales, hand)
        except _GrownError as grown:
            return grown.rate
        except FmuFault:
            return UNSTABLE
        found = modes(at, self._map.period)  # an error as large as z says nothing of z = 1
        counted = [mode for mode in found if not (mode.neutral and mode.uncertainty < SURE)]
        return counted[0].growth if counted else UNSTABLE

    def signal(self, port: str) -> NDArray[np.float64]:
        """The value of an output `fmu.port` at rest, with the scene's gains."""
        found = [
            float(self._home.image[i])
            for i, c in enumerate(self._map.coordinates)
            if c.kind == "signal" and str(c).partition("[")[0] == port
        ]
        return np.array(found)

    def compliance(self, scales: Scales, hand: float, hertz: float) -> Complex:
        """The handle's pose of unit wrenches of the hand, (3, 3), at a frequency; not a number with
        gains that are far from stable."""
        try:
            at = self._settled(scales, hand)
        except (_GrownError, FmuFault):
            return np.full((3, 3), np.nan + 0j)
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
        """The map at its equilibrium with these gains; the search starts from that of the scene's
        own, so that the result does not depend on what was asked before."""
        if scales != self._scales or hand != self._hand:
            values = [*self.gains.parameters(scales), *self._held(hand)]
            self._map.set_parameters(values)
            self._hand = 0.0  # until all is done
            moved = scales.get("contact", 1.0) != 1.0  # other laws do nothing at rest
            if moved:
                self._at = self._linear(_settling(self._map, self._home.point), COARSE)
                for _ in range(STEPS):
                    if rests(self._at):
                        break
                    left = np.eye(len(self._at.A)) - self._at.A
                    step = np.linalg.lstsq(left, self._at.change, rcond=1e-9)[0]
                    self._at = self._linear(self._at.moved(np.asarray(step, float)), COARSE)
                if not np.abs(self._at.change).max() < RESTLESS:
                    raise _GrownError(UNSTABLE)
            self._at = self._linear(self._at.point if moved else self._home.point)
            self._scales, self._hand = dict(scales), hand
        return self._at

    def _linear(self, point: NDArray[np.float64], same: float = SAME) -> Linear:
        """The map along the directions of the first equilibrium, whatever the gains; slopes are
        shared by numbers that differ by `same`."""
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


def _settling(map_: LiftedMap, state: NDArray[np.float64]) -> NDArray[np.float64]:
    """The state SETTLING seconds after `state`, next to the equilibrium that the scene settles to,
    so that Newton's method begins on the side of a contact where there is one. As it is where the
    scene diverges."""
    start = state
    try:
        for _ in range(round(SETTLING / map_.period)):
            state = map_.image(state)
    except FmuFault:
        return start
    return state if np.isfinite(state).all() else start


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


class _GrownError(Exception):
    """Perturbations grow at a `rate` (1/s)."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
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
def held(read: Scene) -> Iterator[Held]:
    """A scene with a spring for a hand, at rest. Raises InputFault where it comes to none."""
    if read.haptics is None:
        raise InputFault("[haptics]: no rate")
    with built(read) as whole:
        system = long_enough(read, frozen.without(whole)[0])
        with opened(system, 0.0, Closures(read)) as map_:
            yield Held(map_, system, 1 / float(read.haptics.rate), read.duration)
