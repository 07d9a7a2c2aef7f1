"""What happened when in a run: spans of time that drawings, pages and reports mark.

Each is found in the samples as they are recorded, and lasts until the first sample without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.forces import torques, touching
from hapticlink.analysis.findings.tracking import (
    COPY_BRANCH_OK,
    constrained,
    constraint_counts,
    of_block,
)
from hapticlink.analysis.findings.user_port import UserPort, ports, tolerated
from hapticlink.orchestrator.base.signal_names import WORKSPACE_MARGIN
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.results.recorded_scene import all_devices

EPISODES = {
    "folded": "graphics copy folded",
    "saturated": "motors at their limit",
    "energy": "energy generated at the user's port",
    "constraints": "unusual number of constrained directions",
    "contacts": "contacts",
    "outside": "outside the device's workspace",
}
"""Kinds of episodes and their meaning."""
FULL_TORQUE = 1 - 1e-6
"""Share of their largest torque from which on motors are at their limit."""


class Episode(NamedTuple):
    """A span of time (s) of a kind, and what is said of it."""

    kind: str
    begin: float
    end: float
    said: str


def episodes(results: Results) -> list[Episode]:
    """The episodes of a run, by kind and then by time. Signals that are not recorded have none."""
    counts = constraint_counts(results.windows())
    usual = max(counts, key=lambda number: counts[number], default=0.0)
    unusual = {number: usual for number in sorted(counts) if number != usual}
    windows, most = zip(results.windows(), ports(results), strict=True), tolerated(results)
    return _episodes(_states(window, port, most, unusual) for window, port in windows)


def saturations(results: Results) -> list[Episode]:
    """The episodes of motors at their limit alone."""
    return _episodes(_saturated(window) for window in results.windows())


def _episodes(windows: Iterable[Iterable[State]]) -> list[Episode]:
    changes: dict[tuple[str, str], Changes] = {}
    for states in windows:
        for kind, times, holds, said in states:
            changes.setdefault((kind, said or EPISODES[kind]), Changes()).add(times, holds)
    return [Episode(k, a, b, said) for (k, said), of in changes.items() for a, b in spans(*of.all)]


class Changes:
    """The samples of a state at which it changes, and the last one: they have its spans."""

    def __init__(self) -> None:
        self._kept: list[tuple[Vector, NDArray[np.bool_]]] = []
        self._last: tuple[Vector, NDArray[np.bool_]] | None = None

    def add(self, times: Vector, holds: NDArray[np.bool_]) -> None:
        """The samples that follow."""
        if len(times):
            before = ~holds[:1] if self._last is None else self._last[1]
            at = np.flatnonzero(np.diff(np.concatenate([before, holds])))
            self._kept.append((times[at], holds[at]))
            self._last = times[-1:], holds[-1:]

    @property
    def all(self) -> tuple[Vector, NDArray[np.bool_]]:
        """Times (s), and whether it holds from there on."""
        kept = [*self._kept, *([self._last] if self._last else [])]
        times, holds = zip(*kept, strict=True) if kept else ([np.zeros(0)], [np.zeros(0, bool)])
        return np.concatenate(times), np.concatenate(holds)


def spans(times: Vector, holds: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Begin and end (s) of each stretch of samples at which `holds` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    last = len(times) - 1
    return [(float(times[a]), float(times[min(b, last)])) for a, b in edges.reshape(-1, 2)]


State = tuple[str, Vector, NDArray[np.bool_], str]
"""Kind, times (s) of samples, whether each has it, and what is said where it varies."""


def _states(
    window: Results, port: UserPort | None, most: float, unusual: Mapping[float, float]
) -> Iterator[State]:
    """most: the energy (J) that is tolerated at the user's port; unusual: numbers of constrained
    directions, with the one that is usual."""
    if branch := of_block(window, COPY_BRANCH_OK):
        rows = window.within(branch["time"])
        yield "folded", branch["time"][rows], branch[COPY_BRANCH_OK][rows] == 0, ""
    yield from _saturated(window)
    if port:
        yield "energy", port.time_s, port.generated_J > most, ""
    if counted := constrained(window):
        table, name = counted
        rows = window.within(table["time"])
        for value, usual in unusual.items():
            said = f"{value:.0f} constrained directions, not {usual:.0f}"
            yield "constraints", table["time"][rows], table[name][rows] == value, said
    if contact := touching(window):
        yield "contacts", *contact, ""
    if margin := of_block(window, WORKSPACE_MARGIN):
        rows = window.within(margin["time"])
        yield "outside", margin["time"][rows], margin[WORKSPACE_MARGIN][rows] < 0, ""


def _saturated(window: Results) -> Iterator[State]:
    for user, device in all_devices(window).items():
        if driven := torques(window, device, user):
            most = np.abs(driven[1]).max(axis=1)
            said = f"{EPISODES['saturated']}: {user}" if user else ""
            yield "saturated", driven[0], most >= FULL_TORQUE * device.torque_limit, said
