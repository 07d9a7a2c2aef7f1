"""Parameters that connections set once, as start values: what other tools need, which know no
connection to a parameter."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

from hapticlink.orchestrator.fmi.start_values import Given, Starts
from hapticlink.orchestrator.fmi.units import SAME
from hapticlink.orchestrator.fmi.variables import CONTINUOUS, Scalar
from hapticlink.orchestrator.run.initialize import initialize
from hapticlink.orchestrator.run.open_fmus import LoadedFmus
from hapticlink.orchestrator.system.system import System


def apply_initial_connections(system: System) -> System:
    """The system without the connections that act in initialisation only: each target starts with
    the values that they carry once the FMUs of the system are initialised.

    Raises FmuFault where an FMU fails or the values do not settle.
    """
    carried = _carry_starts(system)
    fmus = tuple(fmu.starting(carried.get(fmu.name, ())) for fmu in system.fmus)
    connections = tuple(c for c in system.connections if not c.initial)
    return replace(system, fmus=fmus, connections=connections)


def by_port(system: System) -> dict[str, dict[str, tuple[float, ...]]]:
    """What those connections carry, by FMU and parameter. Raises FmuFault as
    `apply_initial_connections` does."""
    carried: dict[str, dict[str, tuple[float, ...]]] = {}
    for name, starts in _carry_starts(system).items():
        ports = carried.setdefault(name, {})
        for scalar, value in starts:
            ports[scalar.port] = (*ports.get(scalar.port, ()), float(value))
    return carried


def _carry_starts(system: System) -> dict[str, Starts]:
    once = [c for c in system.connections if c.initial]
    if not once:
        return {}
    with ExitStack() as stack:
        fmus = LoadedFmus(system, stack)
        initialize(fmus)
    signals = fmus.signals
    starts: dict[str, Starts] = {}
    for c in once:
        rows = zip(c.inputs, signals.values[signals.sources(c)].tolist(), strict=True)
        taken = tuple((replace(s, conversion=SAME), _start(s, value)) for s, value in rows)
        starts[c.target] = starts.get(c.target, ()) + taken
    return starts


def _start(scalar: Scalar, value: float) -> Given:
    """What a connection sets, as `fmi.transfer` does."""
    value = scalar.conversion.factor * value + scalar.conversion.offset
    if scalar.type in CONTINUOUS:
        return value
    return value >= 0.5 if scalar.type == "Boolean" else round(value)
