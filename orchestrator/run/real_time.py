"""A run in real time: its pace, the FMUs beside the loop, and who has a turn every 20 ms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.board import Board
from hapticlink.orchestrator.fmi.description import VARIABLE_STEP
from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run import concurrent_fmus
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.concurrent_fmus import Side, ThreadWorker, Worker
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.arguments import require
from hapticlink.orchestrator.system.system import Fmu, System

SKIPPED = 8
"""Haptic ticks of hardware that are skipped at once; where it is later, the schedule moves."""


class Ended(Exception):
    """Raised in a turn to end the run, with the reason for run.json."""


class RealTimeRun:
    """What makes a run one in real time.

    turn: called about every 20 ms between two events, with the simulation and the loop. clock, wait
    and worker: as of Pace and Side, of the machine by default. changes: time (s) and text of
    what was changed during the run. speed: as of Pace.
    """

    def __init__(
        self,
        turn: Callable[[Simulation, CompiledLoop], object] | None = None,
        clock: Callable[[], int] | None = None,
        wait: Callable[[int], object] | None = None,
        worker: Callable[[str], Worker] = lambda clock: ThreadWorker(),
        speed: float = 1.0,
    ) -> None:
        self.pace, self._turn, self._worker = Pace(clock, wait, require_speed(speed)), turn, worker
        self.changes: list[tuple[float, str]] = []
        self._abandoned: list[str] = []
        self._in_loop: dict[str, str] = {}

    @contextmanager
    def of(self, plan: Plan, simulation: Simulation) -> Iterator[None]:
        """Context of the run of a simulation, which has no loop yet; threads end with it."""
        self._simulation = simulation
        simulation.beside, self._in_loop = concurrent_fmus.find_concurrent(plan)
        hardware = [fmu for fmu in plan.system.fmus if fmu.hardware]
        self._require_own_time(plan.system, self.pace.speed)
        self._require_skipping(plan.system, hardware)
        haptics = plan.system.timeline.clocks[0]
        if any(fmu.clock == haptics.name for fmu in hardware):
            self.pace.skip_late(simulation.seconds(SKIPPED * haptics.longest))
        for clock in dict.fromkeys(simulation.beside.values()):
            fmus = [fmu for fmu in plan.system.fmus if simulation.beside.get(fmu.name) == clock]
            longer = all(fmu.description.varies_step for fmu in fmus)
            simulation.sides[clock] = Side(longer, self.pace.now, self._worker(clock))
        try:
            yield
        finally:
            left = (side.close() for side in simulation.sides.values())
            self._abandoned = [name for name in left if name]

    def with_recordings(self, system: System) -> System:
        """The system, with what is read in the place of its boards."""
        return system

    def _require_skipping(self, system: System, hardware: Iterable[Fmu]) -> None:
        """Raises InputFault where ticks of hardware cannot be skipped."""
        haptics = system.timeline.clocks[0].name
        for fmu in hardware:
            if why := self._in_loop.get(fmu.name):
                raise InputFault(
                    f"{fmu.name}: hardware in the haptic loop is at its rate; this is at "
                    f"{fmu.clock}, and not beside the loop: {why}"
                )
            fixed = [
                other.name
                for other in system.fmus
                if other.clock == fmu.clock and not other.description.varies_step
            ]
            if fixed:
                raise InputFault(
                    f"{fmu.name}: ticks of hardware that are late are skipped, by a longer step of "
                    f"every FMU at {'its rate' if fmu.clock != haptics else 'the haptic rate'}, "
                    f"which {', '.join(fixed)} cannot take ({VARIABLE_STEP} is not true)"
                )

    def change_speed(self, speed: float, time: float) -> None:
        """As of `Pace`. Raises InputFault with hardware."""
        self._require_own_time(self._simulation.system, speed)
        self.pace.change_speed(speed, time)

    def _require_own_time(self, system: System, speed: float) -> None:
        """Raises InputFault for a speed other than 1 of hardware."""
        if speed != 1.0 and (names := [fmu.name for fmu in system.fmus if fmu.hardware]):
            what = f"{', '.join(names)} drives hardware, whose time is the clock's: take 1"
            raise InputFault(f"speed = {speed:g}: {what}")

    def kinds(self, coming: Iterable[Event]) -> set[Event]:
        """The kinds of events that are likely beside wall clocks, of which those of the plan are
        `coming`."""
        haptics = self._simulation.system.timeline.clocks[0].name
        return with_skips(haptics, with_ends(coming)) if self.pace.c.skips else with_ends(coming)

    def turn(self, loop: CompiledLoop) -> None:
        """Raises FmuFault where an FMU beside the loop hangs, and whatever the turn raises."""
        simulation = self._simulation
        for side in simulation.sides.values():
            side.require(simulation.system.faults.timeout)
        if self._turn:
            self._turn(simulation, loop)

    def report(self) -> dict[str, Any]:
        simulation = self._simulation
        haptics = simulation.system.timeline.clocks[0]
        for board in (i for i in simulation.instances.values() if isinstance(i, Board)):
            self.pace.priority["workers"] = board.workers
        return self.pace.report() | {
            "period": simulation.seconds(haptics.longest),
            "beside": dict(simulation.beside),
            "in_loop": self._in_loop,
            "samples": {
                clock: {"taken": side.samples, "late": side.late, "largest_lateness": side.latest}
                for clock, side in simulation.sides.items()
            },
            "changes": self.changes,
            "abandoned": self._abandoned,
        }


SPEEDS = Annotated[float, Quantity("1", ge=1e-3, le=1e3)]


def require_speed(speed: float) -> float:
    """A speed. Raises InputFault for one that nobody would wait for, or no machine reach."""
    return float(require("speed", speed, SPEEDS))


def with_skips(haptics: str, kinds: set[Event]) -> set[Event]:
    """Kinds of events, and the same where the haptic clock goes on over ticks that are past."""

    def longer(kind: Event, n: int) -> Event:
        firings = (
            f._replace(dticks=n * f.dticks) if f.clock == haptics and not f.final else f
            for f in kind.firings
        )
        return kind._replace(firings=tuple(firings))

    return {longer(kind, n) for kind in kinds for n in range(1, SKIPPED + 2)}


def with_ends(coming: Iterable[Event]) -> set[Event]:
    """The kinds of events that are likely beside wall clocks: those that come, those of each clock
    alone, and the same at the end of the run."""
    kinds = {*coming}
    for event in [*kinds]:
        alone = (event._replace(firings=(firing,)) for firing in event.firings)
        for kind in (event, *alone) if not event.first else ():
            last = tuple(firing._replace(final=True) for firing in kind.firings)
            kinds |= {kind, kind._replace(firings=last)}
    return kinds
