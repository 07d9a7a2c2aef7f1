"""The derivatives of the operations of a co-simulation at its equilibrium.

Each operation changes few numbers: a doStep those of one FMU, the evaluation of a hold those of one
connection. With the slopes J of what it writes with respect to what it reads, and their errors E,
perturbations M, a column each, and their errors D follow (linear_period.py)

    M <- J M,   D <- J D + E M

J is that of central differences of 1e-6 max(1, |z|) of the operation itself, E is half the
difference of its slopes to both sides; copies and linear holds have one side and E = 0. A hold that
is a polynomial in time is carried by that (polynomial_holds.py). For a doStep and a get of an FMU
with a graph, J is exact (graph_slopes.py), and E is its difference from these where that is larger;
entries that have a slope in one way only, or another one to each side, keep those by differences.
The graph is evaluated at all points of these at once, where at z it has the result of the FMU.
Slopes at the same numbers, with the same age of samples, are the same, so that around a state of
rest each operation is differentiated once; those of a block of the package in all scenes with its
file.
"""

from __future__ import annotations

import ctypes
from collections.abc import Container, Hashable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability.closure_directions import Closures
from hapticlink.analysis.stability.frozen_nonlinearities import discrete
from hapticlink.analysis.stability.graph_slopes import GraphSlopes, graph_slopes
from hapticlink.analysis.stability.polynomial_holds import (
    STEP,
    advanced_powers,
    degree_of,
    is_ageless,
    is_linear,
    is_polynomial,
    read_by,
    sample_arrives,
    slopes_of_powers,
    slopes_of_sums,
)
from hapticlink.analysis.stability.shared_work import KnownSlopes, SharedWork, Slopes
from hapticlink.analysis.stability.state_vector import (
    SIGNALS,
    StateEntry,
    StateVector,
    Template,
    ages,
    doubles,
    parameters_of,
)
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.fmi.setter import Setter
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
from hapticlink.orchestrator.run.run_state import state_blocks
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.scene.scene import Scene

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
    writes."""

    state: StateVector
    reads: NDArray[np.intp]
    writes: NDArray[np.intp]


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


Since = Hashable
Key = tuple[Instruction, Since]
"""An operation, and what beside the numbers its slopes depend on."""
POWERS = " in powers"
"""Behind the name of a hold: what its polynomial has beside its value."""
ARRIVED = "arrived"


class ForwardSensitivity:
    """The slopes of the operations of a simulation, within the closures of the scene's linkage.
    work: what it shares with other simulations of scenes with the same linkage."""

    def __init__(self, simulation: Simulation, scene: Scene | None, work: SharedWork) -> None:
        self._simulation, self._scene = simulation, scene
        self.closures = Closures(scene.linkage if scene else None)
        self._reach: dict[Instruction, Reach | None] = {}
        self._own: KnownSlopes = {}
        self.work = work
        self._graphs: dict[str, GraphSlopes | None] = {}
        self._named: dict[Any, list[StateEntry]] = {}
        self._polynomials = {n for n, hold in simulation.holds.items() if is_polynomial(hold)}
        self._blocks = state_blocks(simulation, with_own=True)
        self._evaluated: dict[str, tuple[Fraction, bytes]] = {}
        self._applied: dict[Key, Applied] = {}

    def forget(self, fmus: Container[str], connections: Container[str] = ()) -> None:
        """Slopes of these FMUs, and of the holds of these connections, hold no longer, since
        parameters of theirs were changed; that of what FMUs are told is the same with any."""
        for key in list(self._own):
            operation = key[0]
            own = isinstance(operation, OfFmu) and operation.fmu in fmus
            held = isinstance(operation, OfHold) and operation.connection in connections
            if (own and not isinstance(operation, Set)) or held or isinstance(operation, Repeat):
                del self._own[key]

    def begin(self) -> None:
        """A period begins."""
        self._applied.clear()
        self._evaluated.clear()

    def has_slopes(self, operation: Instruction) -> bool:
        """Whether an operation changes a state."""
        return self._of(operation) is not None

    def is_regular(self, operation: Instruction) -> bool:
        """Whether the key of an operation is the same around every state of rest: of all but loops
        that are iterated and holds with whole numbers of their own."""
        if isinstance(operation, OfHold):
            own = self._simulation.holds[operation.connection].own
            return own is None and self._is_smooth(operation.connection)
        return not isinstance(operation, Repeat)

    def applied(
        self, tick: int, operation: Instruction, call: Call, key: Key | None = None
    ) -> tuple[Key, Applied]:
        """Carries out an operation of a co-simulation at rest, in which its slopes depend on the
        ages of samples alone, with what these are the same for: the `key`, where it is known; one
        of an FMU only where these are not known yet."""
        reach = self._of(operation)
        assert reach is not None
        key = key or (operation, self._since(tick, operation, reach))
        found = self._applied.get(key)
        if found and isinstance(operation, OfFmu):  # at rest it would change nothing
            return key, found
        call = self._alone(operation, call)
        if found:
            call(tick)
            return key, found
        if isinstance(operation, Step):  # steps that were left out have not moved the FMU
            begin = tick + Fraction(operation.part * operation.dticks, operation.parts)
            reach.state.set_time(
                operation.fmu, float(begin * self._simulation.system.timeline.base)
            )
        if isinstance(operation, Evaluate) and operation.connection in self._polynomials:
            made = self._of_polynomial(tick, operation, call, reach, key[1])
        else:
            made = self._of_any(tick, operation, call, reach, key[1])
        self._applied[key] = made
        return key, made

    def _since(self, tick: int, operation: Instruction, reach: Reach) -> Since:
        """What the slopes of an operation depend on beside the numbers: the ages of samples, where
        these matter; of a polynomial that goes on, the time since it was evaluated."""
        if isinstance(operation, OfFmu):
            return b""
        integers = reach.state.integers()
        if isinstance(operation, Repeat):
            self._evaluated.clear()
        elif isinstance(operation, Push | Blend):
            self._evaluated.pop(operation.connection, None)
        elif isinstance(operation, Evaluate):
            hold = self._simulation.holds[operation.connection]
            if operation.connection in self._polynomials:
                now, content = tick + operation.ahead, integers.tobytes()
                before, same = self._evaluated.get(operation.connection, (now, b""))
                self._evaluated[operation.connection] = now, content
                if same == content and not sample_arrives(hold, tick):
                    return Fraction(now - before)
            if is_ageless(hold):
                return bytes(ctypes.c_int64(hold.c.span))
        return ages(integers, tick)

    def _of_any(
        self, tick: int, operation: Instruction, call: Call, reach: Reach, since: Since
    ) -> Applied:
        """What an operation does that is differentiated."""
        owners = tuple(o for o in reach.state.owners if o != SIGNALS)
        before = reach.state.sizes()
        slopes, after = self._slopes(tick, operation, call, reach, since)
        counts = tuple(n for o, n in before.items() if o != SIGNALS)
        return Applied(
            operation, owners, counts, tuple(after), reach.reads, reach.writes, slopes.J, slopes.E
        )

    def _of_polynomial(
        self, tick: int, operation: Evaluate, call: Call, reach: Reach, since: Since
    ) -> Applied:
        """What the evaluation of a hold does that is a polynomial in time, whose value is c_0."""
        hold, held = self._simulation.holds[operation.connection], reach.writes
        n, further = len(held), len(held) * degree_of(hold)
        name, powers = operation.connection, operation.connection + POWERS
        order = np.roll(np.arange(n + further), -n)  # the signals come last
        if isinstance(since, Fraction):
            call(tick)
            J = advanced_powers(hold, float(since))[np.ix_(order, order)]
            E = np.zeros_like(J)
            return Applied(operation, (powers,), (further,), (further,), held, held, J, E)
        arrived = self._arrived(tick, operation, call, reach, since)
        after, before = arrived.shape
        by = self._powers(tick, operation, since, after)[order]
        reads = read_by(hold)
        J = np.zeros((after + len(by), before + len(reads)))
        J[:after, :before] = arrived
        J[after:, :before] = by[:, :after] @ arrived
        J[after:, before:] = by[:, after:]
        owners, E = (name, powers), np.zeros_like(J)
        return Applied(operation, owners, (before, 0), (after, further), reads, held, J, E)

    def _arrived(
        self, tick: int, operation: Evaluate, call: Call, reach: Reach, since: Since
    ) -> Matrix:
        """The slopes of the state of a hold by itself, where samples in transit may arrive before
        it is evaluated."""
        name = operation.connection
        hold, size = self._simulation.holds[name], reach.state.sizes()[name]
        about = hold.row, hold.parts.matrix, (*hold.parts.turns.items(),), size, bool(hold.link)
        known = self.work.slopes.setdefault((ARRIVED, *about, since), [])
        if not known or (hold.link and hold.parts.matrix):  # otherwise samples are copied
            if hold.link:
                made = self._of_any(tick, operation, call, reach, since)
                J = made.J[: made.after[0], : made.before[0]]
            else:
                J = slopes_of_sums(hold, self._blocks[name], tick)
            known[:] = [Slopes(np.zeros(0), J, np.zeros_like(J))]
        call(tick)
        return known[0].J

    def _powers(self, tick: int, operation: Evaluate, since: Since, size: int) -> Matrix:
        """The slopes of c_0 to c_d by the `size` numbers of the state of a hold, and by what it
        reads beside its samples."""
        name = operation.connection
        hold, block = self._simulation.holds[name], self._blocks[name]
        board, parts, reads = self._simulation.signals.values, hold.parts, read_by(hold)
        beside = b""
        if parts.beside:
            order, signs = np.argsort(np.argsort(parts.beside.where)), parts.beside.factor
            beside = order.tobytes() + (b"" if signs is None else signs.tobytes())
        base = self._simulation.system.timeline.base
        law = hold.row, parts.relation, parts.matrix, hold.c.n, beside
        about = *law, size + len(reads), operation.ahead, base
        known = self.work.slopes.setdefault((POWERS, *about, since), [])
        if known and not parts.beside:
            return known[0].J
        at = np.concatenate([block.numbers(), board[reads]])
        wide = SAME * np.maximum(1.0, np.abs(at))
        for slopes in known:
            if (np.abs(at - slopes.at) <= wide).all():
                return slopes.J
        J = slopes_of_powers(hold, block, board, tick, float(operation.ahead))
        known.insert(0, Slopes(at, J, np.zeros_like(J)))
        return J

    def _linear(self, operation: Instruction) -> bool:
        """Whether it copies numbers, or evaluates a hold that is linear in what it reads."""
        if isinstance(operation, Evaluate | Blend):
            name = operation.connection
            return self._is_smooth(name) and is_linear(self._simulation.holds[name])
        return isinstance(operation, Set | Push)

    def _copies(self, operation: Instruction) -> bool:
        """Whether it only passes numbers on, so that its slopes are the same at all."""
        if isinstance(operation, Push):
            hold = self._simulation.holds[operation.connection]
            products = hold.own or hold.parts.matrix or hold.row.needs == "reaction"
            return self._is_smooth(operation.connection) and not products
        return isinstance(operation, Set)

    def _is_smooth(self, connection: str) -> bool:
        """Whether the hold of a connection has no regime, as those that observe energy have."""
        hold = self._simulation.system.connection[connection].hold
        return HOLDS[hold or ""].needs not in ("power", "spring")

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
        self, tick: int, operation: Instruction, call: Call, reach: Reach, since: Since
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
        key, known = self._find_known(since, operation, template, (len(z), len(image)))
        wide = SAME * np.maximum(1.0, np.abs(z[read]))
        for slopes in known:
            if self._copies(operation) or (np.abs(z[read] - slopes.at) <= wide).all():
                return slopes, sizes
        self.work.counts["differentiated"] += 1
        if key not in self._named:
            self._named[key] = state.coordinates(template)
        coordinates = self._named[key]
        # What nothing reads, as outputs, has the slopes that it has anywhere.
        inert = np.array([bool(known) and coordinates[i].inert for i in read], bool)

        def carried(point: Vector) -> Vector:
            state.put(template, point)
            call(tick)
            return state.now()[written]

        along = self._directions(operation, coordinates, read[~inert], z)
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

    def _find_known(
        self, since: Since, operation: Instruction, template: Template, sizes: tuple[int, int]
    ) -> tuple[tuple[Any, ...], list[Slopes]]:
        """The slopes of an operation that are known, of so many numbers before and after it, and by
        what."""
        key: tuple[Any, ...]
        if isinstance(operation, Step | Get):
            fmu = self._simulation.system.fmu[operation.fmu]
            parameters = parameters_of(fmu, template.fmus[operation.fmu])
            if parameters is not None:
                seconds = 0.0
                if isinstance(operation, Step):
                    time = self._simulation.system.timeline
                    seconds = time.seconds(operation.dticks) / operation.parts
                file = fmu.name, fmu.description.guid
                key = (type(operation), *file, seconds, parameters.tobytes(), *sizes)
                return key, self.work.slopes.setdefault(key, [])
        if isinstance(operation, Set):
            setter = self._simulation.setters[operation.fmu, operation.now]
            if isinstance(setter, Setter):
                factors = None if setter.factors is None else setter.factors.tobytes()
                guid = self._simulation.system.fmu[operation.fmu].description.guid
                key = operation, guid, setter.where.tobytes(), factors, *sizes
                return key, self.work.slopes.setdefault(key, [])
        if isinstance(operation, Push) and self._is_smooth(operation.connection):
            hold = self._simulation.holds[operation.connection]
            if not hold.own:
                parts, order = hold.parts, np.argsort(hold.places).tobytes()
                key = Push, hold.row, parts.matrix, (*parts.turns.items(),), order, *sizes, since
                return key, self.work.slopes.setdefault(key, [])
        key = operation, *sizes, since
        return key, self._own.setdefault(key, [])

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

    def _directions(
        self,
        operation: Instruction,
        coordinates: Sequence[StateEntry],
        read: NDArray[np.intp],
        z: Vector,
    ) -> Matrix:
        """The directions in which the numbers z are moved, a row each: for what copies them one by
        one, since it knows of no closures, and has the same slopes in every pose."""
        free = np.array([i for i in read if not discrete(coordinates[i])], dtype=np.intp)
        if self._copies(operation):
            return np.eye(len(z))[free]
        along = [*self.closures.directions(coordinates, free, z)]
        return np.array(along).reshape(-1, len(z))

    def _places(self, reach: Reach, template: Any) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Of the numbers of a saved state: which an operation reads, and which it writes."""
        lengths = [len(part) for part in reach.state.parts(template)]
        places = np.split(np.arange(sum(lengths)), np.cumsum(lengths)[:-1])
        own = dict(zip(reach.state.owners, places, strict=True))
        signals = own.pop(SIGNALS)
        mine = np.concatenate([np.zeros(0, dtype=np.intp), *own.values()])
        return np.append(mine, signals[reach.reads]), np.append(mine, signals[reach.writes])

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
                return Reach(
                    StateVector(simulation, fmus, set(state_blocks(simulation))), every, every
                )
            case OfHold(connection) if not self._is_smooth(connection):
                shared = set(state_blocks(simulation)) - set(simulation.holds)
                state = StateVector(simulation, set(), {connection} | shared)
                return Reach(state, every, every)
            case Push(connection):  # with derivatives or integrals behind what is held
                state = StateVector(simulation, set(), {connection})
                places = simulation.holds[connection].places
                return Reach(state, np.unique(places), np.zeros(0, np.intp))
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
