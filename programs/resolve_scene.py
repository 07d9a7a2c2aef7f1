"""A scene resolved into the structures of the compiled loop, before anything has run: what a
program is made of."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.base.ticks import Frames, Timeline, exact
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.fmi.setter import Setter
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.dependency_order import whole_fmus
from hapticlink.orchestrator.plan.event_kinds import key_of, keyed_events
from hapticlink.orchestrator.plan.operations import Event, Instruction, Push
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.compiled import fmus as compiled_fmus
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.fmus import Memory
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.compiled.operation_records import Machine
from hapticlink.orchestrator.run.fetched_outputs import choose_fetched
from hapticlink.orchestrator.run.initialize import MOST, TOLERANCE, StartValues
from hapticlink.orchestrator.run.instructions import Move, Sample, instructions
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.system import Recording, System
from hapticlink.programs import refusals
from hapticlink.programs.foreign import Foreign
from hapticlink.programs.prepared_changes import (
    CLOCK,
    LEAST_RATE,
    NONE,
    PreparedChanges,
    prepare_changes,
)

NO_END = 2**61
"""The end (ticks) of a program's timeline: as far as its times are exact it has none."""
WINDOW = 64
"""Communication points of a periodic clock that a program holds at least."""
MAX_EVENTS = 1_000_000
"""Events in which all kinds are looked for: rates with a longer pattern have shown them by then."""
STEP_CHECKS, METER_ROWS = 32, 128
"""Rows of step checks and of energy meters before they are added up."""


@dataclass(frozen=True)
class Pattern:
    """The communication points of a clock: `n` of a window that begins again `ticks` later, 0 of a
    clock whose points are a list that ends."""

    n: int
    ticks: int


@dataclass(frozen=True)
class Resolved:
    """A scene's run as structures in memory, valid within the context of `resolve_scene`."""

    scene: Scene
    system: System
    simulation: Simulation
    outside: str | None
    """The block that is left out, whose outputs are inputs."""
    foreign: Mapping[str, Foreign]
    """The FMUs of others among the members."""
    roots: list[tuple[str, str, int, int]]
    """Name, type, address and count of the structures from which all others are reached."""
    counts: Mapping[str, int]
    """The numbers of entries of arrays that no structure has."""
    start: tuple[int, int]
    """The operations that give holds and meters the samples of t = 0."""
    start_fmus: list[int]
    """The index, among the loop's FMUs, of that of each setter of initialisation."""
    fmus: list[str]
    """The FMUs in the order of the loop."""
    holds: list[str]
    """The connections of the loop's holds, in its order."""
    meters: list[str]
    """Those of its energy meters."""
    tables: list[str]
    """The clocks of its tables."""
    patterns: list[Pattern]
    """Of each clock."""
    recorded: frozenset[str]
    """The outputs, `fmu.output`, that the scene records."""
    start_values: NDArray[np.float64]
    """The vector of signals at t = 0."""
    changes: PreparedChanges
    """What it can be changed to while it runs."""
    kept: object
    """What the structures lie in."""

    @property
    def members(self) -> list[str]:
        """The blocks that the program holds."""
        return [fmu.name for fmu in self.system.fmus if fmu.name != self.outside]

    @property
    def signal_order(self) -> list[str]:
        """The FMUs in the order of their outputs among the signals."""
        signals = self.simulation.signals
        return sorted((f.name for f in self.system.fmus), key=lambda name: signals.fmu(name).start)

    def instance(self, fmu: str) -> InProcess:
        """The loaded FMU of a block."""
        instance = self.simulation.instances[fmu]
        assert isinstance(instance, InProcess)
        return instance


@contextmanager
def resolve_scene(
    scene: Scene, outside: str | None = None, changing: bool = False
) -> Iterator[Resolved]:
    """The structures of a scene's run. outside: the block to leave out. changing: holds and rates
    can be changed while the program runs. Raises InputFault, with what stands in the way, for a
    scene that cannot be a program."""
    scene = replace(scene, record=replace(scene.record, every=1), isolate=False)
    refusals.of_scene(scene)
    with build_system(scene) as every, ExitStack() as stack:
        fetched = choose_fetched(every)
        system = replace(fetched, recording=Recording(outputs=()))
        foreign = refusals.of_system(system, outside, scene)
        plan = Plan(system)
        plan.check()
        rooms = _rooms(plan, scene.title)
        stack.enter_context(np.errstate(invalid="ignore", over="ignore"))
        simulation = Simulation(system, RunResults(), stack)
        refusals.of_simulation(simulation, scene.title)
        simulation.start()
        if simulation.loops_at_start and not _settles(system):
            why = "an algebraic loop at t = 0 is solved by Newton's method, in Python"
            refusals.refuse(scene.title, [why])
        recorded = _find_recorded(fetched)
        yield _resolve(scene, plan, simulation, outside, foreign, rooms, recorded, changing)


def _settles(system: System) -> bool:
    """Whether start values agree after they are passed on from block to block as often as `settle`
    of program.c does."""
    with ExitStack() as stack:
        fmus = LoadedFmus(system, stack)
        start, values = StartValues(fmus), fmus.signals.values
        every = start.evaluations(whole_fmus(system))
        for instance in fmus.instances.values():
            instance.enter_initialization(0.0, system.timeline.seconds(system.timeline.end))
            instance.read()
        for _ in range(MOST):
            before = values.copy()
            for each in every:
                start.evaluate([each])
            if np.isclose(values, before, TOLERANCE, TOLERANCE, equal_nan=True).all():
                return True
    return False


def _find_recorded(system: System) -> frozenset[str]:
    outputs = (f"{fmu.name}.{s.name}" for fmu in system.fmus for s in fmu.description.outputs)
    return frozenset(outputs if (chosen := system.recording.outputs) is None else chosen)


def _rooms(plan: Plan, title: str) -> dict[str, int]:
    """The samples in transit, and those of energy accounts, for which each hold needs room: twice
    as many as a run of the scene's duration."""
    if not any(c.latency for c in plan.system.connections) and not _accounts(plan.system):
        return {}
    with ExitStack() as stack, np.errstate(invalid="ignore", over="ignore"):
        simulation = Simulation(plan.system, RunResults(), stack)
        refusals.of_simulation(simulation, title)
        loop = CompiledLoop(plan, simulation)
        simulation.start()
        with suppress(FmuFault):  # a scene that fails has the rooms up to there
            loop.run(lambda tick: None)
        return {name: 2 * hold.room for name, hold in simulation.holds.items()}


def _accounts(system: System) -> bool:
    """Whether a hold of the system observes its energy."""
    return any(HOLDS[c.hold].needs == "power" for c in system.connections if c.hold)


def _resolve(
    scene: Scene,
    plan: Plan,
    simulation: Simulation,
    outside: str | None,
    foreign: Mapping[str, Foreign],
    rooms: Mapping[str, int],
    recorded: frozenset[str],
    changing: bool,
) -> Resolved:
    start_values = simulation.signals.values.copy()
    _as_before_the_start(simulation, outside, changing)
    system = simulation.system
    machine = Machine(simulation)
    for name, room in rooms.items():
        while simulation.holds[name].room < room:
            simulation.holds[name].grow()
    samples: list[Instruction] = [Push(c.name) for c in system.connections if c.hold]
    for name in simulation.meters.of:
        samples += [Sample(name, 0), Move(name, 0)]
    start = machine.block(samples)
    kinds = dict[Event, tuple[int, int]]()
    for event in _kinds(system.timeline):
        every = instructions(plan.block(event), simulation)
        kinds[event] = machine.block([i for i in every if getattr(i, "fmu", "") != outside])
    possible = prepare_changes(machine, simulation, plan, kinds) if changing else NONE
    machine.publish()
    left = machine.in_python.items()
    refusals.refuse(scene.title, (f"{operation}: {why}" for operation, why in left))
    events = EventData(system.timeline, kinds, possible)
    fmus, memory = machine.names("fmu"), Memory()
    into = [n for n in fmus if any(c.target == n for c in system.connections)]
    setters = (structures.Setter * len(into))()
    kept = [_start_setter(simulation, fmu, c, memory) for c, fmu in zip(setters, into, strict=True)]
    rows = _newest_rows(machine, simulation)
    return Resolved(
        scene=scene,
        system=system,
        simulation=simulation,
        outside=outside,
        foreign=foreign,
        roots=[
            ("loop", "Loop", ctypes.addressof(machine.loop), 1),
            ("events", "Events", ctypes.addressof(events.c), 1),
            ("start_setters", "Setter", ctypes.addressof(setters), len(into)),
            ("alternatives", "Hold *", possible.address, len(possible.choices)),
        ],
        counts=machine.counts() | {"n_values": len(simulation.signals.values)},
        start=start,
        start_fmus=[fmus.index(fmu) for fmu in into],
        fmus=fmus,
        holds=machine.names("hold"),
        meters=machine.names("meter"),
        patterns=events.patterns,
        recorded=recorded,
        start_values=start_values,
        changes=possible,
        tables=machine.names("table"),
        kept=(machine, events, setters, kept, memory, rows),
    )


def _as_before_the_start(simulation: Simulation, outside: str | None, changing: bool) -> None:
    """Takes back what `start` has set, which a program does itself, except for the outputs of the
    block that is left out; checks and meters have the rows that a program keeps."""
    values = simulation.signals.values
    start = values.copy()
    values[:] = 0.0
    if outside:
        values[simulation.signals.fmu(outside)] = start[simulation.signals.fmu(outside)]
    for instance in simulation.instances.values():
        ctypes.memset(ctypes.addressof(instance.place), 0, ctypes.sizeof(instance.place))
        instance.place.waiting = math.inf  # no setting waits for a step
    for hold in simulation.holds.values():
        if hold.link:  # whose first sample is known at once, and takes no number from its generator
            hold.link.started = hold.link.newest = hold.link.n = 0
    for check in simulation.step_checks.values():
        check.estimates = check.estimates[:STEP_CHECKS]
        check.times, check.weights = check.times[:STEP_CHECKS], check.weights[:STEP_CHECKS]
        check.take_rows()
    for connection, meter in simulation.meters.of.items():
        rows = max(METER_ROWS, 4 * _steps_apart(simulation.system, connection, changing))
        for name in ("stamps", "samples", "ticks", "moves", "efforts"):
            array = getattr(meter, name)
            setattr(meter, name, np.zeros((rows, *array.shape[1:]), array.dtype))
        meter.counts[:], meter.c.full, meter.c.least = 0, rows, rows
        meter.take_rows()


def _steps_apart(system: System, connection: str, changing: bool) -> int:
    """The largest number of steps that one end of a connection takes within a step of the other."""
    c, timeline = system.connection[connection], system.timeline
    clocks = [timeline.clock(system.fmu[fmu].clock) for fmu in (c.source, c.target)]
    longest = max(clock.longest for clock in clocks)
    if changing and any(clock.name == CLOCK for clock in clocks):
        longest = max(longest, math.ceil(1 / (exact(LEAST_RATE) * timeline.base)))
    return longest // min(clock.shortest for clock in clocks)


def _newest_rows(machine: Machine, simulation: Simulation) -> list[object]:
    """Gives each table room for one row: all outputs of its clock at the newest event. What is
    returned has to be kept."""
    arrays: list[object] = []
    n = len(machine.names("table"))
    tables = (structures.Table * n).from_address(machine.loop.tables)
    for c, clock in zip(tables, machine.names("table"), strict=True):
        outputs = simulation.signals.values[simulation.signals.clock(clock)]
        row, numbers = np.zeros(1 + len(outputs)), np.array([0, 1], np.int64)
        c.block, c.view, c.where, c.n = row.ctypes.data, outputs.ctypes.data, None, len(outputs)
        c.rows, c.room = numbers[:1].ctypes.data, numbers[1:].ctypes.data
        arrays += [row, numbers]
    return arrays


def _start_setter(simulation: Simulation, fmu: str, c: structures.Setter, memory: Memory) -> Setter:
    """Fills `c`, which sets the inputs of an FMU in initialisation mode, from all connections. What
    is returned has to be kept."""
    instance = simulation.instances[fmu]
    assert isinstance(instance, InProcess)
    incoming = [c for c in simulation.system.connections if c.target == fmu]
    setter = simulation.setter(incoming, simulation.signals.places)
    assert isinstance(setter, Setter)
    compiled_fmus.of_setter(setter, instance, c, memory)
    return setter


def _kinds(timeline: Timeline) -> list[Event]:
    """All kinds of events of a timeline without an end: up to where the pattern of its periodic
    clocks repeats, or a list of communication points ends."""
    ends = [clock.starts[-1] for clock in timeline.clocks if isinstance(clock.starts, tuple)]
    clocks = tuple(replace(clock, starts=_endless(clock.starts)) for clock in timeline.clocks)
    repeats = math.lcm(*(_repeats(clock.starts) for clock in clocks))
    until = min(ends) if ends else max(clock.first for clock in clocks) + repeats
    endless = replace(timeline, clocks=clocks, end=NO_END)
    return [*keyed_events(endless, until - 1, MAX_EVENTS)[1]]


def _endless(starts: Sequence[int]) -> Sequence[int]:
    if isinstance(starts, range):
        return range(0, NO_END, starts.step)
    return starts.endless if isinstance(starts, Frames) else starts


def _repeats(starts: Sequence[int]) -> int:
    """The ticks after which the spacing of communication points repeats; 1 of a list."""
    if isinstance(starts, range):
        return starts.step
    return starts.repeats if isinstance(starts, Frames) else 1


class EventData:
    """The structure of the event loop, with the kinds of events and the blocks of their operations,
    and the first communication points of each clock with their patterns."""

    def __init__(
        self, timeline: Timeline, kinds: Mapping[Event, tuple[int, int]], possible: PreparedChanges
    ) -> None:
        n, n_kinds = len(timeline.clocks), len(kinds) + possible.n_kinds
        self.patterns: list[Pattern] = []
        self._windows: list[object] = []
        self._clocks = (structures.Clock * n)()
        for c, clock in zip(self._clocks, timeline.clocks, strict=True):
            window, pattern = _window(clock.starts)
            self._windows.append(window)
            self.patterns.append(pattern)
            c.starts, c.n = window.ctypes.data, len(window)
        self._keys = np.full((n_kinds, 1 + n), -1, np.int64)  # spare ones are no event's
        self._key, self._blocks = np.zeros(1 + n, np.int64), (structures.Block * n_kinds)()
        for key, block, (event, span) in zip(self._keys, self._blocks, kinds.items(), strict=False):
            key[:] = key_of(timeline, event)
            block.first, block.last = span
        for i, block in enumerate(self._blocks[len(kinds) :]):
            block.first = block.last = possible.spare + i * possible.most
        self.c = c = structures.Events()
        c.clocks, c.n_clocks, c.end = ctypes.addressof(self._clocks), n, NO_END
        c.keys, c.key = self._keys.ctypes.data, self._key.ctypes.data
        c.kinds, c.n_kinds = ctypes.addressof(self._blocks), n_kinds
        c.at.op = -1


def _window(starts: Sequence[int]) -> tuple[NDArray[np.int64], Pattern]:
    """The first communication points of a clock: 0, and whole patterns from there on, or from the
    first one after 0 on where that has a phase."""
    if isinstance(starts, tuple):
        return np.array(starts, np.int64), Pattern(0, 0)
    length, endless = starts.round if isinstance(starts, Frames) else 1, _endless(starts)
    several = -(-WINDOW // length)
    points = np.array(endless[: 2 + several * length], np.int64)
    phase = points[1] - points[0] != points[1 + length] - points[length]
    pattern = Pattern(1 + several * length, several * _repeats(starts))
    return points if phase else points[:-1].copy(), pattern
