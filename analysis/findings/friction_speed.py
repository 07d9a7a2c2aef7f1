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
    table = of_block(results, JOINT_RATES, len(units))
    for (name, unit), rate in zip(units, table[JOINT_RATES].T if table else (), strict=False):
        speed, most = speeds.get(name, 0.0), float(np.abs(rate).max(initial=0.0))
        if (error := turns(rate, speed) * speed) > BOUND * most:
            yield (
                f"warning: friction of {name} is Coulomb's beyond {speed:.2g} {unit}/s only, and "
                f"its rate of up to {most:.2g} {unit}/s may be off by about {error / most:.0%} "
                "after so many turns: take more mechanism.substeps or a higher rate"
            )


def turns(rate: Vector, smallest: float) -> int:
    """How often a rate changes its sign, counted once it is beyond `smallest`."""
    signs = np.sign(rate[np.abs(rate) > smallest])
    return int(np.count_nonzero(signs[1:] != signs[:-1]))
