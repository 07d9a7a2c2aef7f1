"""Executes a plan, and says how the run ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from hapticlink.orchestrator.base import interrupt, plugins
from hapticlink.orchestrator.base.errors import (
    AsksToEnd,
    Diverged,
    Fault,
    FmuFault,
    Interrupted,
    describe_memory_error,
    describe_os_error,
)
from hapticlink.orchestrator.base.signal_names import DEVICE, WORKSPACE_MARGIN
from hapticlink.orchestrator.host import host_state
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import causal
from hapticlink.orchestrator.results.run_record import End, RecordedFault, RunEnding, Timings
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run import kept_runs, run_state
from hapticlink.orchestrator.run.compiled import lanes
from hapticlink.orchestrator.run.compiled.loop import NO_HALTS, CompiledLoop
from hapticlink.orchestrator.run.compiled.operation_records import Stop
from hapticlink.orchestrator.run.initialize import start_outside
from hapticlink.orchestrator.run.kept_runs import KeptRun, StartMemory
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun
from hapticlink.orchestrator.run.run_state import RunState
from hapticlink.orchestrator.run.save_times import Saving
from hapticlink.orchestrator.run.simulation import Simulation

Progress = Callable[[float], None]
Steps = Mapping[str, Any]
PAUSE = 0.02
"""Time (s) between two reports of progress."""


@dataclass
class Outcome:
    """How a run ended.

    end_time: time of the last row (s). fault: None for a regular end. asked: the FMU that requested
    the end, and how. published: whether the folder has rows of this run. wall_time, table_time (s):
    of the loop, of writing its tables as CSV. details: what is recorded of it besides.
    """

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | Interrupted | None = None
    asked: str = ""
    published: bool = False
    wall_time: float = 0.0
    table_time: float = 0.0
    details: RunEnding = field(default_factory=RunEnding)

    def set_reason(self, error: BaseException, results: RunResults) -> None:
        """Set why the run ended by `error`. Raises `error` again where it is a mistake of this
        package, of neither the scene nor the machine nor a plugin."""
        match error:
            case Stop():
                self.reason = "stop_when"
            case Ended():
                self.reason = str(error)
            case AsksToEnd(fmu=fmu, what=what):
                self.reason, self.asked = "terminated", f"{fmu} {what}"
            case Interrupted():
                known = error.time is not None
                self.reason = "interrupted"
                self.fault = error if known else Interrupted(when="before the run")
            case Diverged():
                self.reason, self.fault = "diverged", error
            case Fault():
                self.reason, self.fault = "fault", error
            case OSError():  # a full disk, most of all
                self.reason = "fault"
                self.fault = Fault(describe_os_error(error, results.folder))
            case MemoryError():
                self.reason = "fault"
                self.fault = Fault(describe_memory_error(error))
            case KeyboardInterrupt():  # a second signal does not wait for the end of the event
                self.reason, self.fault = "interrupted", Interrupted(results.last)
            case _:
                if (message := plugins.blame_plugin(error)) is None:
                    raise error
                self.reason, self.fault = "fault", Fault(message)

    def ending(self, build_time: float) -> RunEnding:
        """What run.json says of it; `build_time` (s) is that of the scene's FMUs."""
        fault = None
        if error := self.fault:
            time = getattr(error, "time", None)
            fault = RecordedFault(type(error).__name__, time, str(error))
        return replace(
            self.details,
            end=End(self.reason, self.end_time, self.asked),
            fault=fault,
            timings=replace(
                self.details.timings, build=build_time, run=self.wall_time, tables=self.table_time
            ),
        )


class _Run:
    """A run by its phases; `outcome` says how it ended so far."""

    def __init__(
        self,
        plan: Plan,
        results: RunResults,
        real_time: RealTimeRun | None = None,
        state: RunState | None = None,
        saving: Saving | None = None,
    ) -> None:
        self._plan, self._results, self._real_time = plan, results, real_time
        self._state, self._saving = state, saving
        self.outcome = Outcome()
        self._simulation: Simulation | None = None
        self.loop: CompiledLoop | None = None
        self._kept: KeptRun | None = None
        self._ended: KeptRun | None = None

    @contextmanager
    def noted(self) -> Iterator[None]:
        """An exception within the context is how the run ended."""
        try:
            yield
        except (Exception, KeyboardInterrupt) as error:
            self.outcome.set_reason(error, self._results)

    def begin(self, stack: ExitStack) -> CompiledLoop:
        """Stand before the first event; `stack` ends what is not kept."""
        plan, results, real_time = self._plan, self._results, self._real_time
        state = self._state
        apart = real_time or results.log_path or state or self._saving
        kept = None if apart else kept_runs.take(plan.system)
        self._opened = opened = stack.enter_context(kept.opened if kept else ExitStack())
        if kept:
            self._simulation, self.loop = kept.simulation, kept.loop
            self._kept = kept = kept.begin_again(plan, results, stack)
            self._plan = kept.plan
            return self.loop
        pace = real_time.pace if real_time else None
        self._simulation = simulation = Simulation(
            plan.system, results, stack, opened, pace, goes_back=False
        )
        if real_time:
            stack.enter_context(real_time.of(plan, simulation))
        self.loop = loop = CompiledLoop(plan, simulation)
        keeps = not apart and kept_runs.may_be_kept(simulation, results)
        memory = StartMemory(simulation) if keeps else None
        simulation.rows_before = state.content["rows"] if state else {}
        simulation.start()
        coming = plan.first_events[1]
        loop.events.prepare(real_time.kinds(coming) if real_time else coming)
        if state:
            run_state.restore(state, simulation, loop)
        if memory:
            memory.take_pointers()
            self._kept = KeptRun(plan, simulation, loop, memory, opened)
        for instance in simulation.instances.values():
            instance.begin()
        return loop

    def run_events(self, progress: Progress | None) -> None:
        """Run all events, write the tables, however the events end, and measure the time of
        both."""
        loop, simulation, outcome = self.loop, self._simulation, self.outcome
        assert loop
        assert simulation
        halts = self._saving.halts(simulation, loop) if self._saving else NO_HALTS
        begin = shown = perf_counter()

        def turn(tick: int) -> None:
            nonlocal shown
            time = self._plan.system.timeline.time(tick)
            interrupt.raise_if_interrupted(time)
            if self._real_time:
                self._real_time.turn(loop)
            if progress and perf_counter() - shown > PAUSE:
                shown = perf_counter()
                progress(time)

        try:
            # Tables are written with all the depth that there is.
            with host_state.restore_interpreter():
                loop.run(turn, halts)
        finally:
            for instance in simulation.instances.values():
                instance.rest()
            outcome.wall_time = perf_counter() - begin
            self._results.finish()
            outcome.table_time = perf_counter() - begin - outcome.wall_time

    def take_time(self, wall_time: float) -> None:
        """Note the time (s) of the loop where others ran beside it, and end the tables."""
        self.outcome.wall_time = wall_time
        self._results.finish()

    def end(self) -> None:
        """End the run of the FMUs, so that they may begin another."""
        if self._kept and self._kept.end():
            self._ended = replace(self._kept, opened=self._opened.pop_all())

    def conclude(self) -> Outcome:
        """How the run ended, when nothing but what may be kept is open."""
        outcome, simulation = self.outcome, self._simulation
        outcome.published = self._results.published
        if simulation:
            outcome.end_time = self._results.last
        if simulation and self.loop:
            outcome.details = _details(self._plan, simulation, self.loop, self._real_time)
            if self._ended:
                kept_runs.keep(self._ended)
            if outcome.fault is None and (outside := _find_start_outside(outcome, simulation)):
                outcome.reason, outcome.fault = "fault", outside
            if outcome.fault is None and (diverged := _judge_energy(outcome, simulation)):
                outcome.reason, outcome.fault = "diverged", diverged
        return outcome


def run(
    plan: Plan,
    results: RunResults,
    progress: Progress | None = None,
    real_time: RealTimeRun | None = None,
    state: RunState | None = None,
    saving: Saving | None = None,
) -> Outcome:
    """Execute the plan to its end or to the first fault; rows up to then are in `results`.

    progress is called with the simulated time (s) from time to time. real_time: see RealTimeRun.
    state: from which the run goes on. saving: when states are saved, and what saves them.
    """
    this = _Run(plan, results, real_time, state, saving)
    # Non-finite values are detected by 0 x NaN, for which numpy would warn.
    with (
        this.noted(),
        interrupt.defer_signals(),
        ExitStack() as stack,
        np.errstate(invalid="ignore", over="ignore"),
    ):
        interrupt.raise_if_interrupted()
        this.begin(stack)
        if real_time:
            stack.enter_context(real_time.pace.undisturbed())
        this.run_events(progress)
        this.end()
    outcome = this.conclude()
    if progress:
        progress(outcome.end_time)
    return outcome


def run_side_by_side(each: Sequence[tuple[Plan, RunResults]], steps: Steps) -> list[Outcome | None]:
    """Execute plans of systems with the same FMUs and ticks, all at once, with the outcomes of
    those that have the first one's operations and lasted; None for the others, which are to be run
    again alone. Raises Interrupted.

    steps: the functions of FMUs that take a step of all at once.
    """
    runs = [_Run(*one) for one in each]
    begun: list[tuple[_Run, CompiledLoop]] = []
    with (
        interrupt.defer_signals(),
        ExitStack() as stack,
        np.errstate(invalid="ignore", over="ignore"),
    ):
        interrupt.raise_if_interrupted()
        for one in runs:
            with suppress(Fault):
                begun.append((one, one.begin(stack.enter_context(ExitStack()))))
        begun = [(one, loop) for one, loop in begun if loop.goes_with(begun[0][1])]
        begin, time = perf_counter(), each[0][0].system.timeline.time
        ended = lanes.run_side_by_side(
            [loop for _, loop in begun],
            steps,
            lambda tick: interrupt.raise_if_interrupted(time(tick)),
        )
        share = (perf_counter() - begin) / max(len(begun), 1)
        lasted = [one for (one, _), why in zip(begun, ended, strict=True) if why is None]
        for one in lasted:
            one.take_time(share)
            one.end()
    return [one.conclude() if one in lasted else None for one in runs]


def _details(
    plan: Plan, simulation: Simulation, loop: CompiledLoop, real_time: RealTimeRun | None
) -> RunEnding:
    """What the objects of a run have counted and measured."""
    system, instances = plan.system, simulation.instances
    ages, energies = loop.delays(), simulation.meters.energies()
    errors = {name: check.errors() for name, check in simulation.step_checks.items()}
    across = simulation.power_across_rates
    return RunEnding(
        calls={name: i.calls for name, i in instances.items()},
        delays=ages,
        causal=causal(ages, system),
        links=simulation.links(),
        premises=simulation.premises(),
        overdrawn=simulation.overdrawn(),
        isolated=simulation.isolated,
        solvers={u.name: u.description.solver for u in system.fmus if u.description.solver},
        held_outputs={name: i.held for name, i in instances.items() if i.held},
        in_python=loop.in_python,
        real_time=real_time.report() if real_time else None,
        network={name: remote.network() for name, remote in simulation.remote.items()},
        timings=Timings(steps={name: i.step_time for name, i in instances.items() if i.step_time}),
        iterations=loop.iterations(),
        unstable=simulation.balance.unstable(energies),
        step_errors={name: estimate for name, estimate in errors.items() if estimate},
        energies={name: e for name, e in energies.items() if name in across} or "none",
        energies_within_a_rate={name: e for name, e in energies.items() if name not in across},
    )


def _left_workspace(outcome: Outcome, simulation: Simulation) -> str:
    """The device of which the handle left the workspace; "" for another end."""
    system, condition = simulation.system, simulation.system.ends_when
    if outcome.reason != "stop_when" or condition is None:
        return ""
    watched = f"{system.block(condition.fmu)}.{condition.variable}"
    return condition.fmu if watched == WORKSPACE_MARGIN else ""


def _find_start_outside(outcome: Outcome, simulation: Simulation) -> FmuFault | None:
    """The fault of a run that ended before its first step, since its handle cannot be there."""
    device = _left_workspace(outcome, simulation)
    own = device and simulation.system.fmu[device].description.block == DEVICE
    if own and not outcome.details.calls[device].get("step"):
        return start_outside(device, simulation)
    return None


def _judge_energy(outcome: Outcome, simulation: Simulation) -> Diverged | None:
    """The fault of a run that reached its end but has diverged; None if it has not."""
    device = _left_workspace(outcome, simulation)
    if device and (why := outcome.details.unstable):
        what = f"left its workspace, and {why}: the loop is unstable"
        remedy = "take higher rates, weaker gains, another coupling or hold"
        return Diverged(device, f"{what} ({remedy})", outcome.end_time, repeatable=True)
    return simulation.balance.judge(outcome.details.meters, outcome.end_time)
