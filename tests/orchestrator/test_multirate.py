"""Limits of stability of a virtual coupling across rates that do not divide, on real FMUs.

A device (m = 0.1, b = 2) at 512 Hz and a linkage (M = 0.5, b_l = 1) at the graphics rate, joined by
a sampled spring K, B = 1 in the fast block: F = K (x_l - x) + B (v_l - v). Pose and velocity of the
linkage are held on the way to it, the force on the way to the linkage; frames end at the first
tick at or after i/f. First crossing of stability in K, computed independently.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build import build
from hapticlink.orchestrator.description import Description, describe
from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.results import read_table
from hapticlink.orchestrator.run import run
from hapticlink.orchestrator.system import System, Unit, connect

from .timelines import fixed

X, V, F = Variable("x", (), "m"), Variable("v", (), "m/s"), Variable("F", (), "N")
ROWS = [
    ("device.x", "spring.x"),
    ("device.v", "spring.v"),
    ("linkage.x", "spring.x_l"),
    ("linkage.v", "spring.v_l"),
    ("spring.F", "device.F"),
    ("spring.F_l", "linkage.F"),
]


def mass(name: str, m: float, b: float, start: float) -> Component:
    """m v' = F - b v, exact for a constant force."""
    block = Block(inputs=[F], states=[X, V], outputs=[X, V])
    x, v, force, h = block.x["x"], block.x["v"], block.u["F"], block.h
    decay = ca.exp(-b / m * h)
    end = {"v": decay * v + (1 - decay) * force / b}
    end["x"] = x + force / b * h + (v - force / b) * (1 - decay) * m / b
    initial = {"x": ca.SX(0.0), "v": ca.SX(start)}
    output = {"x": x, "v": v}
    return block.component(name, "a mass", "continuous", initial=initial, step=end, output=output)


def spring() -> Component:
    block = Block(
        inputs=[X, V, Variable("x_l", (), "m"), Variable("v_l", (), "m/s")],
        parameters=[Variable("K", (), "N/m", 100.0)],
        outputs=[F, Variable("F_l", (), "N")],
    )
    u = block.u
    force = block.p["K"] * (u["x_l"] - u["x"]) + (u["v_l"] - u["v"])
    output = {"F": force, "F_l": -force}
    return block.component("spring", "a spring", "sampled", initial={}, step={}, output=output)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Description]:
    folder = tmp_path_factory.mktemp("multirate")
    parts = (mass("device", 0.1, 2.0, 1.0), spring(), mass("linkage", 0.5, 1.0, 0.0))
    return {c.name: describe(build(c, folder)) for c in parts}


def growth(fmus: dict[str, Description], folder: Path, rate: int, stiffness: float) -> float:
    """Of the spring's stretch between the last quarters of a run."""
    timeline = fixed(Fraction(512), Fraction(rate), 512 * 16, "tick")
    (gain,) = fmus["spring"].port("K", "parameter")
    units = tuple(
        Unit(
            name,
            fmu,
            "graphics" if name == "linkage" else "haptics",
            ((gain, stiffness),) if name == "spring" else (),
        )
        for name, fmu in fmus.items()
    )
    connections = tuple(connect(units, ROWS, "zoh", {}))
    outcome = run(Plan(System(units, connections, timeline, "gauss-seidel")), folder)
    assert outcome.fault is None
    force = np.abs(read_table(folder / "haptics.csv")["spring.F"])
    quarter = len(force) // 4
    return float(force[-quarter:].max() / force[-2 * quarter : -quarter].max())


@pytest.mark.parametrize(
    ("rate", "limit"), [(10, 152), (20, 561), (30, 1186), (60, 1199), (512, 2487)]
)
def test_limit_of_the_coupling_to_one_percent(
    fmus: dict[str, Description], tmp_path: Path, rate: int, limit: float
) -> None:
    below, above = (growth(fmus, tmp_path, rate, limit * part) for part in (0.99, 1.01))
    assert below < 1 < above
