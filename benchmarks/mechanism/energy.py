"""Long free motion of the undamped five-bar: closure and energy drift of every method.

12.6 mJ in null(W): the rate (1, 0, 0, 0) rad/s projected onto the closures, scaled to that energy.
200 s at 512 Hz.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks import mechanisms
from benchmarks.mechanism.errors import ALL, setting
from benchmarks.our_mechanism import Ours
from benchmarks.page import Progress
from benchmarks.rows import Rows
from hapticlink.components.specs.linkage import Mechanism

COLUMNS = ("integrator", "stabilization", "closure_m", "energy_drift")
ENERGY, END, RATE, NONE = 12.6e-3, 200, 512, (0.0, 0.0, 0.0)


def measure(out: Path, progress: Progress) -> list[dict[str, str]]:
    """Largest closure error (m) and relative energy change over the run, sampled every 1/8 s."""
    rows = Rows(out / "energy.csv", COLUMNS, keys=2)
    bar = mechanisms.five_bar()
    slow = replace(bar, start_velocity={"shoulder1": 1.0})
    probe = Ours(slow, NONE, Mechanism(), 1 / RATE)
    scale = math.sqrt(ENERGY / probe.outputs(probe.start)["energy"][0])
    moving = replace(bar, start_velocity={"shoulder1": scale})
    for k, (integrator, stabilization) in enumerate(ALL):
        progress(f"200 s: {integrator}, {stabilization}", k, len(ALL))
        if (integrator, stabilization) in rows:
            continue
        ours = Ours(moving, NONE, setting(integrator, stabilization), 1 / RATE)
        advance, x = ours.advance(out / ".compiled"), ours.start.copy()
        closure = drift = 0.0
        for _ in range(END * 8):
            x = advance(x, RATE // 8)
            y = ours.outputs(x) if np.isfinite(x).all() else {}
            if not y or not math.isfinite(y["energy"][0]):
                closure = drift = math.inf
                break
            closure = max(closure, float(y["closure_error"][0]))
            drift = max(drift, abs(float(y["energy"][0]) / ENERGY - 1))
        rows.add(integrator, stabilization, closure, drift)
    return list(rows.rows.values())
