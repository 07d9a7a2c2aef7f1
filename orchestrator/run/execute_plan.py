"""Executes a plan, and says how the run ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from hapticlink.orchestrator.base import interrupt, plugins
from hapticlink.orchestrator.base.errors import (
    AsksToEnd,
    Diverged,
    Fault,
    Interrupted,
    describe_memory_error,
    describe_os_error,
)
from hapticlink.orchestrator.base.signal_names import WORKSPACE_MARGIN
from hapticlink.orchestrator.host import host_state
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import causal
from hapticlink.orchestrator.results.run_record import End, RecordedFault, RunEnding, Timings
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run import kept_runs, run_state
from hapticlink.orchestrator.run.compiled.loop import NO_HALTS, CompiledLoop, Halt
from hapticlink.orchestrator.run.compiled.operation_records import Stop
from hapticlink.orchestrator.run.kept_runs import KeptRun, StartMemory
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun
from hapticlink.orchestrator.run.run_state import RunState
from hapticlink.orchestrator.run.save_times import Saving
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.system.ports import power_across_rates

Progress = Callable[[float], None]
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
    outcome = Outcome()
    simulation: Simulation | None = None
    loop: CompiledLoop | None = None
    ended: KeptRun | None = None
    try:
        # Non-finite values are detected by 0 x NaN, for which numpy would warn.
        with (
            interrupt.defer_signals(),
            ExitStack() as stack,
            np.errstate(invalid="ignore", over="ignore"),
        ):
            interrupt.raise_if_interrupted()
            apart = real_time or results.log_path or state or saving
            kept = None if apart else kept_runs.take(plan.system)
            opened = stack.enter_context(kept.opened if kept else ExitStack())
            if kept:
                simulation, loop = kept.simulation, kept.loop
                kept = kept.begin_again(plan, results, stack)
                plan = kept.plan
            else:
                pace = real_time.pace if real_time else None
                simulation = Simulation(plan.system, results, stack, opened, pace, goes_back=False)
                if real_time:
                    stack.enter_context(real_time.of(plan, simulation))
                loop = CompiledLoop(plan, simulation)
                keeps = not apart and kept_runs.may_be_kept(simulation, results)
                memory = StartMemory(simulation) if keeps else None
                simulation.rows_before = state.content["rows"] if state else {}
                simulation.start()
                coming = loop.events.coming()
                loop.events.prepare(real_time.kinds(coming) if real_time else coming)
                if state:
                    run_state.restore(state, simulation, loop)
                if memory:
                    memory.take_pointers()
                    kept = KeptRun(plan, simulation, loop, memory, opened)
            if real_time:
                stack.enter_context(real_time.pace.undisturbed())
            halts = saving.halts(simulation, loop) if saving else NO_HALTS
            _run_events(plan, loop, results, outcome, progress, real_time, halts)
            if kept and kept.end():
                ended = replace(kept, opened=opened.pop_all())
    except (Exception, KeyboardInterrupt) as error:
        outcome.set_reason(error, results)
    outcome.published = results.published
    if simulation:
        outcome.end_time = results.last
    if simulation and loop:
        outcome.details = _details(plan, simulation, loop, real_time)
        if ended:
            kept_runs.keep(ended)
        if outcome.fault is None and (diverged := _judge_energy(outcome, simulation)):
            outcome.reason, outcome.fault = "diverged", diverged
    if progress:
        progress(outcome.end_time)
    return outcome


def _run_events(
    plan: Plan,
    loop: CompiledLoop,
    results: RunResults,
    outcome: Outcome,
    progress: Progress | None,
    real_time: RealTimeRun | None,
    halts: Iterator[Halt],
) -> None:
    """Run all events, write the tables, however the events end, and measure the time of both."""
    begin = shown = perf_counter()

    def turn(tick: int) -> None:
        nonlocal shown
        time = plan.system.timeline.seconds(tick)
        interrupt.raise_if_interrupted(time)
        if real_time:
            real_time.turn(loop)
        if progress and perf_counter() - shown > PAUSE:
            shown = perf_counter()
            progress(time)

    try:
        with (
            host_state.restore_interpreter()
        ):  # tables are written with all the depth that there is
            loop.run(turn, halts)
    finally:
        outcome.wall_time = perf_counter() - begin
        results.finish()
        outcome.table_time = perf_counter() - begin - outcome.wall_time


def _details(
    plan: Plan, simulation: Simulation, loop: CompiledLoop, real_time: RealTimeRun | None
) -> RunEnding:
    """What the objects of a run have counted and measured."""
    system, instances = plan.system, simulation.instances
    ages, energies = loop.delays(), simulation.meters.energies()
    errors = {name: check.errors() for name, check in simulation.step_checks.items()}
    across = power_across_rates(system)
    return RunEnding(
        calls={name: i.calls for name, i in instances.items()},
        delays=ages,
        causal=causal(ages, system),
        links=simulation.links(),
        premises=simulation.premises(),
        overdrawn=simulation.overdrawn(),
        isolated=simulation.isolated,
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


def _judge_energy(outcome: Outcome, simulation: Simulation) -> Diverged | None:
    """The fault of a run that reached its end but has diverged; None if it has not."""
    system, condition = simulation.system, simulation.system.ends_when
    if (
        outcome.reason == "stop_when"
        and condition
        and f"{system.block(condition.fmu)}.{condition.variable}" == WORKSPACE_MARGIN
        and (why := outcome.details.unstable)
    ):
        what = f"left its workspace, and {why}: the loop is unstable"
        remedy = "take higher rates, weaker gains, another coupling or hold"
        return Diverged(condition.fmu, f"{what} ({remedy})", outcome.end_time, repeatable=True)
    return simulation.balance.judge(outcome.details.meters, outcome.end_time)
