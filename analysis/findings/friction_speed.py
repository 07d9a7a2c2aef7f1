"""Warns of joints whose friction is far from Coulomb's law at the speeds of a run.

Friction that sticks changes its sign while a joint's rate goes from v_f to -v_f
(components/forces/friction.py), so that each turn of the joint costs up to about v_f of its rate:

    error = turns v_f / max |rate|

By default v_f is proportional to the integration step (components/dynamics/friction_scale.py).
Cut joints have no output of their rate and are not judged.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import of_block
from hapticlink.components.specs.joint_types import JOINT_TYPES
from hapticlink.orchestrator.base.signal_names import JOINT_RATES
from hapticlink.orchestrator.results.read_results import Results, Vector

BOUND = 0.1


def coarse(results: Results) -> Iterator[str]:
    """A line for each joint whose friction errs by more than BOUND of its largest rate."""
    linkage, speeds = results.record.scene["linkage"], results.record.friction_speeds
    if not linkage or not speeds:
        return
    units = [(j["name"], unit) for j in linkage["joint"] for unit in JOINT_TYPES[j["type"]].units]
    smallest = [speeds.get(name, 0.0) for name, _ in units]
    largest, turns = np.zeros(len(units)), [Turns(speed) for speed in smallest]
    for window in results.windows():
        if table := of_block(window, JOINT_RATES, len(units)):
            rates = table[JOINT_RATES][window.within(table["time"])]
            largest = np.maximum(largest, np.abs(rates).max(axis=0, initial=0.0))
            for joint, rate in zip(turns, rates.T, strict=True):
                joint.add(rate)
    for (name, unit), speed, most, turned in zip(units, smallest, largest, turns, strict=True):
        if (error := turned.count * speed) > BOUND * most:
            yield (
                f"warning: friction of {name} is Coulomb's beyond {speed:.2g} {unit}/s only, and "
                f"its rate of up to {most:.2g} {unit}/s may be off by about {error / most:.0%} "
                "after so many turns: take more mechanism.substeps or a higher rate"
            )


class Turns:
    """How often a rate changes its sign, counted once it is beyond `smallest`."""

    def __init__(self, smallest: float) -> None:
        self._smallest, self._last, self.count = smallest, np.zeros(0), 0

    def add(self, rate: Vector) -> None:
        """The samples that follow."""
        signs = np.concatenate([self._last, np.sign(rate[np.abs(rate) > self._smallest])])
        self.count += int(np.count_nonzero(signs[1:] != signs[:-1]))
        self._last = signs[-1:]
