"""The two-mass oscillator split in two exact subsystems, so that only coupling error remains.

m x1'' = -k x1 - c v1 + F,   m x2'' = -k x2 - c v2 - F,   F = k_c (x2 - x1) + c_c (v2 - v1)
with m = 1, k = k_c = 100, c = c_c = 1, x = (0, 1), v = (1, 0) at WARM. `one` takes F, `two` x1, v1.
Until WARM both follow the exact solution of the whole, so that every hold has its history.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hapticlink.orchestrator.base.ticks import Clock, Timeline
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.tables import read_table
from hapticlink.orchestrator.run.event_loop import Outcome, run
from hapticlink.orchestrator.scene.records import PowerPort, SetSpring
from hapticlink.orchestrator.system.assign_holds import Rules
from hapticlink.orchestrator.system.system import Fmu, System
from tests.orchestrator.systems import connected

K, C, K_C, C_C = 100.0, 1.0, 100.0, 1.0
START = np.array([0.0, 1.0, 1.0, 0.0])
"""x1, v1, x2, v2 at WARM."""
WARM = 0.06
A = np.array(
    [
        [0.0, 1.0, 0.0, 0.0],
        [-K - K_C, -C - C_C, K_C, C_C],
        [0.0, 0.0, 0.0, 1.0],
        [K_C, C_C, -K - K_C, -C - C_C],
    ]
)


def exact(times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([expm(A * (t - WARM)) @ START for t in times])


ROWS = [("two.F", "one.F"), ("one.x", "two.x1"), ("one.v", "two.v1")]

POWER = (PowerPort(effort="one.F", displacement="one.x"),)
SPRINGS = (
    SetSpring(
        set_position="two.x1",
        position="two.x",
        stiffness=(K_C,),
        damping=(C_C,),
        set_velocity="two.v1",
    ),
)


def system(
    fmus: Mapping[str, Description],
    step: Fraction,
    steps: int,
    hold: str | Mapping[str, str],
    coupling: str = "jacobi",
    substeps: int = 1,
    get_after_set: bool = True,
) -> System:
    """`hold` for all three connections, or by source."""
    timeline = Timeline(step, steps, (Clock("haptics", range(0, steps + 3)),))
    units = tuple(Fmu(name, fmu, "haptics") for name, fmu in fmus.items())
    one_for_all = {source: hold for source, _ in ROWS} if isinstance(hold, str) else hold
    rules = Rules(holds=one_for_all, power=POWER, springs=SPRINGS)
    connections, refused = connected(units, ROWS, timeline, rules)
    assert not refused
    return System(
        units,
        connections,
        timeline,
        coupling,
        substeps=dict.fromkeys(fmus, substeps),
        get_after_set=("two",) if get_after_set else (),
        power=POWER,
        springs=SPRINGS,
    )


def simulate(system: System, folder: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(times, rows of x1, v1, x2, v2)."""
    outcome: Outcome = run(Plan(system), RunFolder(folder))
    assert outcome.fault is None
    found = read_table(folder / "haptics.csv")
    names = ("one.x", "one.v", "two.x", "two.v")
    return found["time"], np.stack([found[name] for name in names], axis=1)
