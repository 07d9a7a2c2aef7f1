"""Sampled FMUs whose state cannot be read, and the linear systems that stand in their place while a
scene is linearised."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hapticlink.analysis.stability.identified_response import (
    EXACT,
    SETTLING,
    IdentifiedSystem,
    NotIdentified,
    identify,
)
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.state_vector import LAYOUT, has_layout
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.fmi.description import STATE
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.variables import WRITTEN, Scalar
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.system.system import Connection, Fmu, System

FINE = 1e-12
"""Relative tolerance of the solver of an FMU for model exchange."""
LONG = 1e4
"""Stop time (s) that an FMU is told while it is identified."""
Known = dict[tuple[Any, ...], IdentifiedSystem]
"""The responses that were identified, by FMU and what they depend on."""


@dataclass(frozen=True)
class StandIn:
    """What stands in the place of an FMU, for the record: its order, and its errors on inputs that
    took no part, those of an IdentifiedSystem."""

    fmu: str
    order: int
    error: float
    early: float
    on_run: float | None

    def __str__(self) -> str:
        said = (
            f"{self.fmu}: its state cannot be read; a linear system of order {self.order} stands "
            f"for it, identified by its response to pulses; on other inputs it errs by "
            f"{self.error:.1g} of the largest response"
        )
        if self.on_run is not None:
            said += f", on those of the scene's own run by {self.on_run:.1g}"
        if self.early > EXACT:
            said += (
                f"; in its first {SETTLING} steps the FMU is another system, from which this one "
                f"differs by {self.early:.1g}: judged is only what it is behind them"
            )
        elif self.on_run is not None and self.on_run > EXACT:
            said += (
                "; over that run the FMU is not this system, as where its law switches or is "
                "limited: judged are only smaller motions, next to where the scene starts"
            )
        return said


def find_stand_ins(known: Known) -> tuple[StandIn, ...]:
    """Of each FMU the one with the largest error."""
    worst: dict[str, StandIn] = {}
    for (name, *_), found in known.items():
        each = StandIn(name, found.order, found.error, found.early, found.on_run)
        worst[name] = max(
            worst.get(name, each), each, key=lambda s: (max(s.early, s.on_run or 0.0), s.error)
        )
    return tuple(worst.values())


def record_stand_ins(found: Sequence[StandIn]) -> dict[str, Any]:
    """The entry of a record, none without any."""
    return {"stand_ins": [asdict(each) for each in found]} if found else {}


def with_stand_ins(system: System, work: SharedWork) -> System:
    """The system with linear ones in the place of FMUs whose state cannot be read. Raises
    InputFault for one whose response tells none."""
    system = replace(system, fmus=tuple(map(_with_declared_states, system.fmus)))
    unread = [fmu.name for fmu in system.fmus if not has_layout(fmu)]
    if not unread:
        return system
    start = _read_start(system)
    fmus = (_identified(system, u, start, work) if u.name in unread else u for u in system.fmus)
    return replace(system, fmus=tuple(fmus))


def _with_declared_states(fmu: Fmu) -> Fmu:
    """One for model exchange with the states that it declares, which can be set, and a solver whose
    error is far below the differences by which slopes are found. Its discrete states stay."""
    about = fmu.description
    if about.equations is None or has_layout(fmu):
        return fmu
    states = tuple(f"state {name}" for name in about.equations.states)
    flags = about.flags | {STATE[about.fmi]}
    return replace(fmu, description=replace(about, states=states, flags=flags, tolerance=FINE))


Brought = tuple[list[Scalar], Vector]
"""Inputs or parameters of an FMU, and the values that connections bring them, in signal units."""


def _read_start(system: System) -> Callable[[Iterable[Connection]], Brought]:
    """What connections bring at the start of the scene."""
    with ExitStack() as stack:
        simulation = Simulation(system, RunResults(), stack)
        simulation.step_checks.clear()
        simulation.start()
        values, signals = simulation.signals.values.copy(), simulation.signals

    def read(connections: Iterable[Connection]) -> Brought:
        every = [*connections]
        places = [i for c in every for i in signals.sources(c)]
        return [s for c in every for s in c.inputs], values[places]

    return read


def _identified(
    system: System, fmu: Fmu, start: Callable[[Iterable[Connection]], Brought], work: SharedWork
) -> Fmu:
    known: Known = work.responses
    clock = system.timeline.clock(fmu.clock)

    def refuse(why: str) -> InputFault:
        return InputFault(f"{fmu.name}: {LAYOUT}, and {why}")

    if not fmu.sampled:
        raise refuse(
            "only of a sampled FMU its response to its inputs is identified instead: with "
            'timing = "sampled" its outputs are those at the beginning of a step'
        )
    if clock.period is None or clock.first != clock.period:
        raise refuse("its response is not identified, as its period varies")
    if any(s.type in WRITTEN for s in fmu.description.scalars):
        raise refuse("its response is not identified, as it passes on texts")
    T, (inputs, u0) = system.timeline.seconds(clock.period), start(system.into(fmu.name))
    once = start(c for c in system.connections if c.target == fmu.name and c.initial)
    starts = tuple((scalar.name, value) for scalar, value in fmu.starts)
    key = fmu.name, fmu.description.path, starts, T, u0.tobytes(), once[1].tobytes()
    if key not in known:
        try:
            names = [s.name for s in inputs]
            run = work.run and _inputs_in(work.run(), system.into(fmu.name), T)
            known[key] = identify(
                lambda u: _respond(system, fmu, inputs, once, u, T), u0, names, run
            )
        except NotIdentified as why:
            raise refuse(f"its response to its inputs tells no linear system: {why}") from None
        except FmuFault as fault:
            raise refuse(f"it fails while its response is identified: {fault}") from None
    response, about = known[key], fmu.description
    described = replace(
        about,
        states=tuple(f"identified[{i + 1}]" for i in range(response.order)),
        flags=about.flags | {STATE[about.fmi]},
    )

    def stand_in(*arguments: Any) -> Instance:
        return LinearInstance(response, inputs, once[0], *arguments)

    return replace(fmu, description=described, isolate=False, in_its_place=stand_in)


def _inputs_in(run: Results, connections: Iterable[Connection], T: float) -> Matrix | None:
    """What the sources of connections put out in a run, at the steps of T (s); None where one of
    them is not recorded."""
    columns = []
    for name in (f"{c.source}.{s.name}" for c in connections for s in c.outputs):
        table = next((table for table in run.tables.values() if name in table), None)
        if table is None or not len(table["time"]):
            return None
        at = np.arange(round(table["time"][-1] / T)) * T
        rows = np.searchsorted(table["time"], at + T / 1e6, side="right") - 1
        columns.append(table[name][rows])
    steps = min(map(len, columns), default=0)
    return np.stack([column[:steps] for column in columns], axis=1) if steps else None


def _respond(
    system: System, fmu: Fmu, inputs: Sequence[Scalar], once: Brought, given: Matrix, T: float
) -> Matrix:
    """The outputs of a new instance behind each of its steps of T (s); `once` is what it is brought
    before the first."""
    alone = replace(system, fmus=(fmu,), connections=(), changes=(), ends_when=None)
    with ExitStack() as stack:
        instance = LoadedFmus(alone, stack).instances[fmu.name]
        places = range(len(inputs))
        instance.enter_initialization(0.0, LONG)
        if once[0]:
            instance.connect(once[0], range(len(once[0])))(once[1])
        instance.connect(inputs, places)(given[0])
        instance.exit_initialization()
        setter, rows = (
            instance.connect(inputs, places),
            np.empty((len(given), len(instance.outputs))),
        )
        for k, values in enumerate(given):
            setter(values)
            instance.step(k * T, (k + 1) * T, T)
            instance.finish()
            instance.read()
            rows[k] = instance.outputs
        return rows


class LinearInstance(Instance):
    """A linear system as an instance of the FMU in whose place it stands. Its serialised state has
    the values of all variables by reference, and then its own states; inputs and outputs are in the
    units of signals."""

    in_c = False

    def __init__(
        self,
        response: IdentifiedSystem,
        inputs: Sequence[Scalar],
        once: Sequence[Scalar],
        *arguments: Any,
    ) -> None:
        super().__init__(*arguments)
        self._response = response
        scalars = [s for s in self.description.scalars if s.causality != "independent"]
        scalars.sort(key=lambda s: s.reference)
        place = {s.name: i for i, s in enumerate(scalars)}
        self._inputs = np.array([place[s.name] for s in inputs], dtype=np.intp)
        self._at = {s.name: i for i, s in enumerate(inputs)}
        self._once = {s.name for s in once}
        self._results = np.array([place[s.name] for s in self.description.outputs], dtype=np.intp)
        self._n = len(scalars)
        self._state = np.zeros(self._n + response.order)
        self._state[self._inputs] = response.u0
        self._state[self._results] = response.y0
        self._saved: dict[int, tuple[Vector, float]] = {}

    def _load(self) -> None:
        """Nothing to load."""

    def connect(self, scalars: Sequence[Scalar], places: Sequence[int]) -> Callable[[Vector], None]:
        if other := [s.name for s in scalars if s.name not in self._at.keys() | self._once]:
            raise InputFault(
                f"{self.name}.{other[0]}: a linear system stands for the FMU, identified with the "
                "value that this had"
            )
        of = [k for k, s in enumerate(scalars) if s.name in self._at]
        into = self._inputs[[self._at[scalars[k].name] for k in of]]
        where = np.array([places[k] for k in of], dtype=np.intp)

        def set_from(signals: Vector) -> None:
            self._state[into] = signals[where]

        return set_from

    def enter_initialization(self, start_time: float, stop_time: float) -> None:
        """Nothing to be told."""

    def exit_initialization(self) -> None:
        self.read()
        self._start_loop()

    def read(self) -> None:
        self.outputs[:] = self._state[self._results]

    def read_some(self, places: Sequence[int]) -> None:
        self.outputs[list(places)] = self._state[self._results[list(places)]]

    def step(self, time: float, end: float, size: float) -> None:
        of, x = self._response, self._state[self._n :]
        du = self._state[self._inputs] - of.u0
        self._state[self._results] = of.y0 + of.C @ x + of.D @ du
        x[:] = of.A @ x + of.B @ du
        self.place.time = end

    def save(self, slot: int = 0) -> None:
        self._saved[slot] = self._state.copy(), self.time

    def rollback(self, slot: int = 0) -> None:
        self._state[:], self.place.time = self._saved[slot]

    def serialized(self) -> bytes:
        return self._state.tobytes()

    def deserialize(self, state: bytes) -> None:
        self._state[:] = np.frombuffer(state)
