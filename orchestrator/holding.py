"""From a connection to the hold that stands on it, with what it knows of its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hapticlink.orchestrator.board import Board
from hapticlink.orchestrator.crossings import derivative, port
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.hold import Hold, Vector
from hapticlink.orchestrator.holds.kinds import Projector, Semidefinite, Unwrapped
from hapticlink.orchestrator.holds.site import Site
from hapticlink.orchestrator.latency import Late, Link
from hapticlink.orchestrator.system import Connection, System


def make_hold(connection: Connection, system: System, board: Board) -> Hold:
    """The hold of `connection`, its kind kept and behind its latency."""
    assert connection.hold is not None
    kind, size = HOLDS[connection.hold], len(connection.inputs)
    site = _site(connection, system, board)
    hold = kind(site)
    if connection.kind == "projector" and not kind.gives_samples:
        hold = Projector(lambda: kind(site), size)
    elif connection.kind == "semidefinite" and not kind.gives_samples:
        hold = Semidefinite(lambda: kind(site), size)
    elif connection.kind == "angle":
        angles = [i for i, s in enumerate(connection.outputs) if s.unit in ("rad", None)]
        hold = Unwrapped(lambda: kind(site), angles)
    if connection.latency:
        hold = Late(hold, Link(connection.latency, system.timeline.base))
    if kind.needs == "derivative" and (name := derivative(connection, system.unit)):
        slopes = board.port(system.unit[connection.source], name)
        hold = _Beside(hold, _reader(board, slopes))
    return hold


class _Beside:
    """Sends the derivative along with each sample, so that both are late together."""

    def __init__(self, hold: Hold, derivative: Callable[[], Vector]) -> None:
        self._hold, self._derivative, self.value = hold, derivative, hold.value

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._hold.push(stamp, np.concatenate([sample, self._derivative()]), arrival)


def _site(connection: Connection, system: System, board: Board) -> Site:
    """The displacement only where the hold keeps account of energy."""
    moved = None
    found = port(connection, system.power)
    if HOLDS[connection.hold or ""].needs == "power" and found:
        unit = system.unit[connection.target]
        read = _reader(board, board.port(unit, found.displacement.partition(".")[2]))
        sign = found.sign
        moved = read if sign == 1.0 else lambda: sign * read()
    return Site(len(connection.inputs), system.timeline.seconds, moved)


def _reader(board: Board, places: Sequence[int]) -> Callable[[], Vector]:
    view = board.view(places)
    return (lambda: view) if view is not None else lambda: board.values[list(places)]
