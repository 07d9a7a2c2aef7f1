"""The user's port of a scene: is what a hand feels passive, for any hand?

Around the equilibrium, with the hand cut off, a force u_k that is held over each haptic period T
moves the handle by x_{k+1} - x_k. Over a hyperperiod of N periods, both stacked,

    z' = A z + B u,   x = C z + D u,   v = (x_{k+1} - x_k)/T,   u = Z(w) v,   z' = exp(i w N T) z

is the impedance of the port, of all that runs and at all rates. The device alone, with its other
inputs held, has Z_d; the rendering is Z - Z_d. It takes from a hand at least the energy

    b = -min over w of the least eigenvalue of (Z - Z_d + (Z - Z_d)*)/2

times v^2 a second less than it should, so that the device must have more damping than b: for one
rate and an H(z) from the position to the force this is the condition of Colgate and Schenkel, J.
Robotic Systems 14 (1997), 37:

    b > T/2 1/(1 - cos wT) Re{(1 - exp(-i w T)) H(exp(i w T))}

Between samples the velocity is taken for its mean: for a rendering of positions that is the worst
hand, as there; for one that reads velocities it is the worst of the hands that hold their force.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.plan.operations import Set
from hapticlink.orchestrator.run.energy.bonds import bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.stability import frozen
from hapticlink.orchestrator.stability.closures import Closures
from hapticlink.orchestrator.stability.equilibrium import equilibrium
from hapticlink.orchestrator.stability.lifted_map import LiftedMap, long_enough, opened
from hapticlink.orchestrator.stability.linearise import Linear
from hapticlink.orchestrator.stability.state_vector import SIGNALS
from hapticlink.orchestrator.stability.tangent import Columns, Instruction
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.system import Connection, System

Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]
FREQUENCIES = 64
LARGEST = 600
"""Entries of the stacked force, of which each frequency takes an eigenvalue problem."""
STILL = 1e-9
"""Mobility, relative to the largest, of a direction in which the handle does not move."""


@dataclass(frozen=True)
class Passivity:
    """The user's port. needed: damping b of the device (N.s/m) above which the rendering is
    passive for any hand. turning: that for rotations (N.m.s/rad), 0 without any. own: the damping
    that the device has, in the same scale. frequency: where b is needed (Hz), up to whole turns
    in a hyperperiod. curve: frequencies (Hz) and the damping needed there."""

    title: str
    needed: float
    turning: float
    own: float
    frequency: float
    curve: tuple[tuple[float, float], ...]

    @property
    def passive(self) -> bool:
        """Whether the device's own damping suffices."""
        return self.own >= self.needed

    def record(self) -> dict[str, Any]:
        """The part of stability.json on the user's port."""
        return {
            "passive": self.passive,
            "damping_needed": self.needed,
            "damping_needed_in_rotation": self.turning,
            "damping_of_device": self.own,
            "least_passive_frequency": self.frequency,
            "damping_needed_by_frequency": [list(pair) for pair in self.curve],
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield (
            f"user's port: {'passive' if self.passive else 'not passive'} for any hand; the device "
            f"needs a damping of {max(0.0, self.needed):.5g} N.s/m"
            + (f" and {max(0.0, self.turning):.4g} N.m.s/rad" if self.turning else "")
            + f", it has {self.own:.4g}; least passive at {self.frequency:.4g} Hz"
        )


def passivity(scene: str | Path | Scene, options: Options = ()) -> Passivity:
    """The passivity of the user's port of a scene, around its equilibrium.

    Raises InputFault as `stability` does, and for a scene whose hand pushes no device, or with a
    hyperperiod of more than 600 forces.
    """
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"):
        read = open_scene.load(scene, options)
        with built(read) as whole:
            system, _ = frozen.without(whole)
            port = _port(system)
            with opened(long_enough(read, system), 0.0, Closures(read)) as map_:
                at = equilibrium(map_, read.duration)
                T = 1 / float(read.haptics.rate)
                both = [_response(map_, at, port, T, alone) for alone in (False, True)]
    return _judged(read.title, both[0], both[1], map_.period, T, len(port.moved))


@dataclass(frozen=True)
class Port:
    """The connection of a hand's force, and the indices of the displacements that it moves."""

    connection: Connection
    entries: tuple[int, ...]
    moved: tuple[int, ...]


def _port(system: System) -> Port:
    signals = SignalVector(system)
    for c in system.connections:
        found = bond(c, system, signals) if system.block(c.source) == "hand" else None
        if found:
            return Port(c, found.entries, found.moved)
    raise InputFault("no hand pushes on an FMU by a force with a displacement: no port of a user")


@dataclass(frozen=True)
class Response:
    """z' = A z + B u, x = C z + D u over a hyperperiod."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    def mobility(self, angle: float, T: float, m: int) -> Complex:
        """v of u at z' = exp(i angle) z, m entries each."""
        turn = complex(np.exp(1j * angle))
        free = np.linalg.solve(turn * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        x: Complex = self.C.astype(complex) @ free + self.D.astype(complex)
        after = np.concatenate([x[m:], turn * x[:m]])
        mobility: Complex = (after - x) / T
        return mobility

    def impedance(self, angle: float, T: float, m: int, kept: NDArray[np.intp]) -> Complex:
        """Z at z' = exp(i angle) z, of the entries `kept` of each force of m."""
        every = self.mobility(angle, T, m)
        at = np.concatenate([k * m + kept for k in range(len(every) // m)])
        impedance: Complex = np.linalg.inv(every[np.ix_(at, at)])
        return impedance


def _response(map_: LiftedMap, at: Linear, port: Port, T: float, alone: bool) -> Response:
    """The response to the force of the port; `alone`: with the other inputs of its target held."""
    m, N = len(port.moved), round(map_.period / T)
    if m * N > LARGEST:
        raise InputFault(
            f"user's port: {m * N} forces in a hyperperiod, at most {LARGEST}: take a graphics "
            "rate that divides the haptic one"
        )
    target, k = port.connection.target, at.V.shape[1]
    pushed = [port.connection.inputs[i].name for i in port.entries]
    rows = {
        c.variable: i
        for i, c in enumerate(c for c in map_.coordinates if (c.kind, c.owner) == ("fmu", target))
    }
    others = {s.name for c in map_.system.into(target) for s in c.inputs} - set(pushed)
    seen: list[Matrix] = []

    def inject(operation: Instruction, M: Columns) -> None:
        if not (isinstance(operation, Set) and operation.fmu == target):
            return
        seen.append(M[SIGNALS][list(port.moved)].copy())
        inputs = M[target].copy()
        inputs[[rows[name] for name in pushed]] = 0.0
        if alone:
            inputs[[rows[name] for name in others]] = 0.0
        for i, name in enumerate(pushed):
            inputs[rows[name], k + (len(seen) - 1) * m + i] = 1.0
        M[target] = inputs

    start = np.hstack([at.V, np.zeros((len(at.V), m * N))])
    _, M, _ = map_.slopes(at.point, start, after=inject)
    if len(seen) != N:
        raise InputFault(f"user's port: {target} takes {len(seen)} forces in {N} haptic periods")
    x, end = np.vstack(seen), at.V.T @ M
    return Response(end[:, :k], end[:, k:], x[:, :k], x[:, k:])


def _judged(
    title: str, whole: Response, device: Response, period: float, T: float, m: int
) -> Passivity:
    moves = np.abs(device.mobility(np.pi / 2, T, m)).max(axis=0).reshape(-1, m).max(axis=0)
    kept = np.flatnonzero(moves > STILL * moves.max())
    angles = np.concatenate([np.geomspace(1e-2, np.pi, FREQUENCIES // 2)])
    angles = np.unique(np.concatenate([angles, np.linspace(0.0, np.pi, FREQUENCIES // 2)[1:]]))
    scale = _lengths(device, T, m, kept)
    needed: list[float] = []
    own: list[float] = []
    for angle in angles:
        Z = whole.impedance(angle, T, m, kept)
        alone = device.impedance(angle, T, m, kept)
        wide = np.tile(scale, len(Z) // len(kept))
        for found, of, sign in ((needed, Z - alone, -1.0), (own, alone, 1.0)):
            of = of / np.outer(wide, wide)
            found.append(sign * float(np.linalg.eigvalsh((of + of.conj().T) / 2)[0]))
    worst = int(np.argmax(needed))
    hertz = angles / period / (2 * np.pi)
    turns = scale[-1] ** 2 if len(kept) > 2 or kept[-1] == 2 else 0.0
    return Passivity(
        title,
        needed[worst],
        needed[worst] * turns,
        min(own),
        float(hertz[worst]),
        tuple(zip(hertz.tolist(), needed, strict=True)),
    )


def _lengths(device: Response, T: float, m: int, kept: NDArray[np.intp]) -> NDArray[np.float64]:
    """Scales of the entries, 1 for translations; of a rotation the length (m) by which its
    impedance is as large as that of the translations."""
    size = np.abs(np.diag(device.impedance(np.pi / 2, T, m, kept)))[: len(kept)]
    linear = size[kept < 2]
    mean = linear.mean() if len(linear) else 1.0
    found: NDArray[np.float64] = np.where(kept < 2, 1.0, np.sqrt(size / mean))
    return found
