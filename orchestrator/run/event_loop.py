"""A plan carried out: operations bound to calls once, then one loop over events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import Fault, Interrupted
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
from hapticlink.orchestrator.run.bind import Binder, Stop
from hapticlink.orchestrator.run.energy.meter import Energy
from hapticlink.orchestrator.run.fixed_point import Iterations, total
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.run.step_control import Steps

Progress = Callable[[float], None]


@dataclass
class Outcome:
    """How a run ended: `fault` is None for a good end, end_time the last recorded row's time;
    times in s, counts by FMU and call. isolated says why an FMU ran in a process of its own, held
    how often an output was held for not being finite, smaller_steps how many were retried."""

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | None = None
    wall_time: float = 0.0
    step_time: dict[str, float] = field(default_factory=dict)
    calls: dict[str, dict[str, int]] = field(default_factory=dict)
    isolated: dict[str, str] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    smaller_steps: dict[str, int] = field(default_factory=dict)
    energies: dict[str, Energy] = field(default_factory=dict)
    links: dict[str, dict[str, int]] = field(default_factory=dict)
    iterations: Iterations | None = None
    steps: dict[str, Steps] = field(default_factory=dict)


def run(plan: Plan, folder: Path, progress: Progress | None = None) -> Outcome:
    """Run to the end or to the first fault; what was recorded until then is in `folder`.

    progress is told the simulated time (s) now and then.
    """
    outcome = Outcome()
    simulation: Simulation | None = None

    def last() -> float:
        return simulation.recorders[plan.system.timeline.clocks[0].name].last if simulation else 0.0

    begin = perf_counter()
    try:
        # Values that are not finite are found by 0 x NaN, without numpy's own warning.
        with ExitStack() as stack, np.errstate(invalid="ignore"):
            simulation = Simulation(plan.system, folder, stack)
            bound = _Bound(plan, simulation)
            interrupted = stack.enter_context(interrupt.watch())
            simulation.start()
            begin = perf_counter()
            for count, (tick, event) in enumerate(plan):
                for call in bound.calls(event):
                    call(tick)
                if interrupted:
                    raise Interrupted(simulation.seconds(tick))
                if progress and not count % 64:
                    progress(simulation.seconds(tick))
    except Stop:
        outcome.reason = "stop_when"
    except Fault as fault:
        outcome.reason, outcome.fault = (
            "interrupted" if isinstance(fault, Interrupted) else "fault",
            fault,
        )
    except OSError as error:  # a full disk, most of all
        outcome.fault, outcome.reason = Fault(f"{folder}: {error.strerror or error}"), "fault"
    except KeyboardInterrupt:  # a second signal does not wait for the end of the event
        outcome.fault, outcome.reason = Interrupted(last()), "interrupted"
    finally:
        outcome.wall_time = perf_counter() - begin
        if simulation:
            outcome.end_time = last()
            outcome.step_time = {n: i.step_time for n, i in simulation.instances.items()}
            outcome.isolated = simulation.isolated
            outcome.held = {n: i.held for n, i in simulation.instances.items() if i.held}
            smaller = {n: i.smaller_steps for n, i in simulation.instances.items()}
            outcome.smaller_steps = {n: s for n, s in smaller.items() if s}
            outcome.energies = simulation.meters.energies()
            outcome.links = simulation.links()
            outcome.calls = bound.counts()
            outcome.steps = bound.steps()
            outcome.iterations = bound.iterations()
    if progress:
        progress(outcome.end_time)
    return outcome


class _Bound:
    """The calls of each event, bound when it first comes, and how often it came."""

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
        """FMI calls of the loop, by FMU and kind; those of blocks that a fault cut are in it."""
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
