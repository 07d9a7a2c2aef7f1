"""What a scene has happen at given times, against its FMUs, connections and clocks."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator

from hapticlink.orchestrator.base.errors import shorten
from hapticlink.orchestrator.base.signal_names import CHOSEN_POINT
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.transfer import as_signal
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import TimedEvent, Value
from hapticlink.orchestrator.scene.toml_keys import Problem, collect_problem
from hapticlink.orchestrator.system.changes import (
    OPERATIONAL_POINT,
    feeding,
    number_of_point,
    settable,
)
from hapticlink.orchestrator.system.fmu_tables import entries_for
from hapticlink.orchestrator.system.ports import carries_power, scalars_of
from hapticlink.orchestrator.system.system import Connection, InputChange, System
from hapticlink.orchestrator.system.timeline import GRAPHICS_RATE


def changes(scene: Scene, system: System, problems: list[Problem]) -> tuple[InputChange, ...]:
    """The changes in the order of their times; those that no step sees begin at the run's end or
    later. Findings are appended to `problems`."""
    if scene.at and scene.coupling == "iterated":
        problems.append((("at", 0), 'steps are repeated with coupling = "iterated": take another'))
    events = _Events(scene, system)
    taken: list[InputChange] = []
    for i, event in enumerate(scene.at):
        for key, asked in (("set", event.set), ("override", event.override)):
            for name, value in asked.items():
                with collect_problem(problems, ("at", i, key, name)):
                    taken.append(events.set_value(event, key, name, value))
        for name in event.freeze:
            with collect_problem(problems, ("at", i, "freeze")):
                taken.append(events.disturb(event, name, 0.0))
        for name, noise in event.noise.items():
            with collect_problem(problems, ("at", i, "noise", name)):
                taken.append(events.disturb(event, name, noise))
        problems += ((("at", i, key), why) for key, why in _times(event, scene.start_time))
    return tuple(sorted(taken, key=lambda change: change.begin))


def _times(event: TimedEvent, begin: float) -> Iterator[tuple[str, str]]:
    if event.time < begin:
        yield "time", f"{event.time:g} s is before the run, whose start_time is {begin:g} s"
    if event.until is not None and event.until <= event.time:
        yield "until", f"{event.until:g} s is not after time = {event.time:g} s"
    if not (event.set or event.override or event.freeze or event.noise):
        yield "time", "nothing happens then: give set, override, freeze or noise"


class _Events:
    """Makes changes; all methods raise ValueError or InputFault, with the remedy, for what cannot
    be done."""

    def __init__(self, scene: Scene, system: System) -> None:
        self._scene, self._system = scene, system

    def set_value(self, event: TimedEvent, key: str, name: str, value: Value) -> InputChange:
        """A value that is set once, or that overrides a connection."""
        if name == OPERATIONAL_POINT and key == "set":
            name, value = CHOSEN_POINT, number_of_point(self._scene.linkage, value)
        if name == GRAPHICS_RATE and key == "set":
            begin = self._begin("graphics", event.time)
            return InputChange(begin, event.time, f"{name} = {value} Hz")
        table = GRAPHICS_RATE.partition(".")[0]
        if name.startswith(f"{table}.") and table not in self._system.fmu:
            raise ValueError(f"of the keys of a scene's rates {GRAPHICS_RATE} alone can be set")
        text, fed = f"{name} = {shorten(str(value))}", feeding(self._system, name)
        if key == "override":
            self._require_disturbable(name, fed)
            scalars = scalars_of(self._system.fmu, name, "input", "parameter")
            return self._change(event, name, f"{text} instead of its connection",
                                inputs=scalars, values=_numbers(name, value, scalars),
                                end=self._end(event))  # fmt: skip
        if fed:
            raise ValueError(f"{name} is fed by {fed[0].name}: take override")
        scalars = settable(self._system, name)
        return self._change(
            event, name, text, inputs=scalars, values=_numbers(name, value, scalars)
        )

    def disturb(self, event: TimedEvent, name: str, noise: float) -> InputChange:
        """An input that is frozen, or gets noise."""
        fed = feeding(self._system, name)
        self._require_disturbable(name, fed)
        if len(fed) > 1:
            raise ValueError(f"{name} is fed by {len(fed)} connections: name one entry")
        text = f"noise of {noise:g} on {name}" if noise else f"{name} frozen"
        return self._change(event, name, text, inputs=fed[0].inputs, end=self._end(event),
                            held=fed[0], noise=noise, seed=event.seed)  # fmt: skip

    def _change(self, event: TimedEvent, name: str, text: str, **parts: object) -> InputChange:
        fmu = name.partition(".")[0]
        begin = self._begin(self._system.fmu[fmu].clock, event.time)
        until = parts.get("end")
        text += f" until {event.until:g} s" if until is not None and event.until else ""
        return InputChange(begin, event.time, text, fmu, **parts)  # type: ignore[arg-type]

    def _begin(self, clock: str, time: float) -> float:
        """The first communication point of a clock at or after a time (s), infinity where there is
        none in the run."""
        timeline = self._system.timeline
        if clock not in (c.name for c in timeline.clocks):
            raise ValueError(f"no FMU runs at the rate of {clock}")
        starts = timeline.clock(clock).starts
        k = bisect_left(starts, timeline.ticks_until(exact(time)))
        return timeline.time(starts[k]) if k < len(starts) else math.inf

    def _end(self, event: TimedEvent) -> float:
        return self._scene.stop_time + 1.0 if event.until is None else event.until

    def _require_disturbable(self, name: str, fed: list[Connection]) -> None:
        fmu = name.partition(".")[0]
        if not fed:
            raise ValueError(f"{name} is fed by no connection: take set")
        if carries_power(fed[0], self._system.energy.power):
            raise ValueError(
                f"{name} carries power, which is measured as its connection brings it: disturb "
                "what its source gets, or set a parameter of the source"
            )
        if fmu in self._scene.get_after_set:
            raise ValueError(f"{fmu} is in get_after_set: its outputs are read before that is set")
        if any(c.needs == "spring" for c in fed):
            raise ValueError(f"{name} is held by `pspm`, which accounts for what it brings")
        system = self._system
        for c in system.connections:
            of = system.energy.coupling(c, system.connections)
            if c.needs == "coupling" and of and name in of.ends:
                raise ValueError(f"`mid` has the force {of.force} by {name} as it is: take another")


def _numbers(name: str, value: Value, scalars: tuple[Scalar, ...]) -> tuple[float, ...]:
    given = entries_for(scalars, value, name)
    for scalar, entry in given:
        _require_type(scalar, entry)
    return tuple(as_signal(*each) for each in given)


def _require_type(scalar: Scalar, number: bool | float | str) -> None:
    """Raises ValueError for a value that the variable's type does not hold: none is rounded."""
    if scalar.type == "String":
        takes = "" if isinstance(number, str) else "a text"
    elif isinstance(number, str):
        takes = "a number"
    elif scalar.type == "Boolean":
        takes = "" if number in (0, 1) else "true or false"
    elif isinstance(number, bool):
        takes = "a number"
    else:
        fits = scalar.type in CONTINUOUS or float(number).is_integer()
        takes = "" if fits else "a whole number"
    if takes:
        given = str(number).lower()
        raise ValueError(f"{given}: {scalar.name}, of type {scalar.type}, takes {takes}")
