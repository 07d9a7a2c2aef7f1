"""Consistent start values: inputs are set and outputs read in initialisation mode until they agree.

Sweeps over all FMUs converge for chains of feed-through and for contracting algebraic loops. What
they leave is solved by Newton's method, with the values that still change as unknowns, and with the
FMUs' directional derivatives where all of them give these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.base.signal_names import DEVICE
from hapticlink.orchestrator.fmi.instance import Instance
from hapticlink.orchestrator.run import jacobians
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.run.solvers import Matrix, Newton, Vector
from hapticlink.orchestrator.scene.start_pose import describe_start_outside

SWEEPS = 50
TOLERANCE = 1e-12


def initialize(fmus: LoadedFmus) -> bool:
    """Initialise every instance; the outputs of t = 0 are in the signal vector afterwards. Returns
    whether sweeps sufficed, without Newton's method.

    Sweeps over all FMUs carry values through connections, parameters set from outputs among
    them. Raises FmuFault where they don't agree to 1e-12 within 50 sweeps and 50 steps of Newton,
    or aren't finite.
    """
    system, instances, signals = fmus.system, fmus.instances, fmus.signals
    timeline = system.timeline
    holds = [(signals.hold(c.name), signals.sources(c)) for c in system.connections if c.hold]
    setters = []
    for fmu in system.fmus:
        interrupt.raise_if_interrupted()
        instance = instances[fmu.name]
        longest = timeline.clock(fmu.clock).longest
        instance.enter_initialization(timeline.seconds(timeline.end + longest))
        incoming = [c for c in system.connections if c.target == fmu.name]
        if incoming:
            setters.append((instance, fmus.setter(incoming, signals.places)))
    for instance in instances.values():
        instance.read()
    values = signals.values

    def sweep() -> None:
        for instance, set_from in setters:
            for held, sources in holds:
                values[held] = values[sources]
            set_from(values)
            instance.read()

    first = values.copy()
    for _ in range(SWEEPS):
        before = values.copy()
        sweep()
        agree = np.isclose(values, before, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
        if agree.all():
            break
    else:
        _solve(fmus, agree & np.isfinite(values), first, sweep)
    require_finite(instances)
    for instance in instances.values():
        instance.exit_initialization()
    return bool(agree.all())


def _solve(fmus: LoadedFmus, settled: np.ndarray, first: Vector, sweep: Callable[[], None]) -> None:
    """Solve by Newton's method for the outputs that did not converge, from their first values."""
    values = fmus.signals.values
    sources = {p for c in fmus.system.connections for p in fmus.signals.sources(c)}
    places = sorted(p for p in sources if not settled[p])

    def residual(point: Vector) -> Vector:
        values[places] = point
        sweep()
        return values[places] - point

    newton = Newton()
    newton.supplied = _jacobian(fmus, places)
    solution = newton.solve(residual, first[places], TOLERANCE, SWEEPS)
    if not solution.error <= TOLERANCE:
        agree = np.ones(len(values), bool)
        agree[places] = np.abs(solution.residual) <= TOLERANCE * (1.0 + np.abs(solution.point))
        before = values.copy()
        before[places] = solution.point
        _raise_unconverged(fmus, agree, before)


def _jacobian(fmus: LoadedFmus, places: list[int]) -> Callable[[], Matrix | None]:
    """A function for the Jacobian of a sweep's residual: unit changes of the signals at `places`
    are propagated from FMU to FMU by directional derivatives. It returns None where an FMU gives
    none."""
    signals = fmus.signals
    moved = [c for c in fmus.system.connections if {*places} & {*signals.sources(c)}]
    every = jacobians.find_derivatives(fmus, moved, places)
    held = [(signals.hold(c.name), signals.sources(c)) for c in moved if c.hold]

    def jacobian() -> Matrix | None:
        if every is None:
            return None
        tangent = np.zeros((len(signals.values), len(places)))
        tangent[places] = np.eye(len(places))
        for partial in every:
            for taken, sources in held:
                tangent[taken] = tangent[sources]
            through = partial.of(tangent)
            if through is None:
                return None
            tangent[list(partial.rows)] = through
        return tangent[places] - np.eye(len(places))

    return jacobian


def _raise_unconverged(fmus: LoadedFmus, agree: np.ndarray, before: Vector) -> None:
    signals = fmus.signals
    for fmu in fmus.system.fmus:
        span = signals.fmu(fmu.name)
        for i, scalar in enumerate(fmu.description.outputs, start=span.start):
            if not agree[i]:
                what = f"output {scalar.name} does not converge in initialisation, nor by Newton"
                values = f"{before[i]!s} around its algebraic loop gives {signals.values[i]!s}"
                remedy = "the loop has no consistent start values: take a connection out of it"
                raise FmuFault(fmu.name, f"{what}: {values}; {remedy}", 0.0, repeatable=True)


START_POSE_OUTPUTS = {DEVICE: ("workspace_margin", "x_true")}
"""Outputs by which an unreachable start pose is reported, by block."""


def require_finite(instances: Mapping[str, Instance]) -> None:
    """Raises FmuFault if an output is not finite. If the device's arms do not reach the start pose,
    which makes its angles and all that depends on them NaN, the fault says so instead of naming the
    first such output."""
    for fmu, instance in instances.items():
        if instance.description.block == DEVICE and not np.isfinite(instance.outputs).all():
            names = (s.name for s in instance.description.outputs)
            start = dict(zip(names, instance.outputs.tolist(), strict=True))
            if (margin := start["workspace_margin"]) < 0:
                pose = [start[f"x_true[{i}]"] for i in range(1, 1 + PLANE.size)]
                raise FmuFault(fmu, describe_start_outside(pose, margin), 0.0, repeatable=True)
    for instance in instances.values():
        instance.require_finite()
