"""The two-mass oscillator split in two exact subsystems, so that only coupling error remains.

m x1'' = -k x1 - c v1 + F,   m x2'' = -k x2 - c v2 - F,   F = k_c (x2 - x1) + c_c (v2 - v1)
with m = 1, k = k_c = 100, c = c_c = 1, x = (0, 1), v = (1, 0) at WARM. `one` takes F, `two` x1, v1.
Until WARM both follow the exact solution of the whole, so that every hold has its history.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build import build
from hapticlink.orchestrator.base.ticks import Clock, Timeline
from hapticlink.orchestrator.fmi.description import Description, describe
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


def driven(
    x: ca.SX, v: ca.SX, force: ca.SX, k: float | ca.SX, c: float, h: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """x'' = force - k x - c v over h, the force constant; exact for c^2 < 4 k."""
    a, w = c / 2, ca.sqrt(k - c * c / 4)
    e, decay, cos, sin = x - force / k, ca.exp(-a * h), ca.cos(w * h), ca.sin(w * h)
    moved = force / k + decay * (e * cos + (v + a * e) / w * sin)
    return moved, decay * (v * cos - (k * e + a * v) / w * sin)


def together(t: ca.SX) -> dict[str, ca.SX]:
    """x1, v1, x2, v2 of the whole at t, from its modes x1 + x2 and x1 - x2."""
    zero, (x1, v1, x2, v2) = ca.SX(0.0), START.tolist()
    s, vs = driven(ca.SX(x1 + x2), ca.SX(v1 + v2), zero, K, C, t - WARM)
    d, vd = driven(ca.SX(x1 - x2), ca.SX(v1 - v2), zero, K + 2 * K_C, C + 2 * C_C, t - WARM)
    return {"x1": (s + d) / 2, "v1": (vs + vd) / 2, "x2": (s - d) / 2, "v2": (vs - vd) / 2}


def warmed(block: Block, which: str, moved: tuple[ca.SX, ca.SX]) -> dict[str, ca.SX]:
    """The step of a mass: exact until WARM, then on its own."""
    whole = together(block.t + block.h)
    warm = block.t < WARM * (1 - 1e-9)
    return {
        "x": ca.if_else(warm, whole[f"x{which}"], moved[0]),
        "v": ca.if_else(warm, whole[f"v{which}"], moved[1]),
    }


def one() -> Component:
    block = Block(
        inputs=[Variable("F", (), "N")],
        states=[Variable("x", (), "m"), Variable("v", (), "m/s")],
        outputs=[
            Variable("x", (), "m"),
            Variable("v", (), "m/s", derivative_of="x"),
            Variable("a", (), "m/s2", derivative_of="v"),
        ],
    )
    x, v, force = block.x["x"], block.x["v"], block.u["F"]
    moved = driven(x, v, force, K, C, block.h)
    start = together(ca.SX(0.0))
    acceleration = force - K * x - C * v
    return block.component(
        "one",
        "takes a force",
        "continuous",
        initial={"x": start["x1"], "v": start["v1"]},
        step=warmed(block, "1", moved),
        output={"x": x, "v": v, "a": acceleration},
    )


def two() -> Component:
    block = Block(
        inputs=[Variable("x1", (), "m"), Variable("v1", (), "m/s")],
        states=[Variable("x", (), "m"), Variable("v", (), "m/s")],
        outputs=[
            Variable("x", (), "m"),
            Variable("v", (), "m/s", derivative_of="x"),
            Variable("F", (), "N"),
        ],
    )
    x, v, x1, v1 = block.x["x"], block.x["v"], block.u["x1"], block.u["v1"]
    pull = K_C * x1 + C_C * v1
    moved = driven(x, v, pull, K + K_C, C + C_C, block.h)
    start = together(ca.SX(0.0))
    return block.component(
        "two",
        "takes a motion",
        "continuous",
        initial={"x": start["x2"], "v": start["v2"]},
        step=warmed(block, "2", moved),
        output={"x": x, "v": v, "F": K_C * (x - x1) + C_C * (v - v1)},
    )


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


def built(folder: Path) -> dict[str, Description]:
    return {c.name: describe(build(c, folder)) for c in (one(), two())}


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
