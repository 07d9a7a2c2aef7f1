"""The lifted map of a co-simulation: its state after one hyperperiod of all clocks as a function of
the state before, z_{k+1} = F(z_k), carried out by the FMUs, holds and operations that really run.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability.forward_sensitivity import Applied, ForwardSensitivity, Key
from hapticlink.analysis.stability.frozen_nonlinearities import COUNT, discrete, without_friction
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.stand_in import with_stand_ins
from hapticlink.analysis.stability.state_vector import StateEntry, StateVector
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Clock, Frames, Timeline
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.plan.operations import (
    Event,
    Instruction,
    OfFmu,
    OfHold,
    Repeat,
    Step,
    flat,
)
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.compiled.operation_records import Machine
from hapticlink.orchestrator.run.instructions import Finish, instructions
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.system.timeline import timeline

PINNED = 8
"""Events after which FMUs at rest are put back to it."""
CONVERGED = 1e-12
"""Tolerance of iterations: far below the differences by which slopes are found."""


def hyperperiod(time: Timeline) -> int:
    """The ticks after which the events of all clocks repeat. Raises InputFault for a clock whose
    period varies at random or follows a trace."""
    return math.lcm(*(_repetition(clock) for clock in time.clocks))


def _repetition(clock: Clock) -> int:
    """The ticks after which the events of a clock repeat."""
    starts = clock.starts
    if isinstance(starts, Frames):
        return starts.repeats
    if clock.period is None or clock.first != clock.period:
        raise InputFault(
            f"the period of {clock.name} varies: no period after which all repeats, and so no map; "
            "take a fixed rate"
        )
    return clock.period


@dataclass(frozen=True, eq=False)
class EventCalls:
    """The operations of a kind of event, and the calls of the loop that carry them out."""

    operations: tuple[Instruction, ...]
    machine: Machine

    @cached_property
    def each(self) -> list[Call]:
        return [self.machine.joined([operation]) for operation in self.operations]

    @cached_property
    def whole(self) -> Call:
        return self.machine.joined(self.operations)

    @cached_property
    def of_holds(self) -> Call:
        return self.machine.joined([each for each in self.operations if isinstance(each, OfHold)])


class LiftedMap:
    """F of a system, from the first multiple of the hyperperiod on that is behind its start.

    period: the hyperperiod (s), of a number of `events`. coordinates: of the state, in order.
    start: the state at its begin. Until then the FMUs are put back to where they start, again and
    again, so that `start` is near a rest however unstable the system is; not in a `window`.
    """

    def __init__(
        self,
        plan: Plan,
        simulation: Simulation,
        sensitivity: ForwardSensitivity,
        machine: Machine,
        window: tuple[int, int] | None = None,
    ) -> None:
        self._simulation, time = simulation, plan.system.timeline
        self._known: dict[Event, EventCalls] = {}
        self._plan, self.system = plan, plan.system
        self._machine = machine
        self._sensitivity = sensitivity
        self._state = StateVector(simulation)
        length = window[1] if window else hyperperiod(time)
        self.period, self._begin = time.seconds(length), self._state.save()
        first = window[0] if window else length * math.ceil(behind_start(plan.system) / length)
        within = takewhile(lambda moment: moment.tick < first + length, plan)
        moments = [(tick, self._calls(event)) for tick, event in within]
        rest = None
        for k, (tick, event) in enumerate(each for each in moments if each[0] < first):
            event.whole(tick)
            if not window and k % PINNED == 0:
                rest = self._pin(rest)
        self._moments = [each for each in moments if first <= each[0]]
        self.events = len(self._moments)
        self._template = self._state.save()
        self.coordinates: Sequence[StateEntry] = self._state.coordinates(self._template)
        self.start = self._state.numbers(self._template)
        self._equal_keys: dict[tuple[Key, ...], tuple[Key, ...]] = {}
        self._keys: dict[int, tuple[Key, ...]] = self.work.keys.setdefault(self._course(), {})
        free = [i for i, c in enumerate(self.coordinates) if not discrete(c)]
        self._free = np.array(free, dtype=np.intp)

    def over(self, system: System, window: tuple[int, int]) -> LiftedMap:
        """The map of the same FMUs on the timeline of another `system`, from the first tick of a
        `window` on and over its length."""
        self._state.restore(self._begin)
        return LiftedMap(Plan(system), self._simulation, self._sensitivity, self._machine, window)

    def image(self, state: Vector) -> Vector:
        """F(state)."""
        self._state.put(self._template, state)
        for tick, event in self._moments:
            event.whole(tick)
        interrupt.raise_if_interrupted()
        return self._numbers()

    def recorded(self, point: Vector) -> tuple[float, list[tuple[Applied, ...]]]:
        """What each event of the period does to perturbations of a state at rest, equal ones as the
        same object; and the largest change of a state or input of an FMU within PINNED events,
        relative to max(1, |z|). The FMUs are put back to rest after these, so that nothing grows
        meanwhile."""
        self._state.put(self._template, point)
        self._sensitivity.begin()
        moving, moved, ran = self.moving, 0.0, False
        events, known = [], dict[tuple[int, ...], tuple[Applied, ...]]()
        found: dict[int, tuple[Applied, ...]] = {}
        for k, (tick, event) in enumerate(self._moments):
            keys = id(self._keys.get(k))  # equal ones are the same object
            if keys in found:  # at rest FMUs would change nothing
                event.of_holds(tick)
                events.append(found[keys])
            else:
                acting = self._record(k, tick, event)
                same = tuple(map(id, acting))
                repeats = any(isinstance(a.operation, Repeat) for a in acting)
                ran = ran or same not in known or repeats
                events.append(known.setdefault(same, acting))
                if k in self._keys:
                    found[id(self._keys[k])] = events[-1]
            if (k % PINNED == PINNED - 1 and ran) or k == self.events - 1:
                ran = False
                numbers = self._state.now()
                change = np.abs(numbers[moving] - point[moving])
                moved = max(moved, (change / np.maximum(1.0, np.abs(point[moving]))).max(initial=0))
                self._pin(point)
        self._numbers()
        interrupt.raise_if_interrupted()
        return float(moved), events

    def _record(self, k: int, tick: int, event: EventCalls) -> tuple[Applied, ...]:
        """What the k-th event of the period does, operation by operation."""
        sensitivity, known = self._sensitivity, iter(self._keys.get(k, ()))
        found = []
        for operation, call in zip(event.operations, event.each, strict=True):
            if isinstance(operation, Finish):  # steps are waited for one by one
                continue
            if not sensitivity.has_slopes(operation):
                call(tick)
            elif applied := sensitivity.applied(tick, operation, call, next(known, None)):
                found.append(applied)
        if k not in self._keys and all(map(sensitivity.is_regular, event.operations)):
            keys = tuple(key for key, _ in found)
            self._keys[k] = self._equal_keys.setdefault(keys, keys)
        return tuple(applied for _, applied in found)

    def _course(self) -> Hashable:
        """What the keys of all operations of a period depend on."""
        kinds = list(dict.fromkeys(event for _, event in self._moments))
        moments = tuple((tick, kinds.index(event)) for tick, event in self._moments)
        begin = self._state.integers().tobytes()
        return moments, tuple(event.operations for event in kinds), begin

    @property
    def work(self) -> SharedWork:
        return self._sensitivity.work

    def _pin(self, rest: Vector | None) -> Vector:
        """Puts FMUs and signals, not holds, back to what they are in `rest`, a state, and gives it;
        without one they stay."""
        template = self._state.save()
        numbers = self._state.numbers(template)
        if rest is None:
            return numbers
        fmus = len(self._state.parts(template)) - len(template.holds)
        fixed = sum(map(len, self._state.parts(template)[:fmus]))
        numbers[:fixed] = rest[:fixed]
        self._state.put(template, numbers)
        return rest

    @cached_property
    def moving(self) -> NDArray[np.intp]:
        """The states and inputs of FMUs, but for switches."""
        own = [c.kind == "fmu" and not c.inert and not discrete(c) for c in self.coordinates]
        return np.flatnonzero(own)

    def sizes(self) -> dict[str, int]:
        """How many numbers each owner has in the state."""
        parts = self._state.parts(self._template)
        return dict(zip(self._state.owners, map(len, parts), strict=True))

    def count(self, kind: type[OfFmu], fmu: str) -> int:
        """The number of operations of a kind on an FMU within a period."""
        return sum(
            isinstance(operation, kind) and operation.fmu == fmu
            for _, event in self._moments
            for operation in event.operations
        )

    @cached_property
    def counts(self) -> list[int]:
        """The coordinates that are numbers of constrained directions."""
        return [i for i, c in enumerate(self.coordinates) if discrete(c, {COUNT})]

    def counted(self, point: Vector, before: float) -> Vector:
        """The numbers of constrained directions that FMUs count in their next steps from a state at
        rest, where they had counted `before`."""
        state = point.copy()
        state[self.counts] = before
        self._state.put(self._template, state)
        each = (o for kind in self._known for o in flat(self._plan.block(kind)))
        steps = {o.fmu: o for o in each if isinstance(o, Step)}
        for fmu in {self.coordinates[i].owner for i in self.counts}:
            self._machine.joined([steps[fmu]])(self._moments[0][0])
        return self._state.now()[self.counts]

    def outputs(self, fmu: str) -> slice:
        """The indices of an FMU's outputs in the signal vector."""
        return self._simulation.signals.fmu(fmu)

    def set_parameters(self, values: Sequence[tuple[str, Scalar, float]]) -> None:
        """Sets tunable parameters, by FMU, from here on."""
        self._state.restore(self._template)
        for fmu, scalar, value in values:
            self._simulation.instances[fmu].connect([scalar], [0])(np.array([float(value)]))
        self._template = self._state.save()
        self._sensitivity.forget({fmu for fmu, _, _ in values}, {*self._set_held_gains(values)})

    def _set_held_gains(self, values: Sequence[tuple[str, Scalar, float]]) -> Iterator[str]:
        """Sets the gains of the spring-dampers that holds know of these FMUs, and gives the
        connections of these holds."""
        found = {(fmu, scalar.name): value for fmu, scalar, value in values}
        for c in self.system.connections:
            gains = self._simulation.holds[c.name].parts.gains if c.needs == "coupling" else None
            unit = self.system.fmu[c.source].description
            for spring in unit.springs if gains else ():
                if spring.force != c.source_port:
                    continue
                for name, own in zip((spring.stiffness, spring.damping), gains or (), strict=True):
                    for i, s in enumerate(unit.port(name, "parameter") if name else ()):
                        own[i] = found.get((c.source, s.name), own[i])
                yield c.name

    def directions(self, point: Vector) -> Iterator[Vector]:
        """Orthonormal directions in which the state can be moved from `point`, that of the
        coordinates that are no switches."""
        yield from self._sensitivity.closures.directions(self.coordinates, self._free, point)

    def _numbers(self) -> Vector:
        found = self._state.now()
        if len(found) != len(self.start):
            raise InputFault(
                "the number of samples that holds keep changes from period to period: the map "
                "needs constant latencies"
            )
        return found

    def _calls(self, event: Event) -> EventCalls:
        if event not in self._known:
            self._known[event] = EventCalls(self._instructions(event), self._machine)
        return self._known[event]

    def _instructions(self, kind: Event) -> tuple[Instruction, ...]:
        """The instructions of a kind of event, without those that write rows, measure energy or end
        a run."""
        every = instructions(self._plan.block(kind), self._simulation)
        return tuple(instruction for instruction in every if not instruction.observes)


def behind_start(system: System) -> int:
    """Ticks after which holds have all the samples that they keep: four steps of the slowest
    clock, and the longest latency."""
    time = system.timeline
    late = max((c.latency.max or c.latency.min for c in system.connections if c.latency), default=0)
    return 4 * max(clock.longest for clock in time.clocks) + math.ceil(late / time.base)


def long_enough(scene: Scene, system: System) -> System:
    """`system` with the timeline of a scene that lasts as long as its map needs."""
    needed = (behind_start(system) + 4 * hyperperiod(system.timeline)) * system.timeline.base
    duration = float(max(scene.duration, math.ceil(needed)))
    return replace(system, timeline=timeline(replace(scene, duration=duration)))


@contextmanager
def open_lifted_map(
    system: System, scene: Scene | None = None, work: SharedWork | None = None
) -> Iterator[LiftedMap]:
    """The lifted map of `system`, with its FMUs loaded; the state is perturbed within the loop
    closures of `scene`. work: what it shares with other maps of the same linkage.

    Raises InputFault where there is none: rates and latencies that vary, an FMU whose state cannot
    be read and whose response tells no linear system that could stand for it.
    """
    for c in system.connections:
        if c.latency and (c.latency.loss or c.latency.max not in (None, c.latency.min)):
            raise InputFault(
                f"delays of {c.name}: latency and loss are random, so that no two periods are "
                "alike; the map needs a constant latency"
            )
    tolerance = min(system.coupling.iteration.tolerance, CONVERGED)
    exactly = replace(system.coupling.iteration, method="newton", tolerance=tolerance)
    system = replace(system, coupling=replace(system.coupling, iteration=exactly))
    work = work or SharedWork()
    system = with_stand_ins(system, work)
    with ExitStack() as stack, np.errstate(invalid="ignore", over="ignore"):
        simulation = Simulation(system, RunResults(), stack)
        simulation.step_checks.clear()
        simulation.start()
        without_friction(simulation.holds.values())
        sensitivity = ForwardSensitivity(simulation, scene, work)
        yield LiftedMap(Plan(system), simulation, sensitivity, Machine(simulation))
