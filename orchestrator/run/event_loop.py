"""Executes a plan: binds operations to calls once, then loops over the events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from hapticlink.orchestrator.base import interrupt, plugins
from hapticlink.orchestrator.base.faults import AsksToEnd, Diverged, Fault, Interrupted
from hapticlink.orchestrator.plan.operations import (
    Event,
    Get,
    Operation,
    Part,
    Rollback,
    Save,
    Set,
    Step,
)
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import Ages, Delay
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.run.bind import Binder, Stop
from hapticlink.orchestrator.run.energy.balance import unstable
from hapticlink.orchestrator.run.energy.meter import Energy
from hapticlink.orchestrator.run.fixed_point import Iterations, total
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.run.step_check import StepErrors
from hapticlink.orchestrator.run.step_control import Steps
from hapticlink.orchestrator.system.haptic_loop import WORKSPACE

Progress = Callable[[float], None]


@dataclass
class Outcome:
    """How a run ended.

    end_time: time of the last row (s). fault: None for a regular end. asked: the FMU that requested
    the end, and how. published: whether the folder has rows of this run. wall_time, step_time: s,
    the latter by FMU. calls: counts by FMU and call. isolated: why an FMU ran in a process of its
    own. held: how often outputs of an FMU were held since they were not finite. smaller_steps:
    number of steps repeated with smaller ones.
    """

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | None = None
    asked: str = ""
    published: bool = False
    wall_time: float = 0.0
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


def run(plan: Plan, results: RunFolder, progress: Progress | None = None) -> Outcome:
    """Execute the plan to its end or to the first fault; rows up to then are in `results`.

    progress is called with the simulated time (s) from time to time.
    """
    outcome = Outcome()
    simulation: Simulation | None = None
    ages, counting = Ages(plan), True
    begin = perf_counter()
    try:
        # Non-finite values are detected by 0 x NaN, for which numpy would warn.
        with interrupt.held(), ExitStack() as stack, np.errstate(invalid="ignore", over="ignore"):
            interrupt.check()
            simulation = Simulation(plan.system, results, stack)
            bound = _Bound(plan, simulation)
            simulation.start()
            begin = perf_counter()
            for count, (tick, event) in enumerate(plan):
                for call in bound.calls(event):
                    call(tick)
                if counting:
                    counting = ages.event(tick, event)
                interrupt.check(simulation.seconds(tick))
                if progress and not count % 64:
                    progress(simulation.seconds(tick))
    except Stop:
        outcome.reason = "stop_when"
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
        outcome.wall_time, outcome.published = perf_counter() - begin, results.published
        if simulation:
            outcome.end_time = results.last
            outcome.step_time = {n: i.step_time for n, i in simulation.instances.items()}
            outcome.isolated = simulation.isolated
            outcome.held = {n: i.held for n, i in simulation.instances.items() if i.held}
            smaller = {n: i.smaller_steps for n, i in simulation.instances.items()}
            outcome.smaller_steps = {n: s for n, s in smaller.items() if s}
            outcome.energies = simulation.meters.energies()
            outcome.links = simulation.links()
            outcome.delays = ages.delays()
            outcome.calls = bound.counts()
            outcome.steps = bound.steps()
            outcome.iterations = bound.iterations()
            found = {n: check.errors() for n, check in simulation.step_checks.items()}
            outcome.step_errors = {n: errors for n, errors in found.items() if errors}
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
        and (system.block(condition.fmu), condition.variable) == WORKSPACE
        and (why := unstable(system, outcome.energies))
    ):
        what = f"left its workspace, and {why}: the loop is unstable"
        remedy = "take higher rates, weaker gains, another coupling or hold"
        return Diverged(condition.fmu, f"{what} ({remedy})", outcome.end_time, repeatable=True)
    return simulation.balance.judge(outcome.energies, outcome.end_time)


def _reason(fault: Fault) -> str:
    ends = {Interrupted: "interrupted", Diverged: "diverged"}
    return next((reason for kind, reason in ends.items() if isinstance(fault, kind)), "fault")


class _Bound:
    """The calls of each kind of event, bound at its first occurrence, and its number of
    occurrences."""

    def __init__(self, plan: Plan, simulation: Simulation) -> None:
        self._plan, self._simulation = plan, simulation
        self._binder = Binder(simulation, self.calls)
        self._bound: dict[Event | Part, list[Call]] = {}
        self._events: Counter[Event | Part] = Counter()

    def calls(self, event: Event | Part) -> list[Call]:
        self._events[event] += 1
        if (found := self._bound.get(event)) is None:
            found = self._bound[event] = self._binder.bind_all(self._plan.block(event))
        return found

    def counts(self) -> dict[str, dict[str, int]]:
        """Number of FMI calls by FMU and kind; blocks interrupted by a fault count in full."""
        totals: dict[str, Counter[str]] = {name: Counter() for name in self._simulation.instances}
        ran: list[tuple[Operation, int]] = []
        for event, times in self._events.items():
            ran += [(op, times) for op in self._plan.block(event)]
        for repeat, loop in self._binder.loops.items():
            ran += [(op, loop.counts.iterations) for op in repeat.body]
            ran += [(op, loop.counts.rollbacks) for op in repeat.again]
        for op, times in ran:
            if isinstance(op, Get | Set | Step | Save | Rollback):
                totals[op.fmu][type(op).__name__.lower()] += times
        return {name: dict(sorted(counter.items())) for name, counter in totals.items()}

    def steps(self) -> dict[str, Steps]:
        return {clock: a.steps for clock, a in self._binder.advancers.items()}

    def iterations(self) -> Iterations | None:
        return total(loop.counts for loop in self._binder.loops.values())
