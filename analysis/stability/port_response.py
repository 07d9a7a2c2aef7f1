"""The linearised co-simulation cut open at its ports: the response to forces of a hand, and to
displacements of the mechanism behind the coupling.

Over a hyperperiod, with the forces u of its N haptic periods and the displacements d of the n steps
of the mechanism stacked,

    z' = A z + B (u, d),   (x, f) = C z + D (u, d)

x are the poses of the handle at the beginning of each haptic period, f the wrenches that the
mechanism puts on the rendering over its steps. Perturbations are carried through the operations of
a period as for the lifted map (linear_period.py); what the hand sends is set to u, and where
the mechanism is cut off, its pose to y_{j+1} = y_j + d_j and its velocity to d_j/H, the mean over
the step that ends there, of length H. Its other outputs stay as at the equilibrium. A velocity of
the handle that is read directly is then the mean over the period before, too: a passive hand or
mechanism is known by its mean velocities, whose products with the held forces are its energy, and
not by the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.state_vector import SIGNALS
from hapticlink.orchestrator.base.arrays import Complex, Matrix
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import HAND, MECHANISM
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
    lengths: int
    """How many of its directions, the first ones, are lengths."""


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
        found = bond(c, signals) if system.block(c.source) == HAND else None
        if found:
            inputs = [c.inputs[i] for i in found.entries]
            names, forces = tuple(i.name for i in inputs), tuple(found.of(signals.sources(c)))
            lengths = sum(i.unit != "N.m" for i in inputs)
            return HandPort(c.source, c.target, names, forces, found.moved, found.moving, lengths)
    raise InputFault("no hand pushes on an FMU by a force with a displacement: no port of a user")


def mechanism_port(system: System, hand: HandPort) -> MechanismPort | None:
    """The port of the virtual mechanism, at which the coupling acts; None where the hand holds the
    mechanism itself."""
    signals = SignalVector(system)
    fmu = next((f.name for f in system.fmus if system.block(f.name) == MECHANISM), None)
    if fmu is None or fmu == hand.handle:
        return None
    bonds = [(c, b) for c in system.into(fmu) if (b := bond(c, signals))]
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
    period: LinearPeriod,
    hand: HandPort,
    mechanism: MechanismPort | None = None,
    *,
    alone: bool = False,
) -> Response:
    """The response of a co-simulation at rest, cut open at the hand's port, and at the mechanism's
    one; `alone`: of the handle's FMU with its other inputs held."""
    cut = _Cut(period, hand, mechanism, alone)
    return cut.response(period.carried(cut.start, cut))


class _Cut:
    """Carries out the cuts after each operation of the period. Columns of the perturbations: the
    state z; the forces u; with a mechanism the handle's pose a period before, the mechanism's pose
    y and its displacement of the step before; and its displacements d."""

    def __init__(
        self,
        period: LinearPeriod,
        hand: HandPort,
        mechanism: MechanismPort | None,
        alone: bool,
    ) -> None:
        self._hand, self._mechanism, self._alone = hand, mechanism, alone
        map_, first, self._V = period.map_, period.first, period.linear.V
        self._m, self._N = len(hand.moved), map_.count(Set, hand.handle)
        self._p = p = len(mechanism.moved) if mechanism else 0
        self._n = n = map_.count(Step, mechanism.fmu) if mechanism else 0
        self._T, self._H = map_.period / self._N, map_.period / n if n else 1.0
        self._k = k = self._V.shape[1]
        self._u = k + (self._m if p else 0) + 2 * p
        self._d = self._u + self._m * self._N
        self._x: list[Matrix] = []
        self._f: list[Matrix] = []
        self._signals = slice(first[SIGNALS], first[SIGNALS] + map_.sizes()[SIGNALS])
        self._outputs = {fmu: map_.outputs(fmu) for fmu in first if fmu in map_.system.fmu}
        self._row = {
            (c.owner, c.variable): int(row)
            for c, row in zip(map_.coordinates, period.order, strict=True)
            if c.kind == "fmu"
        }
        self._inputs = {
            fmu: [self._row[fmu, s.name] for c in map_.system.into(fmu) for s in c.inputs]
            for fmu in self._outputs
        }
        self._own = {
            fmu: [row for (owner, _), row in self._row.items() if owner == fmu]
            for fmu in self._outputs
        }
        self.start = np.hstack([self._V, np.zeros((len(self._V), self._d + p * n - k))])
        if mechanism:
            self.start[self._own[mechanism.fmu]] = 0.0
            self._pose(self.start[self._signals])

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

    def __call__(self, kind: type, fmu: str, X: Matrix) -> None:
        hand, mechanism, signals = self._hand, self._mechanism, X[self._signals]
        if (kind, fmu) == (Get, hand.hand) and len(self._x) < self._N and not self._alone:
            self._push(signals, list(hand.forces))
        elif (kind, fmu) == (Set, hand.handle):
            if self._alone:
                X[self._inputs[fmu]] = 0.0
            self._push(X, [self._row[fmu, name] for name in hand.inputs])
            self._x.append(signals[list(hand.moved)].copy())
        elif mechanism and (kind, fmu) == (Get, hand.handle):
            self._velocity(signals)
        elif mechanism and (kind, fmu) == (Step, mechanism.fmu):
            terms = [[(s, self._row[fmu, e]) for e, s in entry] for entry in mechanism.wrench]
            self._f.append(-np.stack([sum(s * X[row] for s, row in entry) for entry in terms]))
            X[[*{*self._own[fmu]} - {*self._inputs[fmu]}]] = 0.0
        elif mechanism and (kind, fmu) == (Get, mechanism.fmu):
            self._pose(signals)

    def _push(self, X: Matrix, rows: list[int]) -> None:
        """Sets the force of this period."""
        first = self._u + len(self._x) * self._m
        X[rows] = 0.0
        X[rows, first : first + self._m] = np.eye(self._m)

    def response(self, X: Matrix) -> Response:
        if (len(self._x), len(self._f)) != (self._N, self._n):
            raise AssertionError("operations of a period that were not counted")
        ends = [self._V.T @ X]
        if self._mechanism:
            pose = np.zeros((self._p, X.shape[1]))
            pose[:, self._u - 2 * self._p : self._u - self._p] = np.eye(self._p)
            for j in range(self._n):
                pose[:, self._column(j)] = np.eye(self._p)
            last = np.zeros_like(pose)
            last[:, self._column(self._n - 1)] = np.eye(self._p)
            ends += [self._x[-1], pose, last]
        end, seen, u = np.vstack(ends), np.vstack([*self._x, *self._f]), self._u
        forces = self._d - u
        return Response(end[:, :u], end[:, u:], seen[:, :u], seen[:, u:], forces, self._m)
