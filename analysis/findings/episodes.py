"""What happened when in a run: spans of time that drawings, pages and reports mark.

Each is found in the samples as they are recorded, and lasts until the first sample without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.forces import motor_loads, touching
from hapticlink.analysis.findings.tracking import (
    COPY_BRANCH_OK,
    UserSignals,
    constraint_counts,
    count_constrained,
    of_block,
)
from hapticlink.analysis.findings.user_port import tolerated_energy, user_port
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
    return _episodes(_states(results))


def saturations(results: Results) -> list[Episode]:
    """The episodes of motors at their limit alone."""
    return _episodes(_find_saturation(results))


def _episodes(states: Iterable[State]) -> list[Episode]:
    return [
        Episode(kind, begin, end, said or EPISODES[kind])
        for kind, times, holds, said in states
        for begin, end in spans(times, holds)
    ]


def spans(times: Vector, holds: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Begin and end (s) of each stretch of samples at which `holds` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    last = len(times) - 1
    return [(float(times[a]), float(times[min(b, last)])) for a, b in edges.reshape(-1, 2)]


State = tuple[str, Vector, NDArray[np.bool_], str]
"""Kind, times (s) of samples, whether each has it, and what is said where it varies."""


def _states(results: Results) -> Iterator[State]:
    if branch := of_block(results, COPY_BRANCH_OK):
        yield "folded", branch["time"], branch[COPY_BRANCH_OK] == 0, ""
    yield from _find_saturation(results)
    if port := user_port(results):
        yield "energy", port.time_s, port.generated_J > tolerated_energy(port.hand_work_J), ""
    if counted := count_constrained(results):
        times, numbers = counted
        counts = constraint_counts(numbers)
        usual = max(counts, key=lambda number: counts[number], default=0.0)
        for number in counts:
            if number != usual:
                said = f"{number:.0f} constrained directions, not {usual:.0f}"
                yield "constraints", times, numbers == number, said
    if contact := touching(results):
        yield "contacts", *contact, ""
    if margin := of_block(results, WORKSPACE_MARGIN):
        yield "outside", margin["time"], margin[WORKSPACE_MARGIN] < 0, ""


def _find_saturation(results: Results) -> Iterator[State]:
    for user, device in all_devices(results).items():
        if driven := motor_loads(results, device, UserSignals.of(user)):
            said = f"{EPISODES['saturated']}: {user}" if user else ""
            times, loads = driven
            yield "saturated", times, loads >= FULL_TORQUE, said
