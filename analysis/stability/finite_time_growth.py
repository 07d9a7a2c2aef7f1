"""Growth of perturbations along a trajectory over a finite time, where there is no rest.

    g = ln sigma_max(D^-1 A D)/t,   A = d z(t_0 + t)/d z(t_0)

by the perturbations that a run carries with it (forward_sensitivity.py); D are the scales that
balance A, rows as large as columns, so that g does not depend on units. It says by how much the
worst perturbation grows in that time, and nothing of what comes after: a stable system may grow at
first, and an unstable one shrink.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from hapticlink.analysis.stability.lifted_map import behind_start, lifted_map, long_enough
from hapticlink.analysis.stability.linearisable_scene import linearisable
from hapticlink.analysis.stability.linearisation import linearised
from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

SWEEPS = 50


def finite_time_growth(
    scene: str | Path | Scene, options: Options = (), *, at: float = 0.0, seconds: float = 0.5
) -> float:
    """The rate (1/s) at which the worst perturbation grows over `seconds` from the time `at` (s)
    on, or from where holds have all their samples. It is no verdict on stability.

    Raises InputFault as `stability` does for what has no map, and for a time that is not positive.
    """
    if not 0.0 < seconds < math.inf:
        raise InputFault(f"seconds = {seconds}: give a positive time")
    with linearisable(scene, options) as (read, system, _):
        system = long_enough(read, system, at + seconds)
        with lifted_map(system, 0.0, read) as map_:
            ticks = max(1, round(seconds / float(system.timeline.base)))
            along = map_.over(system, (behind_start(system, at), ticks))
            linear = linearised(along, along.start)
    size = np.linalg.norm(_balanced(linear.A), 2)
    return float(np.log(size)) / (ticks * float(system.timeline.base))


def _balanced(A: Matrix) -> Matrix:
    """D^-1 A D with rows as large as columns, without the diagonal: Osborne, J. ACM 7 (1960), 338;
    scales in whole powers of 2, as LAPACK takes them, would leave a factor of 2."""
    A = A.copy()
    for _ in range(SWEEPS):
        for i in range(len(A)):
            row, column = (math.sqrt(max(0.0, v @ v - A[i, i] ** 2)) for v in (A[i], A[:, i]))
            if row and column:
                d = math.sqrt(row / column)
                A[i] /= d
                A[:, i] *= d
    return A
