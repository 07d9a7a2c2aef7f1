"""The derivatives of the operations of a co-simulation at its equilibrium.

Each operation changes few numbers: a doStep those of one FMU, the evaluation of a hold those of one
connection. With the slopes J of what it writes with respect to what it reads, and their errors E,
perturbations M, a column each, and their errors D follow (linear_period.py)

    M <- J M,   D <- J D + E M

J is that of central differences of 1e-6 max(1, |z|) of the operation itself, E is half the
difference of its slopes to both sides; copies and holds without a regime have one side and E = 0.
Of the evaluations of a hold that is a polynomial in time, degree + 1 are differentiated, and the
others follow from these; those of a hold that gives its samples are the same at every age.
For a doStep and a get of an FMU with a graph, J
is exact (graph_slopes.py), and E is its difference from these where that is larger; entries that
have a slope in one way only, or another one to each side, keep those by differences. The graph is
evaluated at all points of these at once, where at z it has the result of the FMU. Slopes at the
same numbers, with the same age of samples, are the same, so that around a state of rest each
operation is differentiated once.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability.closure_directions import Closures
from hapticlink.analysis.stability.frozen_nonlinearities import discrete
from hapticlink.analysis.stability.graph_slopes import GraphSlopes, graph_slopes
from hapticlink.analysis.stability.state_vector import (
    SIGNALS,
    StateEntry,
    StateVector,
    Template,
    ages,
    blocks,
    doubles,
)
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Get,
    Instruction,
    OfFmu,
    OfHold,
    Place,
    Push,
    Repeat,
    Rollback,
    Set,
    Step,
    flat,
)
from hapticlink.orchestrator.run.instructions import Finish
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.scene.scene import Scene

STEP = 1e-6
KINK = 1e-3
"""Difference of slopes, relative to the largest of a column, above which there is none."""
SMALL = 1e-3
"""Columns of smaller slopes, in which the rounding of differences would pass for a kink, count as
of this size."""
SAME = 1e-8
"""Largest difference of numbers, relative to max(1, |z|), at which slopes are the same."""


@dataclass(frozen=True)
class Reach:
    """What an operation touches: the state of its FMUs and holds, and which signals it reads and
    writes; and by the ages of samples what it does since `begin`."""

    state: StateVector
    reads: NDArray[np.intp]
    writes: NDArray[np.intp]
    applied: dict[Any, Applied] = field(default_factory=dict)


@dataclass(frozen=True)
class Slopes:
    """J and E of an operation where it reads the numbers `at`."""

    at: Vector
    J: Matrix
    E: Matrix


@dataclass(frozen=True, eq=False)
class Applied:
    """What an operation at rest does: J and E of the numbers of `owners`, as many as are counted
    `before` and `after` it, followed by the signals that it reads and writes."""

    operation: Instruction
    owners: tuple[str, ...]
    before: tuple[int, ...]
    after: tuple[int, ...]
    reads: NDArray[np.intp]
    writes: NDArray[np.intp]
    J: Matrix
    E: Matrix


class ForwardSensitivity:
    """The slopes of the operations of a simulation, within the closures of the scene's linkage."""

    def __init__(self, simulation: Simulation, scene: Scene | None) -> None:
        self._simulation, self._scene = simulation, scene
        self.closures = Closures(scene.linkage if scene else None)
        self._reach: dict[Instruction, Reach | None] = {}
        self._known: dict[Any, list[Slopes]] = {}
        self._graphs: dict[str, GraphSlopes | None] = {}
        self._named: dict[Any, list[StateEntry]] = {}

    def forget(self, fmus: Container[str]) -> None:
        """Slopes of these FMUs hold no longer, since parameters of theirs were changed; that of
        what they are told is the same with any."""
        for operation, *rest in list(self._known):
            own = isinstance(operation, OfFmu) and operation.fmu in fmus
            if (own and not isinstance(operation, Set)) or isinstance(operation, Repeat):
                del self._known[operation, *rest]

    def begin(self) -> None:
        """A period begins."""
        for reach in filter(None, self._reach.values()):
            reach.applied.clear()

    def applied(self, tick: int, operation: Instruction, call: Call) -> Applied | None:
        """Carries out an operation of a co-simulation at rest, in which its slopes depend on the
        ages of samples alone; one of an FMU only where these are not known yet."""
        if isinstance(operation, Finish):
            return None
        reach = self._of(operation)
        if reach is None:
            call(tick)
            return None
        of_fmu = isinstance(operation, OfFmu)
        since = b"" if of_fmu else reach.state.ages(tick, self._gives_sample(operation))
        found = reach.applied.get(since)
        if found and of_fmu:  # at rest it would change nothing
            return found
        call = self._alone(operation, call)
        if found:
            call(tick)
            return found
        owners = tuple(o for o in reach.state.owners if o != SIGNALS)
        before = reach.state.sizes()
        if isinstance(operation, Step):  # steps that were left out have not moved the FMU
            begin = tick + Fraction(operation.part * operation.dticks, operation.parts)
            reach.state.set_time(
                operation.fmu, float(begin * self._simulation.system.timeline.base)
            )
        slopes, after = self._slopes(tick, operation, call, reach)
        counts = tuple(n for o, n in before.items() if o != SIGNALS)
        reach.applied[since] = made = Applied(
            operation, owners, counts, tuple(after), reach.reads, reach.writes, slopes.J, slopes.E
        )
        return made

    def _linear(self, operation: Instruction) -> bool:
        """Whether it copies numbers, or is one of a hold without a regime."""
        if not isinstance(operation, Evaluate | Blend):
            return isinstance(operation, Set | Push)
        hold = self._simulation.system.connection[operation.connection].hold
        return HOLDS[hold or ""].needs not in ("power", "spring")

    def _gives_sample(self, operation: Instruction) -> bool:
        """Whether it is the evaluation of a hold whose value is one of its samples, unchanged: its
        slopes depend on neither their ages nor their numbers."""
        if not isinstance(operation, Evaluate):
            return False
        hold = HOLDS[self._simulation.system.connection[operation.connection].hold or ""]
        return hold.gives_samples and hold.needs is None

    def _alone(self, operation: Instruction, call: Call) -> Call:
        """The call of an operation that can be repeated from a state that was restored."""
        if isinstance(operation, Step) and operation.fmu in self._simulation.isolated:
            return self._awaited(operation.fmu, call)
        return self._from_here(operation, call) if isinstance(operation, Repeat) else call

    def _awaited(self, fmu: str, step: Call) -> Call:
        """A doStep of an FMU in a process of its own, whose end is waited for."""
        finish = self._simulation.instances[fmu].finish

        def call(tick: int) -> None:
            step(tick)
            finish()

        return call

    def _from_here(self, operation: Repeat, repeat: Call) -> Call:
        """The iteration of a loop from the state that its FMUs have at the call: to that it rolls
        back, and not to the one that was saved before it was perturbed."""
        fmus = [op.fmu for op in operation.again if isinstance(op, Rollback)]
        saves = [self._simulation.instances[fmu].save for fmu in fmus]

        def call(tick: int) -> None:
            for save in saves:
                save()
            repeat(tick)

        return call

    def _slopes(
        self, tick: int, operation: Instruction, call: Call, reach: Reach
    ) -> tuple[Slopes, list[int]]:
        """Slopes of an operation that is carried out, and the numbers of each owner after it."""
        state = reach.state
        template = state.save()
        z, (read, _) = state.numbers(template), self._places(reach, template)
        call(tick)
        after = state.save()
        image, (_, written) = state.numbers(after), self._places(reach, after)
        own = zip(state.owners, state.parts(after), strict=True)
        sizes = [len(part) for owner, part in own if owner != SIGNALS]
        since = ages(template.holds, tick, self._gives_sample(operation))
        key = operation, len(z), len(image), since
        known = self._known.setdefault(key, [])
        wide = SAME * np.maximum(1.0, np.abs(z[read]))
        anywhere = isinstance(operation, Set) or self._gives_sample(operation)
        for slopes in known:
            if anywhere or (np.abs(z[read] - slopes.at) <= wide).all():
                return slopes, sizes
        if nodes := self._nodes(operation, tick):
            J, E = np.zeros((2, len(written), len(read)))
            for node in nodes:
                others = [other for other in nodes if other != node]
                weight = math.prod((tick - other) / (node - other) for other in others)
                state.restore(template)
                there, _ = self._slopes(node, operation, call, reach)
                J, E = J + weight * there.J, E + abs(weight) * np.abs(there.E)
            state.restore(after)
            known.insert(0, Slopes(z[read], J, E))
            return known[0], sizes
        inert = np.zeros(len(read), bool)
        if known:  # what nothing reads, as outputs, has the slopes that it has anywhere
            coordinates = self._coordinates(key, state, template)
            inert = np.array([coordinates[i].inert for i in read], bool)

        def carried(point: Vector) -> Vector:
            state.put(template, point)
            call(tick)
            return state.now()[written]

        along = self._directions(key, state, template, read[~inert], z)
        widths = STEP * np.maximum(1.0, np.abs(np.where(along != 0.0, z, 0.0)).max(axis=1))
        ways = (1.0,) if self._linear(operation) else (1.0, -1.0)
        points = [z + way * widths[:, None] * along for way in ways]
        exact, images = None, None
        if found := self._in_graph(operation, template, np.vstack([z, *points])[:, read]):
            (unmoved, *moved), exact = found
            if (np.abs(unmoved - image[written]) <= SAME * np.maximum(1.0, np.abs(unmoved))).all():
                images = np.split(np.array(moved), len(ways))
        if images is None:
            images = [np.array([*map(carried, each)]).reshape(-1, len(written)) for each in points]
        state.restore(after)
        sides = [
            (moved - image[written]).T / ((each - z) * along).sum(axis=1)
            for each, moved in zip(points, images, strict=True)
        ]
        slope, error = (sides[0] + sides[-1]) / 2, (sides[0] - sides[-1]) / 2
        along = along[:, read]
        if exact is not None:
            slope, error = combine_slopes(exact @ along.T, slope, error)
        J, E = slope @ along, error @ along
        if known:
            J[:, inert], E[:, inert] = known[0].J[:, inert], known[0].E[:, inert]
        known.insert(0, Slopes(z[read], J, E))
        return known[0], sizes

    def _nodes(self, operation: Instruction, tick: int) -> Sequence[int]:
        """The ticks from whose slopes those of an evaluation at `tick` follow, by Lagrange's
        formula: where all samples are equal, those of a hold that is a polynomial in time are
        polynomials of its degree. None where they are found at the tick itself."""
        if not isinstance(operation, Evaluate):
            return ()
        hold = self._simulation.holds[operation.connection]
        row, own = hold.row, hold.c
        if row.push != "samples" or row.needs or hold.link:
            return ()
        if not row.degree or own.count < 2:
            return ()
        before, newest = own.stamps[own.count - 2 : own.count]
        nodes = [newest + k * (newest - before) for k in range(row.degree + 1)]
        return nodes if tick not in nodes else ()

    def _in_graph(
        self, operation: Instruction, before: Template, own: Matrix
    ) -> tuple[Matrix, Matrix] | None:
        """What a doStep or a get of an FMU with a graph makes of its numbers, a row for each point,
        and J at the first."""
        if not isinstance(operation, Step | Get):
            return None
        fmu, system = operation.fmu, self._simulation.system
        description = system.fmu[fmu].description
        if fmu not in self._graphs:
            self._graphs[fmu] = graph_slopes(description, fmu, self._scene)
        graph, state = self._graphs[fmu], doubles(before.fmus[fmu])
        if graph is None:
            return None
        if isinstance(operation, Step):
            # Not the difference of the FMU's times: at rest most of its steps are left out.
            seconds = system.timeline.seconds(operation.dticks) / operation.parts
            return graph.step(state, own, seconds)
        images, J = graph.get(state, own)
        ranks = np.argsort(np.argsort([s.reference for s in description.outputs]))
        rows = np.concatenate([np.arange(len(J)), graph.n_u + ranks])
        return images[:, rows], J[rows]

    def _coordinates(self, key: Any, state: StateVector, template: Any) -> list[StateEntry]:
        if key not in self._named:
            self._named[key] = state.coordinates(template)
        return self._named[key]

    def _directions(
        self, key: Any, state: StateVector, template: Any, read: NDArray[np.intp], z: Vector
    ) -> Matrix:
        """The directions in which the numbers z are moved, a row each."""
        coordinates = self._coordinates(key, state, template)
        free = np.array([i for i in read if not discrete(coordinates[i])], dtype=np.intp)
        along = [*self.closures.directions(coordinates, free, z)]
        return np.array(along).reshape(-1, len(z))

    def _places(self, reach: Reach, template: Any) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Of the numbers of a saved state: which an operation reads, and which it writes."""
        parts = reach.state.parts(template)
        at, own, signals = 0, [], 0
        for owner, part in zip(reach.state.owners, parts, strict=True):
            if owner == SIGNALS:
                signals = at
            else:
                own.append(np.arange(at, at + len(part)))
            at += len(part)
        mine = np.concatenate(own) if own else np.zeros(0, dtype=np.intp)
        return (
            np.concatenate([mine, reach.reads + signals]),
            np.concatenate([mine, reach.writes + signals]),
        )

    def _of(self, operation: Instruction) -> Reach | None:
        if operation not in self._reach:
            self._reach[operation] = self._found(operation)
        return self._reach[operation]

    def _found(self, operation: Instruction) -> Reach | None:
        """None for what changes no state: meters, barriers."""
        simulation, system = self._simulation, self._simulation.system
        every = np.arange(len(simulation.signals.values))
        match operation:
            case Repeat(body=body):
                fmus = {op.fmu for op in flat(body) if isinstance(op, Step)}
                return Reach(StateVector(simulation, fmus, set(blocks(simulation))), every, every)
            case OfHold(connection) if HOLDS[system.connection[connection].hold or ""].needs:
                shared = set(blocks(simulation)) - set(simulation.holds)
                state = StateVector(simulation, set(), {connection} | shared)
                return Reach(state, every, every)
        touched = operation.signals(system)
        if touched is None:
            return None
        fmus = {operation.fmu} if isinstance(operation, OfFmu) else set()
        holds = {operation.connection} if isinstance(operation, OfHold) else set()
        reads, writes = map(self._indices, touched)
        return Reach(StateVector(simulation, fmus, holds), reads, writes)

    def _indices(self, places: Iterable[Place]) -> NDArray[np.intp]:
        """The indices of places in the signal vector."""
        system, signals = self._simulation.system, self._simulation.signals
        every, found = range(len(signals.values)), set[int]()
        for kind, name in places:
            if kind == "sources":
                found |= {*signals.sources(system.connection[name])}
            else:
                found |= {*every[signals.fmu(name) if kind == "outputs" else signals.hold(name)]}
        return np.array(sorted(found), dtype=np.intp)


def combine_slopes(exact: Matrix, slope: Matrix, error: Matrix) -> tuple[Matrix, Matrix]:
    """Slopes and their errors, a column each direction, from exact ones and differences."""
    most = KINK * np.maximum(SMALL, np.abs(slope).max(axis=0, initial=0.0))
    differ = ~(np.abs(slope - exact) <= most) | (np.abs(error) > most)
    gap = slope - exact
    wider = ~differ & (np.abs(gap) > np.abs(error))
    return np.where(differ, slope, exact), np.where(wider, gap, error)
