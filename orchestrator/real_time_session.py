"""A scene that runs in real time, and is watched and changed meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hapticlink.components.specs.quantities import Elapsed, Quantity, Seed
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, shorten, unknown
from hapticlink.orchestrator.base.signal_names import CHOSEN_POINT
from hapticlink.orchestrator.results.run_record import Energy
from hapticlink.orchestrator.run.apply_changes import InputSetter
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.real_time import Ended, RealTimeRun, require_speed
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.arguments import require, require_name
from hapticlink.orchestrator.scene.hold_tables import read_hold
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.changes import (
    OPERATIONAL_POINT,
    check_change,
    choices,
    number_of_point,
    require_other_rate,
    require_result,
    settable,
)
from hapticlink.orchestrator.system.ports import names, scalars_of
from hapticlink.orchestrator.system.system import Connection, InputChange, System
from hapticlink.orchestrator.system.timeline import period_in_ticks

Result = TypeVar("Result")


class LiveRun:
    """A scene that runs in real time; a `turn` between two events of the haptic loop reads and
    changes the running FMUs, holds and clocks themselves. run.json lists the changes with their
    times (`changes` of `real_time`)."""

    def __init__(
        self, scene: str | Path | Scene, options: Options = (), speed: float = 1.0
    ) -> None:
        self.scene = open_scene.load(scene, options)
        """The scene that runs."""
        self._speed = require_speed(speed)
        self._schedule: Callable[[Callable[..., object]], RealTimeRun] = RealTimeRun
        self.paused = False
        """Whether time stands still; turns go on."""

    def _repeated(
        self, turn: Callable[[Any], object], every: float, run: Callable[[RealTimeRun], Result]
    ) -> Result:
        """What `run` returns, which runs `scene` with the pace that it is given; called again after
        each `reset`. Turns come about `every` so many seconds."""
        self._called, self._every = turn, round(1e9 * require("every", every, Elapsed))
        while True:
            self._until: int | None = None
            self._again = False
            self._setters: dict[str, tuple[InputSetter, int]] = {}
            self._connections: dict[str, Connection] = {}
            self._places: dict[str, list[int]] = {}
            self._run = self._schedule(self._turn)
            self._run.pace.change_speed(self._speed, 0.0)
            ended = run(self._run)
            if not self._again:
                return ended

    # --- to read ----------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The simulated time of the newest haptic event (s). Raises InputFault before `run`, as
        does all that reads or changes what runs."""
        haptics = self.system.timeline.clocks[0].name
        return self._simulation.seconds(self._loop.events.previous(haptics))

    @property
    def system(self) -> System:
        """The FMUs, connections and clocks that run, as they were at the start."""
        self._require_running()
        return self._simulation.system

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The newest sample of an output, `fmu.port`, that the haptic loop has: its entries in the
        order of their indices. Raises InputFault for an unknown name."""
        self._require_running()
        if require_name("output", name) not in self._places:
            fmu, place = name.partition(".")[0], self._simulation.signals.scalar
            self._places[name] = [
                place(fmu, s.name) for s in scalars_of(self.system.fmu, name, "output")
            ]
        return self._simulation.signals.values[self._places[name]]

    def energies(self) -> dict[str, Energy]:
        """The energies (J) of each connection that carries power, until now."""
        self._require_running()
        return self._simulation.meters.energies()

    def report(self) -> dict[str, Any]:
        """Step times, lateness, deadlines missed and late samples until now, as in run.json."""
        self._require_running()
        return self._run.report()

    # --- to change --------------------------------------------------------------------------

    def set(self, name: str, value: ArrayLike) -> None:
        """Set an input that nothing feeds, or a tunable parameter, `fmu.port`, from the FMU's next
        step on; entries in the order of their indices, in the FMU's units. The value of
        `linkage.operational_point` is the name of a point, or "none". Raises InputFault for
        other names, for gains of a spring whose energy `pspm` limits, and for values of another
        number or that are not finite."""
        self._require_running()
        if name == OPERATIONAL_POINT:
            name, value = CHOSEN_POINT, number_of_point(self.scene.linkage, value)
        fmu = require_name("input or parameter", name).partition(".")[0]
        if name not in self._setters:
            inputs = settable(self.system, name)
            change = InputChange(self.time, self.time, f"{name} set", fmu, inputs)
            self._setters[name] = InputSetter(change, self._simulation), len(change.inputs)
        setter, size = self._setters[name]
        try:
            values = np.array(value, np.float64).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        if len(values) != size or not np.isfinite(values).all():
            raise InputFault(f"{name} = {shorten(repr(value))}: give {size} finite numbers")
        setter.values = values
        setter.wait()

    def hold(self, name: str, hold: str | None = None, delay: float | None = None) -> None:
        """Give connections another hold, or another constant latency `delay` (s); they are named
        as in [holds] of a scene. A hold begins anew with the newest sample of its source. Raises
        InputFault where it does not fit, or cannot be changed while the scene runs, and for a delay
        that no scene may have."""
        system = self.system
        require_name("connection", name)
        if hold is not None:
            hold = read_hold(require_name("hold", hold))
        if delay is not None:
            delay = require(f"delay of {name}", delay, Elapsed)
        connections = [c for c in system.connections if name in names(c) and c.hold]
        if not connections:
            every = [key for c in system.connections if c.hold for key in names(c)]
            raise InputFault(unknown("connection with a hold", name, every))
        new = [
            check_change(system, self._connections.get(c.name, c), hold, delay) for c in connections
        ]
        for connection in new:
            held = self._simulation.make_hold(connection)
            newest = self._loop.events.previous(system.fmu[connection.source].clock)
            self._loop.change_hold(connection.name, held, newest)
            self._connections[connection.name] = connection
        self._note(f"hold of {name}: {new[0].hold}, delay {delay or 0.0:g} s")

    def holds(self) -> dict[str, list[str]]:
        """By connection that has a hold, the holds that `hold` can give it, its present one
        first."""
        held = [self._connections.get(c.name, c) for c in self.system.connections if c.hold]
        return {c.name: choices(self.system, c) for c in held}

    def rate(self, clock: str, rate: float | None, jitter: float = 0.0, seed: int = 0) -> None:
        """Change the rate (Hz) of a clock other than the haptic one, such as `graphics`, from the
        end of its current step on; steps then end on haptic ticks, or with None again where they
        do in the scene, the first at least a haptic tick later. jitter: each ends up to half this
        share of a period early or late, uniformly, drawn by numpy's PCG64 with the seed. Raises
        InputFault where an FMU cannot vary its step or has a spring whose energy `pspm` limits, for
        a rate that is not between 0 and the haptic one, for steps shorter than `computing_time`,
        and for a jitter that leaves no haptic tick between two ends."""
        timeline = self.system.timeline
        haptics, *others = timeline.clocks
        if require_name("clock", clock) not in [c.name for c in others]:
            raise InputFault(unknown("clock", clock, [c.name for c in others]))
        require_other_rate(self.system, clock)
        if rate is None and not jitter:
            self._loop.events.restore_rate(clock)
            return self._note(f"rate of {clock}: that of the scene")
        rate = require(f"rate of {clock}", rate, Annotated[float, Quantity("Hz", gt=0)])
        jitter = require(f"jitter of {clock}", jitter, Annotated[float, Quantity("1", ge=0)])
        seed = int(require("seed", seed, Seed))
        try:
            period = period_in_ticks(rate, timeline.base, haptics.longest)
        except ValueError as error:
            raise InputFault(f"rate of {clock}: {error}") from error
        most = float(1 - haptics.longest / period)
        if not 0 <= jitter <= most:
            raise InputFault(f"jitter of {clock} = {jitter}: at {rate:g} Hz give 0 to {most:.2g}")
        require_result(self.system, clock, float(period * timeline.base) * (1 - jitter))
        self._loop.events.change_rate(clock, period, jitter, seed)
        drawn = f", jitter {jitter:g}, seed {seed}" if jitter else ""
        self._note(f"rate of {clock}: {rate:g} Hz{drawn}")

    # --- time ---------------------------------------------------------------------------------

    @property
    def speed(self) -> float:
        """Simulated seconds in one of the wall clock: 1 in real time, less in slow motion. It can
        be set, before the run too, and stays after a `reset`. Raises InputFault where it is no
        number between 0.001 and 1000, and with hardware."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        self._speed = require_speed(speed)
        if hasattr(self, "_run"):
            self._run.change_speed(self._speed, self.time)
            self._note(f"speed: {self._speed:g}")

    def pause(self) -> None:
        """Let time stand still after this turn."""
        self.paused = True

    def resume(self) -> None:
        """Let time go on."""
        self.paused, self._until = False, None

    def step(self, ticks: int = 1) -> None:
        """Go on for a number of haptic ticks, then pause. Raises InputFault for less than one."""
        self._require_running()
        ticks = int(require("ticks", ticks, Annotated[int, Quantity("1", ge=1, le=2**53)]))
        self.paused, self._until = True, self._run.pace.c.ticks + ticks

    def reset(self, options: Options = ()) -> None:
        """Begin anew at t = 0, with the scene changed by `options`. Raises what `hl.scene` does."""
        self._require_running()
        self.scene = open_scene.load(self.scene, options)
        self._again = True
        raise Ended("reset")

    def stop(self) -> None:
        """End the run."""
        self._require_running()
        raise Ended("stopped")

    # ------------------------------------------------------------------------------------------

    def _turn(self, simulation: Simulation, loop: CompiledLoop) -> None:
        self._simulation, self._loop = simulation, loop
        pace = self._run.pace
        begun, stepping = pace.now(), self._until is not None
        if stepping and pace.c.ticks < (self._until or 0):
            return
        self._until = None
        self._called(self)
        if self.paused:
            for instance in simulation.instances.values():
                instance.rest()
        while self.paused and self._until is None:
            pace.wait(pace.now() + self._every)
            interrupt.raise_if_interrupted(self.time)
            self._called(self)
        loop.events.patience(self._every if self._until is None else 0)
        if self.paused or stepping:
            pace.c.origin += pace.now() - begun

    def _require_running(self) -> None:
        if not hasattr(self, "_simulation"):
            raise InputFault("the scene does not run yet: ask within the `turn` that `run` calls")

    def _note(self, text: str) -> None:
        self._run.changes.append((self.time, text))
