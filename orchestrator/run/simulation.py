"""The running counterpart of a system: FMU instances, signals, holds, meters and recorders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.network.remote_fmu import FRAME, FRAMES, Remote
from hapticlink.orchestrator.results.run_record import LinkCounts, Premises
from hapticlink.orchestrator.results.run_results import Recorder, RunResults, TableRows
from hapticlink.orchestrator.run.apply_changes import InputSetter
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import (
    CompiledHold,
    array,
    make_hold,
    make_holds,
)
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.concurrent_fmus import COLUMNS, SAMPLES, Side
from hapticlink.orchestrator.run.energy.balance import Balance
from hapticlink.orchestrator.run.energy.meter import Meters
from hapticlink.orchestrator.run.hold_parts import describe_hold
from hapticlink.orchestrator.run.initialize import StartOrder, initialize
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.step_check import StepCheck
from hapticlink.orchestrator.system.ports import power_across_rates
from hapticlink.orchestrator.system.system import Connection, InputChange, System

Call = Callable[[int], object]
Set = Callable[[Vector], object]


class Simulation(LoadedFmus):
    """The objects of a run, which `stack` closes, the FMUs `opened` if that is given; rows are
    written to `results`.

    setters set the inputs of an FMU from the signals: with held values, or `now` with the newest
    outputs of the sources.

    loop: the structure that the compiled loop, of `library`, works on; a Machine completes it.
    springs: the energy tanks. pace: the schedule of a run in real time. beside: the FMUs whose
    steps are then taken beside the loop, each with its clock; `sides` and `arrivals`, tables of
    their samples, are by clock, `frames`, tables of what went to other computers, by FMU. late:
    ticks by which the current event comes after its own. loops_at_start: whether start values
    depend on each other. changing: the timed changes, with what makes them. rows_before: of a run
    that goes on, the rows of each clock so far.
    """

    def __init__(
        self,
        system: System,
        results: RunResults,
        stack: ExitStack,
        opened: ExitStack | None = None,
        pace: Pace | None = None,
        goes_back: bool = True,
    ) -> None:
        self.library = library = load()
        super().__init__(system, opened or stack, results.log_path, pace is not None, goes_back)
        (opened or stack).callback(self._dismiss)
        self.pace = pace
        self.beside: Mapping[str, str] = {}
        self.sides: dict[str, Side] = {}
        self.arrivals: dict[str, Recorder] = {}
        self.frames: dict[str, Recorder] = {}
        self.rows_before: Mapping[str, int] = {}
        self.late = 0
        self.loops_at_start = False
        self._order: StartOrder | None = None
        self._results, self._stack = results, stack
        repeated = system.coupling.scheme == "iterated"
        self.step_checks = {
            fmu.name: StepCheck(library, self.instances[fmu.name])
            for fmu in (() if repeated else system.fmus)
            if fmu.name not in self.isolated
            and not fmu.hardware  # which goes no step back
            and StepCheck.possible(fmu.description)
        }
        self.loop = structures.Loop()
        self.loop.fill(self.signals, "values")
        self.holds, self.springs = make_holds(library, self.loop, self.signals)
        self.meters = Meters(library, self.signals)
        self.balance = Balance(self.signals)
        self._take_time()
        self.recorders: dict[str, Recorder] = {}
        self.changing: list[tuple[InputChange, InputSetter]] = []
        self.setters: dict[tuple[str, bool], Set] = {}

    def _take_time(self) -> None:
        time = self.system.timeline
        self.seconds, self.time = time.seconds, time.time
        self.meters.take_time(time)
        numerator, begin, denominator = time.ratio
        self.loop.fill(numerator=numerator, begin=begin, denominator=denominator)

    @cached_property
    def power_across_rates(self) -> list[str]:
        """Those of its systems, which start values and ticks do not change."""
        return power_across_rates(self.system)

    def _dismiss(self) -> None:
        for instance in self.instances.values():
            instance.dismiss()

    def start(self) -> None:
        """Initialise the FMUs, push the samples of t = 0 into the holds, bind the setters, and
        create the recorders."""
        self.loops_at_start = initialize(self, self.pace is not None, self._find_order)
        values = self.signals.values
        for hold in self.holds.values():
            hold.push(0, values[hold.places], 0)
        self.meters.start()
        self.balance.start()
        self.changing.clear()
        for change in self.system.changes:
            if change.fmu:
                self.changing.append((change, setter := InputSetter(change, self)))
                setter.wait(change.begin)
        if not self.setters:
            self._bind_setters()
        self._open_recorders()

    def _find_order(self) -> StartOrder:
        self._order = self._order or StartOrder.of(self)
        return self._order

    def begin_again(self, system: System, results: RunResults, stack: ExitStack) -> None:
        """Stand as before `start`, for a `system` that differs in start values and clocks alone.
        The memory of the loop is put back by whoever keeps it."""
        self.system, self._results, self._stack = system, results, stack
        self.signals.system = system
        self._take_time()
        for fmu in system.fmus:
            instance = self.instances[fmu.name]
            assert isinstance(instance, InProcess)
            instance.begin_again(fmu.starts)

    def _bind_setters(self) -> None:
        for fmu in self.system.fmus:
            incoming = self.system.into(fmu.name)
            if not incoming:
                continue
            self.setters[fmu.name, False] = self.setter(incoming, self.signals.places)
            if fmu.name in self.system.coupling.get_after_set:
                self.setters[fmu.name, True] = self.setter(incoming, self.signals.sources)

    def _open_recorders(self) -> None:
        # A run in real time may give a slower clock any rate up to the haptic one.
        time = self.system.timeline
        most = time.points(time.clocks[0]) if self.pace else 0
        for clock in time.clocks:
            end = time.points(clock) - 1
            before = self.rows_before.get(clock.name, 0)
            for name, every in self.system.recording.tables(clock.name).items():
                recorded, values = self.signals.recorded(name), self.signals.values
                texts = self.signals.texts(recorded)
                rows = TableRows(recorded, values, every, end, most, before, texts)
                recorder = self._results.recorder(name, rows)
                self.recorders[name] = self._stack.enter_context(recorder)
            recorder = self.recorders[clock.name]
            for fmu in self.system.fmus:
                if fmu.clock == clock.name:
                    self.instances[fmu.name].row_due = recorder.due
        for side in self.sides:
            self.arrivals[side] = self._beside(side, f"{side}_{SAMPLES}", COLUMNS)
        for name in self.remote if self.pace else ():
            self.frames[name] = self._beside(self.beside[name], f"{name}_{FRAMES}", FRAME)

    def make_hold(self, connection: Connection) -> CompiledHold:
        """A hold that a connection can have in place of its own."""
        parts = describe_hold(connection, self.signals)
        return make_hold(self.library, self.loop, parts, connection.name, self.signals)

    def _beside(self, clock: str, name: str, columns: Sequence[str]) -> Recorder:
        """A table of what runs beside the loop; its row of t = 0 is there at once."""
        recorded = {column: i for i, column in enumerate(columns)}
        most = self.system.timeline.points(self.system.timeline.clocks[0])
        recorder = self._results.recorder(
            name, TableRows(recorded, np.zeros(len(columns)), end=most)
        )
        self._stack.enter_context(recorder)
        recorder.row(0.0)
        return recorder

    def collect(self, clock: str, tick: int) -> None:
        """Take over the sample that the FMUs beside the loop have left for a tick, `late`."""
        late, arrived = self.seconds(self.late), self.arrivals[clock]
        computing = self.sides[clock].collect(late)
        arrived.values[:] = self.seconds(tick + self.late), late, computing
        arrived.row(self.time(tick))
        for name, frames in self.frames.items():
            if self.beside[name] == clock and self.pace:
                frames.values[:] = self.remote[name].frame(self.pace.now() - self.pace.c.origin)
                frames.row(self.time(tick))

    @property
    def remote(self) -> dict[str, Remote]:
        """The FMUs on other computers."""
        return {n: i for n, i in self.instances.items() if isinstance(i, Remote)}

    def links(self) -> dict[str, LinkCounts]:
        """Per connection with a latency, the number of samples sent, lost and overtaken."""
        links = {n: hold.link for n, hold in self.holds.items() if hold.link}
        return {n: LinkCounts(k.sent, k.lost, k.overtaken) for n, k in links.items()}

    def premises(self) -> dict[str, Premises]:
        """Per connection with a hold that observes its energy, what was outside its premises."""
        return {
            name: Premises(int(hold.premises[0]), int(hold.premises[1]), float(hold.premises[2]))
            for name, hold in self.holds.items()
            if hold.premises is not None
        }

    def overdrawn(self) -> dict[str, float]:
        """Per set position, the energy (J) that the tank of its spring was short of at most."""
        return {
            name: 0.0 - float(array(hold.tank.least, 1)[0])
            for name, hold in self.holds.items()
            if hold.tank and hold.parts.kind.needs == "spring" and hold.parts.row == 0
        }
