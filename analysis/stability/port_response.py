"""The linearised co-simulation cut open at its ports: the response to forces of a hand, and to
displacements of the mechanism behind the coupling.

Over a hyperperiod, with the forces u of its N haptic periods and the displacements d of the n steps
of the mechanism stacked,

    z' = A z + B (u, d),   (x, f) = C z + D (u, d)

x are the poses of the handle at the beginning of each haptic period, f the wrenches that the
mechanism puts on the rendering over its steps. Perturbations are carried through the operations of
a period as for the lifted map (forward_sensitivity.py); what the hand sends is set to u, and where
the mechanism is cut off, its pose to y_{j+1} = y_j + d_j and its velocity to d_j/H, the mean over
the step that ends there, of length H. Its other outputs stay as at the equilibrium. A velocity of
the handle that is read directly is then the mean over the period before, too: a passive hand or
mechanism is known by its mean velocities, whose products with the held forces are its energy, and
not by the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.stability.forward_sensitivity import Columns, Instruction
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linearisation import Linearisation
from hapticlink.analysis.stability.state_vector import SIGNALS
from hapticlink.orchestrator.base.arrays import Complex, Matrix
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.loop_names import HAND, MECHANISM
from hapticlink.orchestrator.plan.operations import Get, Set, Step
from hapticlink.orchestrator.run.energy.bonds import bond
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import System

LARGEST = 600
"""Entries of the stacked force, of which each frequency takes an eigenvalue problem."""

ROUNDING = 1e-9
"""Relative difference of two signals that are the same one."""


@dataclass(frozen=True)
class HandPort:
    """The user's port."""

    hand: str
    """The FMU of the hand."""
    handle: str
    """The FMU of the handle."""
    inputs: tuple[str, ...]
    """The inputs of the handle that take the force."""
    forces: tuple[int, ...]
    """Indices of the signals that hold that force."""
    moved: tuple[int, ...]
    """Those of the pose of the handle."""
    moving: tuple[int, ...]
    """Those of its velocity."""


@dataclass(frozen=True)
class MechanismPort:
    """The port of the virtual mechanism."""

    fmu: str
    wrench: tuple[tuple[tuple[str, float], ...], ...]
    """By entry of the wrench on it, its inputs with the factor by which each adds to that entry."""
    moved: tuple[int, ...]
    """Indices of the signals of its pose."""
    moving: tuple[int, ...]
    """Those of its velocity."""
    kept: tuple[str, ...] = ()
    """The ports whose outputs others read besides, which stay as at the equilibrium."""


def hand_port(system: System) -> HandPort:
    """Raises InputFault where no hand pushes on an FMU."""
    signals = SignalVector(system)
    for c in system.connections:
        found = bond(c, system, signals) if system.block(c.source) == HAND else None
        if found:
            inputs = tuple(c.inputs[i].name for i in found.entries)
            forces = tuple(found.of(signals.sources(c)))
            return HandPort(c.source, c.target, inputs, forces, found.moved, found.moving)
    raise InputFault("no hand pushes on an FMU by a force with a displacement: no port of a user")


def mechanism_port(system: System, hand: HandPort) -> MechanismPort | None:
    """The port of the virtual mechanism, at which the coupling acts; None where the hand holds the
    mechanism itself."""
    signals = SignalVector(system)
    fmu = next((f.name for f in system.fmus if system.block(f.name) == MECHANISM), None)
    if fmu is None or fmu == hand.handle:
        return None
    bonds = [(c, b) for c in system.into(fmu) if (b := bond(c, system, signals))]
    point = next(((b.moved, b.moving) for c, b in bonds if c.source != hand.hand), None)
    if point is None or not point[1]:
        return None
    wrench = tuple(
        tuple(
            (c.inputs[i].name, float(work))
            for c, b in bonds
            for i, index, work in zip(b.entries, b.moved, b.work, strict=True)
            if index == place
        )
        for place in point[0]
    )
    own = {place for places in point for place in places}
    read = [c for c in system.connections if c.source == fmu]
    kept = {c.source_port for c in read if own.isdisjoint(signals.sources(c))}
    return MechanismPort(fmu, wrench, *point, tuple(sorted(kept)))


@dataclass(frozen=True)
class Response:
    """z' = A z + B (u, d), (x, f) = C z + D (u, d) over a hyperperiod of `forces` entries of u, m
    of them at a time."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    forces: int
    m: int

    def at(self, angle: float) -> Complex:
        """(dx, f) of (u, d) at z' = exp(i angle) z, dx the displacement of the handle over each
        period."""
        turn, k = complex(np.exp(1j * angle)), self.forces
        free = np.linalg.solve(turn * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        y: Complex = self.C.astype(complex) @ free + self.D.astype(complex)
        x = y[:k]
        after = np.concatenate([x[self.m :], turn * x[: self.m]])
        return np.concatenate([after - x, y[k:]])

    def compliance(self, hertz: float, T: float) -> Complex:
        """The compliance (m, m) of the handle at a frequency, in scene units (m/N): the wrench
        n exp(i w kT), held over each haptic period T (s), moves it at w by

            z = (exp(i w NT) - A)^-1 B W n,   X n = W' (C z + D W n),   W_k = exp(i w kT)/sqrt(N)

        the sum over a hyperperiod first: where exp(i w NT) is 1, as the z of a neutral mode is,
        responses to single wrenches leave few digits."""
        N, wT = self.forces // self.m, 2 * np.pi * hertz * T
        W = np.kron(np.exp(1j * wT * np.arange(N))[:, None], np.eye(self.m)) / np.sqrt(N)
        left = np.exp(1j * wT * N) * np.eye(len(self.A)) - self.A
        k = self.forces
        B, C, D = self.B[:, :k], self.C[:k], self.D[:k, :k]
        X: Complex = W.conj().T @ (C @ np.linalg.solve(left, B @ W) + D @ W)
        return X

    @property
    def radius(self) -> float:
        """The spectral radius with the hand gone and the mechanism held."""
        return float(np.abs(np.linalg.eigvals(self.A)).max(initial=0.0))


def forces(map_: LiftedMap, hand: HandPort, mechanism: MechanismPort | None) -> int:
    """The entries of both stacked forces in a hyperperiod."""
    count = len(hand.moved) * map_.count(Set, hand.handle)
    if mechanism:
        count += len(mechanism.moved) * map_.count(Step, mechanism.fmu)
    return count


def response(
    map_: LiftedMap,
    linear: Linearisation,
    hand: HandPort,
    mechanism: MechanismPort | None = None,
    *,
    alone: bool = False,
) -> Response:
    """The response of the co-simulation cut open at the hand's port, and at the mechanism's one;
    `alone`: of the handle's FMU with its other inputs held."""
    N = map_.count(Set, hand.handle)
    n = map_.count(Step, mechanism.fmu) if mechanism else 0
    cut = _Cut(map_, linear, hand, mechanism, N, n, alone)
    _, M, _ = map_.slopes(linear.point, cut.start, after=cut)
    return cut.response(M)


class _Cut:
    """Carries out the cuts after each operation of the period. Columns of the perturbations: the
    state z; the forces u; with a mechanism the handle's pose a period before, the mechanism's pose
    y and its displacement of the step before; and its displacements d."""

    def __init__(
        self,
        map_: LiftedMap,
        linear: Linearisation,
        hand: HandPort,
        mechanism: MechanismPort | None,
        N: int,
        n: int,
        alone: bool,
    ) -> None:
        self._hand, self._mechanism, self._alone, self._linear = hand, mechanism, alone, linear
        self._m, self._N, self._n = len(hand.moved), N, n
        self._p = p = len(mechanism.moved) if mechanism else 0
        self._T, self._H = map_.period / N, map_.period / n if n else 1.0
        self._k = k = linear.V.shape[1]
        self._u = k + (self._m if p else 0) + 2 * p
        self._d = self._u + self._m * N
        self._x: list[Matrix] = []
        self._f: list[Matrix] = []
        self._rows: dict[str, dict[str, int]] = {}
        self._inputs: dict[str, set[str]] = {}
        for fmu in {hand.handle, *((mechanism.fmu,) if mechanism else ())}:
            listed = (c for c in map_.coordinates if (c.kind, c.owner) == ("fmu", fmu))
            self._rows[fmu] = {c.variable: i for i, c in enumerate(listed)}
            self._inputs[fmu] = {s.name for c in map_.system.into(fmu) for s in c.inputs}
        self._outputs = {fmu: map_.outputs(fmu) for fmu in self._rows}
        self.start = np.hstack([linear.V, np.zeros((len(linear.V), self._d + p * n - k))])
        if mechanism:
            own = [i for i, c in enumerate(map_.coordinates) if c.owner == mechanism.fmu]
            self.start[own] = 0.0
            first = next(i for i, c in enumerate(map_.coordinates) if c.kind == "signal")
            self._pose(self.start[first:])

    def _column(self, j: int) -> slice:
        """The columns of the displacement of step j, -1 the one before the period."""
        first = self._u - self._p if j < 0 else self._d + j * self._p
        return slice(first, first + self._p)

    def _pose(self, signals: Matrix) -> None:
        """Sets the mechanism's pose and velocity after the steps done so far."""
        assert self._mechanism
        signals[self._outputs[self._mechanism.fmu]] = 0.0
        pose, velocity = list(self._mechanism.moved), list(self._mechanism.moving)
        one, done = np.eye(self._p), len(self._f)
        signals[pose, self._u - 2 * self._p : self._u - self._p] = one
        for j in range(done):
            signals[pose, self._column(j)] = one
        signals[velocity, self._column(done - 1)] = one / self._H

    def _velocity(self, signals: Matrix) -> None:
        """Sets what the handle's FMU puts out as its true velocity to the mean one."""
        before = self._x[-1] if self._x else np.eye(self._m, signals.shape[1], self._k)
        mean = (signals[list(self._hand.moved)] - before) / self._T
        outputs = range(*self._outputs[self._hand.handle].indices(len(signals)))
        for row, new in zip(signals[list(self._hand.moving)].copy(), mean, strict=True):
            near = ROUNDING * np.abs(row).max()
            for i in outputs:
                if np.abs(signals[i] - row).max() <= near:
                    signals[i] = new

    def __call__(self, operation: Instruction, M: Columns) -> None:
        hand, mechanism = self._hand, self._mechanism
        match operation:
            case Get(hand.hand) if len(self._x) < self._N and not self._alone:
                self._push(M, SIGNALS, list(hand.forces))
            case Set(hand.handle):
                inputs = M[hand.handle] = M[hand.handle].copy()
                rows = self._rows[hand.handle]
                if self._alone:
                    inputs[[rows[name] for name in self._inputs[hand.handle]]] = 0.0
                self._push(M, hand.handle, [rows[name] for name in hand.inputs])
                self._x.append(M[SIGNALS][list(hand.moved)].copy())
        if mechanism is None:
            return
        match operation:
            case Get(hand.handle):
                M[SIGNALS] = M[SIGNALS].copy()
                self._velocity(M[SIGNALS])
            case Step(mechanism.fmu):
                rows = self._rows[mechanism.fmu]
                own = M[mechanism.fmu]
                each = [sum(s * own[rows[e]] for e, s in terms) for terms in mechanism.wrench]
                self._f.append(-np.stack(each))
                kept = [rows[name] for name in self._inputs[mechanism.fmu]]
                M[mechanism.fmu] = np.zeros_like(own)
                M[mechanism.fmu][kept] = own[kept]
            case Get(mechanism.fmu):
                M[SIGNALS] = M[SIGNALS].copy()
                self._pose(M[SIGNALS])

    def _push(self, M: Columns, owner: str, rows: list[int]) -> None:
        """Sets the force of this period."""
        first = self._u + len(self._x) * self._m
        M[owner] = M[owner].copy()
        M[owner][rows] = 0.0
        M[owner][rows, first : first + self._m] = np.eye(self._m)

    def response(self, M: Matrix) -> Response:
        if (len(self._x), len(self._f)) != (self._N, self._n):
            raise AssertionError("operations of a period that were not counted")
        ends = [self._linear.V.T @ M]
        if self._mechanism:
            pose = np.zeros((self._p, M.shape[1]))
            pose[:, self._u - 2 * self._p : self._u - self._p] = np.eye(self._p)
            for j in range(self._n):
                pose[:, self._column(j)] = np.eye(self._p)
            last = np.zeros_like(pose)
            last[:, self._column(self._n - 1)] = np.eye(self._p)
            ends += [self._x[-1], pose, last]
        end, seen, u = np.vstack(ends), np.vstack([*self._x, *self._f]), self._u
        forces = self._d - u
        return Response(end[:, :u], end[:, u:], seen[:, :u], seen[:, u:], forces, self._m)
