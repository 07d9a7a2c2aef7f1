"""Motion along tables: the order of every method where rows meet steps, against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from hapticlink.components import specs
from hapticlink.components.blocks.hand import hand
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Mechanism,
    OperationalPoint,
    PDDrive,
)
from tests.blocks import Running

TABLE = ((0.0, 0.1), (0.25, 0.4), (0.5, 0.3), (1.0, 0.3), (1.25, -0.2))
K, B, M = 400.0, 8.0, 2.0


def moved(
    table: tuple[tuple[float, ...], ...], k: float, b: float, matrix: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """z at the last row, z' = matrix z + (0, k y + b y') with y the table, from row to row."""
    z = start
    for (t0, y0), (t1, y1) in pairwise(table):
        slope = (y1 - y0) / (t1 - t0)
        whole = np.zeros((4, 4))  # z, and the push with its rate
        whole[:2, :2], whole[1, 2], whole[2, 3] = matrix, 1.0, 1.0
        push = np.array([k * y0 + b * slope, k * slope])
        z = (expm(whole * (t1 - t0)) @ np.concatenate([z, push]))[:2]
    return z


def servo(method: str, table: tuple[tuple[float, float], ...] = TABLE) -> Running:
    """m x'' = k (y - x) + b (y' - x')."""
    linkage = Linkage(
        body=(Body(name="block", mass=M, inertia=1.0),),
        joint=(
            Joint(
                name="rail",
                type="prismatic",
                child="block",
                drive=PDDrive(table=table, stiffness=K, damping=B),
            ),
        ),
        operational_point=OperationalPoint(body="block"),
        start={"rail": 0.1},
    )
    return Running(virtual_mechanism(linkage, Mechanism(integrator=method), step_s=1e-3))


MATRIX = np.array([[0.0, 1.0], [-K / M, -B / M]])


def errors(running: Running, exact: np.ndarray, steps: list[int], until: float) -> list[float]:
    start, found = running.x.copy(), []
    for n in steps:
        running.x, running.t = start.copy(), 0.0
        for _ in range(n):
            running.step(until / n)
        found.append(float(np.abs(running.x - exact).max()))
    return found


def order(found: list[float], steps: list[int]) -> float:
    return float(-np.polyfit(np.log(steps), np.log(found), 1)[0])


@pytest.mark.parametrize("method", METHODS)
def test_a_method_keeps_its_order_where_rows_meet_its_steps(method: str) -> None:
    exact = moved(TABLE, K / M, B / M, MATRIX, np.array([0.1, 0.0]))
    claimed = METHODS[method].order
    steps = [20, 40, 80] if claimed > 4 else [320, 640, 1280]
    found = order(errors(servo(method), exact, steps, 1.25), steps)
    assert found == pytest.approx(claimed, abs=0.06 * claimed)


def test_a_row_within_a_step_leaves_order_two() -> None:
    """Rows a fifth or two from an end of a step, with any power of 4."""
    rows = ((0.0, 0.1), (0.2, 0.5), (0.6, -0.2), (1.0, 0.0))
    exact = moved(rows, K / M, B / M, MATRIX, np.array([0.1, 0.0]))
    steps = [64, 256, 1024]
    assert order(errors(servo("rk4", rows), exact, steps, 1.0), steps) == pytest.approx(2, abs=0.15)


def test_an_arm_follows_its_path_to_order_four() -> None:
    """The handle clamped at 0; in x the arm has mass 1 kg."""
    rows = tuple((t, x, 0.0, 0.0) for t, x in TABLE)
    spec = specs.ArmHand(target=rows)
    k, b = spec.stiffness[0], spec.damping[0]
    matrix = np.array([[0.0, 1.0], [-k - spec.grip_stiffness[0], -b - spec.grip_damping[0]]])
    x, v = moved(TABLE, k, b, matrix, np.zeros(2))
    exact, steps = np.array([x, 0, 0, v, 0, 0]), [160, 320, 640]
    assert order(errors(Running(hand(spec)), exact, steps, 1.25), steps) == pytest.approx(
        4, abs=0.2
    )
