"""Fixed-point iteration of an algebraic loop: executes the operation Repeat."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.plan.operations import Blend, Get, Operation, Repeat
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.run import jacobians
from hapticlink.orchestrator.run.jacobians import PartialDerivatives
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.run.solvers import SOLVERS, Matrix, Newton, Solution, Vector
from hapticlink.orchestrator.scene.scene_tables import Iteration
from hapticlink.orchestrator.system.ports import companion_outputs
from hapticlink.orchestrator.system.system import Connection, System


def sum_iterations(counts: Iterable[Iterations]) -> Iterations | None:
    """The counts of all loops of a run together; None where it has none."""
    every = [vars(c) for c in counts]
    if not every:
        return None
    summed = {name: sum(c[name] for c in every) for name in every[0]}
    return Iterations(**summed | {"max_iterations": max(c["max_iterations"] for c in every)})


class Unconverged(Fault):
    """The iteration did not converge; names the connection with the largest residual."""

    repeatable = True


class FixedPoint:
    """One Repeat, with its solver's state. sequence: makes one call of operations. Raises
    Unconverged unless the scene accepts unconverged steps."""

    def __init__(
        self,
        operation: Repeat,
        simulation: Simulation,
        sequence: Callable[[Iterable[Operation]], Call],
    ) -> None:
        system, signals = simulation.system, simulation.signals
        self._guess, self._again = sequence(operation.guess), sequence(operation.again)
        self._body = sequence(
            replace(op, judged=False) if isinstance(op, Get) else op for op in operation.body
        )
        self._ask = sequence(op for op in operation.body if isinstance(op, Blend))
        self._settings: Iteration = system.coupling.iteration
        self._signals, self._meters, self._dticks = signals, simulation.meters, operation.dticks
        self.counts = Iterations()
        self._time = system.timeline.time
        connections = [c for c in system.connections if c.name in operation.connections]
        self._held = [(simulation.holds[c.name], signals.sources(c)) for c in connections if c.hold]
        names: dict[int, str] = {}
        for c in connections:
            for place in _dependencies(c, system, signals):
                names.setdefault(place, c.name)
        self._places, self._names = [*names], [*names.values()]
        self._solver = SOLVERS[self._settings.method]()
        self._tick = 0
        self._partial: list[PartialDerivatives] | None = None
        if isinstance(self._solver, Newton) and all(_constant(c, system) for c in connections):
            self._partial = jacobians.find_derivatives(simulation, connections, self._places)
            self._solver.supplied = self._jacobian

    def saved(self) -> dict[str, Any]:
        """What it keeps from step to step."""
        solver = {k: v for k, v in vars(self._solver).items() if not callable(v)}
        return {"solver": solver, "counts": vars(self.counts), "derives": self._partial is not None}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from what it kept."""
        vars(self._solver).update(saved["solver"])
        self.counts = Iterations(**saved["counts"])
        if not saved["derives"]:
            self._partial = None

    def __call__(self, tick: int) -> None:
        values, places, counts = self._signals.values, self._places, self.counts
        self._tick = tick
        began = False

        def residual(point: Vector) -> Vector:
            nonlocal began
            if began:
                counts.rollbacks += 1
                self._again(tick)
                self._meters.rollback(mark)
            began = True
            values[places] = point
            self._guess(tick)
            self._body(tick)
            return values[places] - point

        for hold, sources in self._held:
            values[sources] = hold.value(tick, self._dticks)[: len(sources)]
        mark = self._meters.checkpoint()
        before = counts.rollbacks
        settings = self._settings
        start = values[places]
        solution = self._solver.solve(residual, start, settings.tolerance, settings.most)
        counts.steps += 1
        counts.iterations += 1 + counts.rollbacks - before
        counts.max_iterations = max(counts.max_iterations, solution.iterations)
        if isinstance(self._solver, Newton):
            counts.jacobians += self._solver.jacobians
            counts.directional_jacobians += self._solver.supplied_jacobians
            self._solver.jacobians = self._solver.supplied_jacobians = 0
        if not solution.error <= settings.tolerance:
            self._unconverged(solution, tick)

    def _jacobian(self) -> Matrix | None:
        """Jacobian of the residual: the FMUs' directional derivatives of a step with respect to its
        held inputs, times the derivatives of these by the guess, in which the holds are linear."""
        if self._partial is None:
            return None
        values, places = self._signals.values, self._places
        before = values.copy()
        responses = []
        for moved in (None, *places):
            values[:] = before
            if moved is not None:
                values[moved] += 1.0
            self._guess(self._tick)
            self._ask(self._tick)
            responses.append(values.copy())
        values[:] = before
        tangent = np.stack(responses[1:], axis=1) - responses[0][:, None]
        jacobian = jacobians.jacobian_of_residual(self._partial, tangent, places)
        if jacobian is None:
            self._partial = None
        return jacobian

    def _unconverged(self, solution: Solution, tick: int) -> None:
        self.counts.unconverged += 1
        if self._settings.unconverged == "accept" and np.isfinite(solution.error):
            return
        shares = np.abs(solution.residual) / (1.0 + np.abs(solution.point))
        worst = int(np.argmax(np.where(np.isnan(shares), np.inf, shares)))
        other = "newton" if self._settings.method == "aitken" else "more iterations (most)"
        raise Unconverged(
            f"{self._names[worst]} does not converge at t = {self._time(tick):.6g} s: after "
            f"{solution.iterations} iterations ({self._settings.method}) its value at the end of "
            f"the step is {solution.point[worst]:.9g} where the FMUs give "
            f"{solution.point[worst] + solution.residual[worst]:.9g}; take a higher rate, or in "
            f"[iteration] {other} or a larger tolerance"
        )


def _constant(c: Connection, system: System) -> bool:
    """Whether the target's input is constant over its step and linear in the guess, and its outputs
    are those after the step."""
    return (
        system.coupling.substeps.get(c.target, 1) == 1
        and c.target not in system.coupling.get_after_set
        and c.latency is None
        and c.kind in (None, "table")
    )


def _dependencies(c: Connection, system: System, signals: SignalVector) -> list[int]:
    """Indices of the signals that the input of `c` depends on: the source's outputs, and those
    that its hold reads beside them."""
    further = (signals.scalar(c.source, s.name) for s in companion_outputs(c, system.fmu))
    return [*signals.sources(c), *further]
