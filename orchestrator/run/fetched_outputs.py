"""The outputs that a run fetches: those that something reads at each communication point, and those
that only the rows of a table need, where there is a row.

What reads outputs asks the signal vector for their places, so that these are known without a list
of who reads what. Entries of a port are fetched together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hapticlink.orchestrator.run.energy.balance import Balance
from hapticlink.orchestrator.run.energy.meter import metered
from hapticlink.orchestrator.run.hold_parts import describe_holds, describe_spring
from hapticlink.orchestrator.run.initialize import START_POSE_OUTPUTS
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.run.step_check import StepCheck, find_first_derivatives
from hapticlink.orchestrator.system.system import Fmu, System


def choose_fetched(system: System) -> System:
    """The system with the outputs of each FMU that a run of it fetches."""
    recording = system.recording
    if recording.outputs is None and recording.every == 1:
        return system
    every = tuple(f"{u.name}.{s.name}" for u in system.fmus for s in u.description.outputs)
    written = every if recording.outputs is None else recording.outputs
    often, rows = {*_find_read(system)}, {*written}
    separate = recording.every > 1 and not recording.slower
    fmus = tuple(_with(u, often, rows, separate) for u in system.fmus)
    return replace(system, fmus=fmus, recording=replace(recording, outputs=written))


def _with(fmu: Fmu, often: set[str], rows: set[str], separate: bool) -> Fmu:
    """The FMU with the ports of which one of these has an entry; `separate`, those for rows alone
    come after the others."""
    every = fmu.description.outputs
    read, written = (
        {s.port for s in every if f"{fmu.name}.{s.name}" in names} for names in (often, rows)
    )
    outputs = [s for s in every if s.port in read | written]
    recorded_only = frozenset(s.name for s in outputs if separate and s.port not in read)
    outputs.sort(key=lambda s: s.name in recorded_only)
    others = [s for s in fmu.description.scalars if s not in every]
    return replace(
        fmu,
        description=replace(fmu.description, scalars=(*others, *outputs)),
        recorded_only=recorded_only,
    )


def _find_read(system: System) -> Iterator[str]:
    """The outputs, `fmu.output`, that are read at each communication point."""
    signals = SignalVector(system)
    _ = [*metered(signals)]
    Balance(signals)
    for parts in describe_holds(signals).values():
        if parts.spring:
            describe_spring(parts.spring, signals)
    for c in system.connections:
        signals.sources(c)
    if system.ends_when:
        signals.scalar(system.ends_when.fmu, system.ends_when.variable)
    yield from (f"{fmu}.{variable}" for fmu, variable in signals.asked)
    for fmu in system.fmus:
        yield from (f"{fmu.name}.{name}" for name in _of_itself(fmu))


def _of_itself(fmu: Fmu) -> Iterator[str]:
    """The outputs of an FMU by which its steps and its faults are judged."""
    description = fmu.description
    judged = START_POSE_OUTPUTS.get(description.block or "", ())
    for scalar in description.outputs:
        if scalar.bound or scalar.port in judged:
            yield scalar.name
    if StepCheck.possible(description):
        for pair in find_first_derivatives(description):
            yield from pair
