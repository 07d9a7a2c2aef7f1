"""Step-size control on top of a scheme: sampled blocks keep their rate, plants take steps whose
size is chosen during the run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.fmi.capabilities import VARIABLE_STEP, varies_step
from hapticlink.orchestrator.plan import building_blocks
from hapticlink.orchestrator.plan.operations import (
    Advance,
    Event,
    Firing,
    Get,
    Operation,
    Part,
    Record,
    flat,
)
from hapticlink.orchestrator.system.ports import carries_power
from hapticlink.orchestrator.system.system import Connection, System

Scheme = Callable[[System, Event], tuple[Operation, ...]]


def block(system: System, event: Event, scheme: Scheme) -> tuple[Operation, ...]:
    """The operations of `event`; clocks whose plants are not connected keep their step sizes.

    Raises InputFault for plants whose step size cannot be varied, and if there are no connected
    plants.
    """
    assert system.coupling.step_control is not None
    between = {u.clock: _between(system, u.clock) for u in system.fmus}
    if not any(between.values()):
        raise InputFault(
            "[step_control] chooses when connected plants of one rate exchange values, and there "
            "are none: take it out, with more substeps or a finer integrator where needed"
        )
    clocks = [f.clock for f in event.firings if between.get(f.clock) and not f.final]
    operations = [*scheme(system, building_blocks.without_steps(event, clocks))]
    for clock in clocks:
        dticks = next(f.dticks for f in event.firings if f.clock == clock)
        plants = [u for u in system.fmus if u.clock == clock and not u.sampled]
        fixed = [u.name for u in plants if not varies_step(u.description)]
        if fixed:
            raise InputFault(
                f"[step_control] varies the step, and {', '.join(fixed)} cannot take that "
                f"({VARIABLE_STEP} is not true); take it out, with a higher rate"
            )
        if system.coupling.step_control.method == "doubling":
            what = "[step_control] method = 'doubling'"
            building_blocks.require_rollback(system, [u.name for u in plants], what)
        else:
            _require_energy(system, between[clock], Part(clock, dticks), scheme)
        operations.append(Advance(clock, dticks))
    return tuple(operations)


def _between(system: System, clock: str) -> list[Connection]:
    plants = [u.name for u in system.fmus if u.clock == clock and not u.sampled]
    return [c for name in plants for c in system.into(name) if c.source in plants]


def _require_energy(system: System, between: list[Connection], kind: Part, scheme: Scheme) -> None:
    """Raises InputFault for ecco if no connection between the plants carries power, if `energy` is
    missing, or if the coupling scheme interpolates."""
    assert system.coupling.step_control is not None
    if not any(carries_power(c, system.energy.power) for c in between):
        raise InputFault(
            "[step_control] method = 'ecco' needs the energy between plants, and no connection "
            f"between plants of {kind.clock} carries power: pair efforts and displacements in "
            "[[power]], or take method = 'doubling'"
        )
    if system.coupling.step_control.energy is None:
        raise InputFault(
            "[step_control] method = 'ecco' measures errors relative to a typical energy of the "
            "scene: give energy (J)"
        )
    if any(isinstance(op, Get) and op.ahead for op in flat(part(system, kind, scheme))):
        raise InputFault(
            "[step_control] method = 'ecco' estimates the error of extrapolation, and coupling = "
            f"{system.coupling.scheme!r} interpolates: take 'jacobi', 'gauss-seidel', or 'doubling'"
        )


def part(system: System, kind: Part, scheme: Scheme) -> tuple[Operation, ...]:
    """The operations of one step of a clock's plants alone, from outputs that have been read, or
    those of reading at its end, at that tick."""
    plants = tuple(u for u in system.fmus if u.clock == kind.clock and not u.sampled)
    alone = replace(system, fmus=plants, ends_when=None)
    event = Event(not kind.ended, (Firing(kind.clock, kind.dticks, kind.ended),))
    return tuple(op for op in scheme(alone, event) if not isinstance(op, Record))
