"""Executes a plan, and says how the run ended."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from hapticlink.orchestrator.base import interrupt, plugins
from hapticlink.orchestrator.base.faults import AsksToEnd, Diverged, Fault, Interrupted
from hapticlink.orchestrator.base.loop_names import WORKSPACE_MARGIN
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import Delay, delays
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.run.bind_operations import Stop
from hapticlink.orchestrator.run.compiled.library import Unavailable, load
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.compiled.machine import too_long
from hapticlink.orchestrator.run.energy.balance import unstable
from hapticlink.orchestrator.run.energy.meter import Energy
from hapticlink.orchestrator.run.fixed_point import Iterations
from hapticlink.orchestrator.run.python_loop import PythonLoop
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun, kinds
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.run.step_check import StepErrors
from hapticlink.orchestrator.run.step_control import Steps

Progress = Callable[[float], None]
PAUSE = 0.02
"""Time (s) between two reports of progress."""


@dataclass
class Outcome:
    """How a run ended.

    end_time: time of the last row (s). fault: None for a regular end. asked: the FMU that requested
    the end, and how. published: whether the folder has rows of this run. wall_time, table_time,
    step_time (s): of the loop, of writing its tables as CSV, of doStep by FMU. calls: counts by FMU
    and call. isolated: why an FMU ran in a process of its own. held: how often outputs of an FMU
    were held since they were not finite. smaller_steps: number of steps repeated with smaller
    ones. in_python: the operations that were carried out in Python rather than in C, "everything"
    if there was no compiled loop, with the reason. real_time: what became of a run in real time.
    """

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | None = None
    asked: str = ""
    published: bool = False
    wall_time: float = 0.0
    table_time: float = 0.0
    step_time: dict[str, float] = field(default_factory=dict)
    calls: dict[str, dict[str, int]] = field(default_factory=dict)
    isolated: dict[str, str] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    smaller_steps: dict[str, int] = field(default_factory=dict)
    delays: dict[str, Delay] = field(default_factory=dict)
    energies: dict[str, Energy] = field(default_factory=dict)
    links: dict[str, dict[str, int]] = field(default_factory=dict)
    iterations: Iterations | None = None
    steps: dict[str, Steps] = field(default_factory=dict)
    step_errors: dict[str, StepErrors] = field(default_factory=dict)
    in_python: dict[str, str] = field(default_factory=dict)
    real_time: dict[str, Any] | None = None


def run(
    plan: Plan,
    results: RunFolder,
    progress: Progress | None = None,
    real_time: RealTimeRun | None = None,
) -> Outcome:
    """Execute the plan to its end or to the first fault; rows up to then are in `results`.

    progress is called with the simulated time (s) from time to time. real_time: see RealTimeRun.
    """
    outcome = Outcome()
    simulation: Simulation | None = None
    try:
        # Non-finite values are detected by 0 x NaN, for which numpy would warn.
        with interrupt.held(), ExitStack() as stack, np.errstate(invalid="ignore", over="ignore"):
            interrupt.check()
            simulation = Simulation(plan.system, results, stack)
            if real_time:
                stack.enter_context(real_time.of(plan, simulation))
            loop = _loop(plan, simulation)
            simulation.start()
            if real_time:
                loop.prepare(kinds(plan))
                stack.enter_context(real_time.pace.undisturbed())
            begin = shown = perf_counter()

            def turn(tick: int) -> None:
                nonlocal shown
                time = plan.system.timeline.seconds(tick)
                interrupt.check(time)
                if real_time:
                    real_time.turn(loop)
                if progress and perf_counter() - shown > PAUSE:
                    shown = perf_counter()
                    progress(time)

            try:
                loop.run(turn)
            finally:
                results.flush()
                outcome.wall_time = perf_counter() - begin
                results.finish()
                outcome.table_time = perf_counter() - begin - outcome.wall_time
    except Stop:
        outcome.reason = "stop_when"
    except Ended as end:
        outcome.reason = str(end)
    except AsksToEnd as end:
        outcome.reason, outcome.asked = "terminated", f"{end.fmu} {end.what}"
    except Fault as fault:
        outcome.reason, outcome.fault = _reason(fault), fault
    except OSError as error:  # a full disk, most of all
        full = Fault(f"{results.folder}: {error.strerror or error}")
        outcome.reason, outcome.fault = "fault", full
    except Exception as error:
        if (told := plugins.blamed(error)) is None:
            raise
        outcome.reason, outcome.fault = "fault", Fault(told)
    except KeyboardInterrupt:  # a second signal does not wait for the end of the event
        outcome.reason, outcome.fault = "interrupted", Interrupted(results.last)
    finally:
        outcome.published = results.published
        if simulation:
            outcome.end_time = results.last
            outcome.step_time = {n: i.step_time for n, i in simulation.instances.items()}
            outcome.isolated = simulation.isolated
            outcome.held = {n: i.held for n, i in simulation.instances.items() if i.held}
            smaller = {n: i.smaller_steps for n, i in simulation.instances.items()}
            outcome.smaller_steps = {n: s for n, s in smaller.items() if s}
            outcome.energies = simulation.meters.energies()
            outcome.links = simulation.links()
            found = {n: check.errors() for n, check in simulation.step_checks.items()}
            outcome.step_errors = {n: errors for n, errors in found.items() if errors}
            outcome.delays = delays(plan, loop.complete)
            outcome.calls = {n: i.calls for n, i in simulation.instances.items()}
            outcome.steps = loop.steps()
            outcome.iterations = loop.iterations()
            outcome.in_python = loop.in_python
            outcome.real_time = real_time.report() if real_time else None
            if outcome.fault is None and (why := _judged(outcome, simulation)):
                outcome.reason, outcome.fault = "diverged", why
    if progress:
        progress(outcome.end_time)
    return outcome


def _judged(outcome: Outcome, simulation: Simulation) -> Diverged | None:
    """The fault of a run that reached its end but has diverged; None if it has not."""
    system, condition = simulation.system, simulation.system.ends_when
    if (
        outcome.reason == "stop_when"
        and condition
        and f"{system.block(condition.fmu)}.{condition.variable}" == WORKSPACE_MARGIN
        and (why := unstable(system, outcome.energies))
    ):
        what = f"left its workspace, and {why}: the loop is unstable"
        remedy = "take higher rates, weaker gains, another coupling or hold"
        return Diverged(condition.fmu, f"{what} ({remedy})", outcome.end_time, repeatable=True)
    return simulation.balance.judge(outcome.energies, outcome.end_time)


def _reason(fault: Fault) -> str:
    ends = {Interrupted: "interrupted", Diverged: "diverged"}
    return next((reason for kind, reason in ends.items() if isinstance(fault, kind)), "fault")


def _loop(plan: Plan, simulation: Simulation) -> PythonLoop:
    """The compiled loop, or the one in Python where there is none."""
    why = too_long(simulation)
    if not why:
        try:
            return CompiledLoop(plan, simulation, load())
        except Unavailable as reason:
            why = str(reason)
    return PythonLoop(plan, simulation, {"everything": why})
