"""What happened when in a run: spans of time that drawings, pages and reports mark.

Each is found in the samples as they are recorded, and lasts until the first sample without it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.forces import torques, touching
from hapticlink.analysis.findings.limits import EPISODES, FULL_TORQUE, NOTICEABLE_J
from hapticlink.analysis.findings.tracking import COPY_BRANCH_OK, constrained, of_block
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.loop_names import WORKSPACE_MARGIN
from hapticlink.orchestrator.results.scene_part import all_devices
from hapticlink.orchestrator.results.tables import Results, Vector


class Episode(NamedTuple):
    """A span of time (s) of a kind, and what is said of it."""

    kind: str
    begin: float
    end: float
    said: str


def episodes(results: Results) -> list[Episode]:
    """The episodes of a run, by kind and then by time. Signals that are not recorded have none."""
    return [episode for state in _states(results) for episode in _spans(*state)]


def saturations(results: Results) -> list[Episode]:
    """The episodes of motors at their limit alone."""
    return [episode for state in _saturated(results) for episode in _spans(*state)]


def _spans(kind: str, times: Vector, holds: NDArray[np.bool_], said: str) -> list[Episode]:
    return [Episode(kind, a, b, said or EPISODES[kind]) for a, b in spans(times, holds)]


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
    yield from _saturated(results)
    if port := user_port(results):
        yield "energy", port.time_s, port.generated_J > NOTICEABLE_J, ""
    if counted := constrained(results):
        table, name = counted
        values, counts = np.unique(table[name], return_counts=True)
        usual = values[counts.argmax()] if len(values) else 0
        for value in values[values != usual]:
            said = f"{value:.0f} constrained directions, not {usual:.0f}"
            yield "constraints", table["time"], table[name] == value, said
    if contact := touching(results):
        yield "contacts", *contact, ""
    if margin := of_block(results, WORKSPACE_MARGIN):
        yield "outside", margin["time"], margin[WORKSPACE_MARGIN] < 0, ""


def _saturated(results: Results) -> Iterator[State]:
    for user, device in all_devices(results).items():
        if driven := torques(results, device, user):
            most = np.abs(driven[1]).max(axis=1)
            said = f"{EPISODES['saturated']}: {user}" if user else ""
            yield "saturated", driven[0], most >= FULL_TORQUE * device.torque_limit, said
