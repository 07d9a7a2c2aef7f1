"""The running counterpart of a system: FMU instances, signals, holds, meters and recorders."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.passive_set_position import PassiveSetPosition
from hapticlink.orchestrator.network.remote_fmu import FRAME, FRAMES, Remote
from hapticlink.orchestrator.results.run_record import LinkCounts, Premises
from hapticlink.orchestrator.results.run_results import Recorder, RunResults
from hapticlink.orchestrator.run import apply_timed_events
from hapticlink.orchestrator.run.concurrent_fmus import COLUMNS, SAMPLES, Side
from hapticlink.orchestrator.run.energy.balance import Balance
from hapticlink.orchestrator.run.energy.meter import Meters
from hapticlink.orchestrator.run.initialize import initialize
from hapticlink.orchestrator.run.make_holds import make_holds
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.step_check import StepCheck
from hapticlink.orchestrator.system.system import System

Call = Callable[[int], object]
Set = Callable[[Vector], object]


class Simulation(LoadedFmus):
    """The objects of a run, which `stack` closes; rows are written to `results`.

    setters set the inputs of an FMU from the signals: with held values, or `now` with the newest
    outputs of the sources.

    pace: the schedule of a run in real time. beside: the FMUs whose steps are then taken beside the
    loop, each with its clock; `sides` and `arrivals`, tables of their samples, are by clock,
    `frames`, tables of what went to other computers, by FMU. late: ticks by which the current event
    comes after its own. swept: whether sweeps alone have initialised the FMUs.
    """

    def __init__(self, system: System, results: RunResults, stack: ExitStack) -> None:
        super().__init__(system, stack)
        stack.callback(self._dismiss)
        self.pace: Pace | None = None
        self.beside: Mapping[str, str] = {}
        self.sides: dict[str, Side] = {}
        self.arrivals: dict[str, Recorder] = {}
        self.frames: dict[str, Recorder] = {}
        self.late = 0
        self.swept = False
        self.seconds = system.timeline.seconds
        self._results, self._stack = results, stack
        repeated = system.coupling.scheme == "iterated"
        self.step_checks = {
            fmu.name: StepCheck(self.instances[fmu.name])
            for fmu in (() if repeated else system.fmus)
            if fmu.name not in self.isolated and StepCheck.possible(fmu.description)
        }
        self.holds, self.springs = make_holds(self.signals)
        self.meters = Meters(self.signals)
        self.balance = Balance(self.signals)
        self.recorders: dict[str, Recorder] = {}
        self.setters: dict[tuple[str, bool], Set] = {}

    def _dismiss(self) -> None:
        for instance in self.instances.values():
            instance.dismiss()

    def start(self) -> None:
        """Initialise the FMUs, push the samples of t = 0 into the holds, bind the setters, and
        create the recorders."""
        self.swept = initialize(self)
        values = self.signals.values
        for c in self.system.connections:
            if c.hold:
                self.holds[c.name].push(0, values[self.signals.sources(c)], 0)
        self.meters.start()
        self.balance.start()
        apply_timed_events.arm(self)
        for fmu in self.system.fmus:
            incoming = self.system.into(fmu.name)
            if not incoming:
                continue
            self.setters[fmu.name, False] = self.setter(incoming, self.signals.places)
            if fmu.name in self.system.coupling.get_after_set:
                self.setters[fmu.name, True] = self.setter(incoming, self.signals.sources)
        for clock in self.system.timeline.clocks:
            recorded, every = self.signals.recorded(clock.name), self.system.recording.every
            end = self.system.timeline.points(clock) - 1
            recorder = self._results.recorder(clock.name, recorded, values, every, end)
            self.recorders[clock.name] = self._stack.enter_context(recorder)
            for fmu in self.system.fmus:
                if fmu.clock == clock.name:
                    self.instances[fmu.name].row_due = recorder.due
        for side in self.sides:
            self.arrivals[side] = self._beside(f"{side}_{SAMPLES}", COLUMNS)
        for name in self.remote if self.pace else ():
            self.frames[name] = self._beside(f"{name}_{FRAMES}", FRAME)

    def _beside(self, name: str, columns: Sequence[str]) -> Recorder:
        """A table of what runs beside the loop; its row of t = 0 is there at once."""
        recorded = {column: i for i, column in enumerate(columns)}
        recorder = self._results.recorder(name, recorded, np.zeros(len(columns)))
        self._stack.enter_context(recorder)
        recorder.row(0.0)
        return recorder

    def collect(self, clock: str, tick: int) -> None:
        """Take over the sample that the FMUs beside the loop have left for a tick, `late`."""
        late, arrived = self.seconds(self.late), self.arrivals[clock]
        computing = self.sides[clock].collect(late)
        arrived.values[:] = self.seconds(tick + self.late), late, computing
        arrived.row(self.seconds(tick))
        for name, frames in self.frames.items():
            if self.beside[name] == clock and self.pace:
                frames.values[:] = self.remote[name].frame(self.pace.now() - self.pace.c.origin)
                frames.row(self.seconds(tick))

    @property
    def remote(self) -> dict[str, Remote]:
        """The FMUs on other computers."""
        return {n: i for n, i in self.instances.items() if isinstance(i, Remote)}

    def links(self) -> dict[str, LinkCounts]:
        """Per connection with a latency, the number of samples sent, lost and overtaken."""
        links = {n: getattr(h, "link", None) for n, h in self.holds.items()}
        return {n: LinkCounts(k.sent, k.lost, k.overtaken) for n, k in links.items() if k}

    def premises(self) -> dict[str, Premises]:
        """Per connection with a hold that observes its energy, what was outside its premises."""
        return {
            name: Premises(int(steps), int(outside), float(stake))
            for name, own in self._without_wrappers()
            if isinstance(own, Account)
            for steps, outside, stake in [own.premises]
        }

    def overdrawn(self) -> dict[str, float]:
        """Per set position, the energy (J) that the tank of its spring was short of at most."""
        return {
            name: 0.0 - float(own.tank.least[0])
            for name, own in self._without_wrappers()
            if isinstance(own, PassiveSetPosition) and own.row == 0
        }

    def _without_wrappers(self) -> Iterator[tuple[str, Hold]]:
        for name, hold in self.holds.items():
            while inner := getattr(hold, "own", None) or getattr(hold, "hold", None):
                hold = inner
            yield name, hold
