"""Consistent start values: inputs set and outputs read in initialisation mode until they agree."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hapticlink.orchestrator.board import Board
from hapticlink.orchestrator.faults import FmuFault
from hapticlink.orchestrator.fmu import Instance
from hapticlink.orchestrator.system import System

SWEEPS = 50
TOLERANCE = 1e-12


def initialize(system: System, instances: Mapping[str, Instance], board: Board) -> None:
    """Leave every instance in step mode, and the outputs of t = 0 on the board.

    Sweeps over all FMUs carry values through connections, parameters set from outputs among
    them. Raises FmuFault where they don't agree to 1e-12 within 50 sweeps or aren't finite.
    """
    timeline = system.timeline
    holds = [(board.hold(c.name), board.sources(c)) for c in system.connections if c.hold]
    setters = []
    for unit in system.units:
        instance = instances[unit.name]
        longest = timeline.clock(unit.clock).longest
        instance.enter_initialization(timeline.seconds(timeline.end + longest))
        incoming = [c for c in system.connections if c.target == unit.name]
        if incoming:
            scalars = [s for c in incoming for s in c.inputs]
            places = [p for c in incoming for p in board.places(c)]
            setters.append((instance, instance.connect(scalars, places)))
    for instance in instances.values():
        instance.read()
    values = board.values
    for _ in range(SWEEPS):
        before = values.copy()
        for instance, set_from in setters:
            for held, sources in holds:
                values[held] = values[sources]
            set_from(values)
            instance.read()
        agree = np.isclose(values, before, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
        if agree.all():
            break
    else:
        _raise_unsettled(system, board, agree, before)
    for instance in instances.values():
        instance.require_finite()
        instance.exit_initialization()


def _raise_unsettled(system: System, board: Board, agree: np.ndarray, before: np.ndarray) -> None:
    for unit in system.units:
        span = board.unit(unit.name)
        for i, scalar in enumerate(unit.description.outputs, start=span.start):
            if not agree[i]:
                what = f"output {scalar.name} does not settle in initialisation"
                values = f"{before[i]!s} and {board.values[i]!s} in turn"
                raise FmuFault(unit.name, f"{what}: {values}", 0.0)
