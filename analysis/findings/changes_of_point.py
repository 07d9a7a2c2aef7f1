"""When the hand let go of a point of the linkage and held another, and what the coupling lost by
that."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.tracking import newest, of_any_shape, of_block
from hapticlink.components.specs.linkage import NO_POINT
from hapticlink.orchestrator.base.signal_names import (
    COUPLING_ENERGY,
    HANDLE_INERTIAS,
    HANDLE_VELOCITY,
    HELD_POINT,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Vector


class ChangeOfPoint(NamedTuple):
    """The points before and after a time (s), "none" where none is held, and what there is then
    beside the mechanism's energy, None without a device: the energy (J) stored in the coupling,
    which a hand that lets go loses, and the handle's kinetic energy (J)."""

    time: float
    before: str
    after: str
    stored: float | None
    handle: float | None


def changes_of_point(results: Results) -> list[ChangeOfPoint]:
    """The changes in the order of their times."""
    table = of_block(results, HELD_POINT)
    if table is None:
        return []
    names = (NO_POINT, *sorted(results.record.scene["linkage"]["points"]))
    time, held = table["time"], table[HELD_POINT].astype(int)
    changes = []
    for row in np.flatnonzero(np.diff(held)).tolist():
        coupling = _last(results, time[row], COUPLING_ENERGY)
        v = _last(results, time[row], HANDLE_VELOCITY)
        inertias = (_last(results, time[row], signal) for signal in HANDLE_INERTIAS)
        M = next((found for found in inertias if found is not None), None)
        handle = None if v is None or M is None else float(v @ M @ v) / 2
        before, after = (names[k] for k in held[row : row + 2].tolist())
        stored = None if coupling is None else float(coupling)
        changes.append(ChangeOfPoint(float(time[row]), before, after, stored, handle))
    return changes


def _last(results: Results, time: float, signal: str) -> Vector | None:
    """The newest sample of a signal at a time (s)."""
    if (table := of_any_shape(results, signal)) is None or not len(table["time"]):
        return None
    sample: Vector = table[signal][newest(table, time)]
    return sample


def describe_changes(results: Results) -> Iterator[str]:
    """A line for each change."""
    for change in changes_of_point(results):
        when = f"at {change.time:.4g} s"
        if change.before == NO_POINT:
            moves = "" if change.handle is None else _with_energy(change.handle)
            yield f"the hand took hold of {change.after} {when}{moves}"
            continue
        after = "" if change.after == NO_POINT else f" for {change.after}"
        lost = ""
        if change.stored is not None:
            lost = f": the {short(1e3 * change.stored)} mJ stored in the coupling are lost"
        yield f"the hand let go of {change.before}{after} {when}{lost}"


def _with_energy(handle: float) -> str:
    return (
        f", the coupling relaxed: the handle came with {short(1e3 * handle)} mJ of its own motion, "
        "of which the mechanism may get a part"
    )
