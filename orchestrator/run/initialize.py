"""Consistent start values: the outputs at t = 0, computed in initialisation mode.

Each output is computed after those that it depends on, by what the FMUs declare. Only outputs that
depend on each other, algebraic loops, are solved, by the Newton's method of iterated coupling, from
the start values of the inputs on the loop: FMUs are evaluated nowhere else but at its points,
unless an output is not finite there.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.port_space import PLANE, POINT
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.base.signal_names import DEVICE
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.fmi.transfer import as_signal
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, WRITTEN
from hapticlink.orchestrator.plan.dependency_order import StartOutputs, order_start, whole_fmus
from hapticlink.orchestrator.run import jacobians
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.solvers import Aitken, Newton, Solution, Solver, Vector, error
from hapticlink.orchestrator.scene.start_pose import describe_start_outside
from hapticlink.orchestrator.system.system import Connection, Fmu, System
from hapticlink.orchestrator.system.timeline import SLOWEST

MOST = 50
"""Points of Newton's method, and rounds of whole numbers and texts on a loop."""
TOLERANCE = 1e-12
MAX_COLUMNS = 500
"""Signals on a loop up to which Newton's Jacobian is evaluated; Aitken's method needs none."""
LONGEST = 2 / SLOWEST
"""Bound of the step (s) of a clock that is slowed down as far as it may be, and whose steps end up
to half of a period early and late."""


def initialize(
    fmus: LoadedFmus, rates_change: bool = False, order: Callable[[], StartOrder] | None = None
) -> bool:
    """Initialise every instance; the outputs of t = 0 are in the signal vector afterwards, as they
    are when initialisation mode has ended. Returns whether there was an algebraic loop.

    rates_change: whether those of slower clocks may, during the run. order: gives that of
    these FMUs, once all are in initialisation mode.

    Values cross connections, those to parameters among them, before initialisation mode ends. An
    output that its FMU changes in ending it is passed on with the first step: FMI allows no output
    to be read between a set and a step (FMI 2.0.5 section 4.2.4).

    Raises FmuFault where the outputs of a loop don't agree to 1e-12, relative to 1 + |y|, after 50
    points of Newton's method, or outputs aren't finite.
    """
    system, instances, values = fmus.system, fmus.instances, fmus.signals.values
    for fmu in system.fmus:
        interrupt.raise_if_interrupted()
        instances[fmu.name].enter_initialization(
            system.timeline.time(0), find_stop(system, fmu, rates_change)
        )
    found = order() if order else StartOrder.of(fmus)
    start, every, loops = StartValues(fmus), found.every, False
    for is_loop, evaluations in found.groups:
        if is_loop:
            start.solve(evaluations, start.guess(evaluations))
            loops = True
        else:
            start.evaluate(evaluations)
    sources = found.sources
    before = values[sources]
    start.evaluate(every)
    after = values[sources]
    if not (
        np.array_equal(after, before)
        or np.isclose(after, before, TOLERANCE, TOLERANCE, equal_nan=True).all()
    ):
        # An FMU does not keep to the dependencies that it declares.
        start.solve(every, values.copy())
        start.evaluate(every)
        loops = True
    require_finite(instances)
    for instance in instances.values():
        instance.exit_initialization()
    require_finite(instances)
    return loops


def find_stop(system: System, fmu: Fmu, rates_change: bool) -> float:
    """The stop time (s) that an FMU is told: the end of the run for a plant, which takes no step
    beyond it; for a sampled block, and a plant whose steps are taken early, the end of the step
    that it begins then at the latest, with the longest period that its clock may be given where the
    rates of slower clocks can change."""
    time = system.timeline
    if not fmu.sampled and fmu.name not in system.early:
        return time.time(time.end)
    if rates_change and fmu.clock != time.clocks[0].name:
        return time.time(time.end) + LONGEST
    starts = time.clock(fmu.clock).starts
    return time.time(starts[bisect_right(starts, time.end)])


@dataclass(frozen=True)
class Evaluation:
    """How outputs of an FMU are evaluated: `set_inputs` from the signals, then `read`. places: of
    the outputs among the signals; held: of values of holds, and of the samples that these are."""

    needs: Sequence[Connection]
    held: Sequence[tuple[slice, NDArray[np.intp]]]
    places: Sequence[int]
    set_inputs: Callable[[Vector], object]
    read: Callable[[], object]


@dataclass(frozen=True)
class StartOrder:
    """The evaluations of the outputs of loaded FMUs at t = 0: in groups, each with whether its
    outputs depend on each other, and whole FMUs; `sources`: the places on which some of these
    depend."""

    groups: Sequence[tuple[bool, Sequence[Evaluation]]]
    every: Sequence[Evaluation]
    sources: Sequence[int]

    @classmethod
    def of(cls, fmus: LoadedFmus) -> StartOrder:
        start, system = StartValues(fmus), fmus.system
        groups = [(g.is_loop, start.evaluations(g.members)) for g in order_start(system)]
        every = start.evaluations(whole_fmus(system))
        return cls(groups, every, start.find_sources(every))


def _set_nothing(signals: Vector) -> None:
    """Sets no input."""


class StartValues:
    """Sets inputs of FMUs in initialisation mode, and reads their outputs into the signals."""

    def __init__(self, fmus: LoadedFmus) -> None:
        self._fmus, self._signals = fmus, fmus.signals

    def evaluations(self, members: Sequence[StartOutputs]) -> list[Evaluation]:
        return [self._evaluation(m) for m in members]

    def _evaluation(self, outputs: StartOutputs) -> Evaluation:
        instance, first = self._fmus.instances[outputs.fmu], self._signals.fmu(outputs.fmu).start
        whole = len(outputs.outputs) == len(instance.outputs)
        signals = self._signals
        return Evaluation(
            outputs.needs,
            [
                (signals.hold(c.name), np.array(signals.sources(c), np.intp))
                for c in outputs.needs
                if c.hold
            ],
            [first + i for i in outputs.outputs],
            self._fmus.setter(outputs.needs, self._signals.places)
            if outputs.needs
            else _set_nothing,
            instance.read if whole else lambda: instance.read_some(outputs.outputs),
        )

    def evaluate(self, evaluations: Sequence[Evaluation]) -> None:
        """All outputs of `evaluations` by the signals as they are."""
        values = self._signals.values
        for each in evaluations:
            for held, samples in each.held:
                values[held] = values[samples]
            each.set_inputs(values)
        for each in evaluations:
            each.read()

    def find_sources(self, evaluations: Sequence[Evaluation]) -> list[int]:
        """The places of the outputs of `evaluations` on which some of them depend."""
        own = {p for each in evaluations for p in each.places}
        read = (self._signals.sources(c) for each in evaluations for c in each.needs)
        return sorted({p for sources in read for p in sources if p in own})

    def guess(self, loop: Sequence[Evaluation]) -> Vector:
        """What the sources of a loop would have to put out for the start values that the inputs
        have, by place; texts are those that are put out."""
        guess = self._signals.values.copy()
        written = set[int]()
        known = dict[int, float]()
        for c in self._connections(loop):
            given = {s.name: as_signal(s, v) for s, v in self._fmus.system.fmu[c.target].starts}
            for place, s in zip(self._signals.sources(c), c.inputs, strict=True):
                if s.type in WRITTEN:
                    written.add(place)
                else:
                    start = np.nan_to_num(given.get(s.name, s.start))
                    value = (start - s.conversion.offset) / s.conversion.factor
                    known.setdefault(place, float(value))
        if written:
            for each in loop:
                each.read()
            guess[[*written]] = self._signals.values[[*written]]
        guess[[*known]] = [*known.values()]
        return guess

    def solve(self, loop: Sequence[Evaluation], guess: Vector) -> None:
        """Solve for the outputs on a loop, from the signals `guess`; the signals have the solution.

        Newton's method is for those of floating point at both ends of their connections. Others are
        passed around the loop, more often than there are evaluations on it only while their changes
        do not become larger. Raises FmuFault where there is no agreement.
        """
        values, places = self._signals.values, self.find_sources(loop)
        rounded = {p for c in self._connections(loop) for p in self._rounded(c)}
        continuous = [p for p in places if p not in rounded]
        discrete = [p for p in places if p in rounded]
        point, given = guess[continuous], guess[discrete]
        refused: FmuFault | None = None

        def residual(point: Vector) -> Vector:
            nonlocal refused
            refused = None
            values[discrete], values[continuous] = given, point
            try:
                self.evaluate(loop)
            except FmuFault as fault:  # fmi2Discard: the FMU takes other values
                if not fault.repeatable:
                    raise
                refused = fault
                return np.full(len(point), np.nan)
            return values[continuous] - point

        # Start values may be outside of what an FMU is defined for, on a loop that there is by
        # declaration alone: what the others give is passed on until all is finite.
        for _ in loop:
            if refused or np.isfinite(residual(point)).all():
                break
            given_back = values[continuous]
            point = np.where(np.isfinite(given_back), given_back, point)
        solver = self._solver(loop, continuous)
        changes = [np.inf]
        for turn in range(MOST):
            solution = solver.solve(residual, point, TOLERANCE, MOST)
            point, wrong = solution.point, np.abs(solution.residual)
            if not solution.error <= TOLERANCE:
                worst = int(
                    np.argmax(np.where(np.isnan(wrong), np.inf, wrong / (1 + np.abs(point))))
                )
                raise refused or self._unconverged(continuous[worst], float(point[worst]), loop)
            change = np.abs(values[discrete] - given)
            if not change.any():
                break
            changes.append(float(change.max()))
            if (turn >= len(loop) and changes[-1] > changes[-2]) or turn + 1 == MOST:
                worst = int(np.argmax(change))
                raise self._unconverged(discrete[worst], float(given[worst]), loop)
            given = values[discrete]
        point = polish(residual, solution)
        values[discrete], values[continuous] = given, point

    def _connections(self, loop: Sequence[Evaluation]) -> list[Connection]:
        """Those between outputs on a loop."""
        places = {*self.find_sources(loop)}
        needs = {c.name: c for each in loop for c in each.needs}
        return [c for c in needs.values() if places.intersection(self._signals.sources(c))]

    def _rounded(self, c: Connection) -> list[int]:
        """The sources of a connection of which it does not pass on any real number."""
        rows = zip(self._signals.sources(c), c.outputs, c.inputs, strict=True)
        return [p for p, y, u in rows if not {y.type, u.type} <= {*CONTINUOUS}]

    def _solver(self, loop: Sequence[Evaluation], places: list[int]) -> Solver:
        if len(places) > MAX_COLUMNS:
            return Aitken()
        newton = Newton()
        connections = self._connections(loop)
        if every := jacobians.find_derivatives(self._fmus, connections, places):
            tangent = np.zeros((len(self._signals.values), len(places)))
            tangent[places] = np.eye(len(places))
            for c in connections:
                if c.hold:
                    tangent[self._signals.hold(c.name)] = tangent[self._signals.sources(c)]
            newton.supplied = lambda: jacobians.jacobian_of_residual(every, tangent, places)
        return newton

    def _unconverged(self, place: int, given: float, loop: Sequence[Evaluation]) -> FmuFault:
        """The fault that the output at `place` is not what is `given` for it."""
        require_finite(self._fmus.instances)
        signals, system = self._signals, self._fmus.system
        spans = ((fmu, signals.fmu(fmu.name)) for fmu in system.fmus)
        fmu, span = next((f, s) for f, s in spans if s.start <= place < s.stop)
        connections = ", ".join(c.name for c in self._connections(loop))
        return FmuFault(
            fmu.name,
            f"output {fmu.description.outputs[place - span.start].name} does not converge in "
            f"initialisation: {given!s} around its algebraic loop ({connections}) gives "
            f"{signals.values[place]!s}; take a connection out of the loop, or give inputs on it "
            "start values nearer to a solution",
            0.0,
            repeatable=True,
        )


def polish(residual: Callable[[Vector], Vector], solution: Solution) -> Vector:
    """The solution w after w <- w + r, as long as this halves the error: so a loop by declaration
    alone, in which nothing depends on itself, is exact. The last evaluation is at w."""
    w, r, reached = solution.point, solution.residual, solution.error
    while reached > 0.0:
        further = w + r
        r = residual(further)
        if not error(r, further) <= reached / 2:
            residual(w)
            break
        w, reached = further, error(r, further)
    return w


START_POSE_OUTPUTS = {DEVICE: ("workspace_margin", "x_true")}
"""Outputs by which an unreachable start pose is reported, by block."""


def require_finite(instances: Mapping[str, Instance]) -> None:
    """Raises FmuFault if an output is not finite."""
    for instance in instances.values():
        instance.require_finite()


def start_outside(fmu: str, fmus: LoadedFmus) -> FmuFault:
    """The fault of a run that ends before its first step, outside of the device's workspace: with
    the pose that the device is given, at which it may not be."""
    scalars, signals = fmus.instances[fmu].description.port("x_true", "output"), fmus.signals
    given = (c for c in fmus.system.connections if (c.target, c.target_port) == (fmu, "x_start"))
    places = [[*signals.sources(c)] for c in given]
    places.append([signals.scalar(fmu, s.name) for s in scalars])
    units = tuple(s.unit for s in scalars)
    space = next(each for each in (PLANE, POINT) if each.pose.units == units)
    told = describe_start_outside(space, signals.values[places[0]].tolist())
    return FmuFault(fmu, told, 0.0, repeatable=True)
