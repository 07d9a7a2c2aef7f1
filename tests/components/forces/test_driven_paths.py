"""Motion along tables, splines and sines: the order of every method, against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from hapticlink.components.blocks.hand import hand
from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.drives import PDDrive
from hapticlink.components.specs.hand import ArmHand
from hapticlink.components.specs.linkage import Body, Joint, Linkage, Mechanism, OperationalPoint
from hapticlink.components.specs.paths import CoordinateSine, Interpolation, PoseSine
from tests.blocks import Running, virtual_mechanism

TABLE = ((0.0, 0.1), (0.25, 0.4), (0.5, 0.3), (1.0, 0.3), (1.25, -0.2))
Rows = tuple[tuple[float, float], ...]
K, B, M = 400.0, 8.0, 2.0


def moved(table: Rows, k: float, b: float, matrix: np.ndarray, start: np.ndarray) -> np.ndarray:
    """z at the last row, z' = matrix z + (0, k y + b y') with y the table, from row to row."""
    z = start
    for (t0, y0), (t1, y1) in pairwise(table):
        slope = (y1 - y0) / (t1 - t0)
        whole = np.zeros((4, 4))  # z, and the push with its rate
        whole[:2, :2], whole[1, 2], whole[2, 3] = matrix, 1.0, 1.0
        push = np.array([k * y0 + b * slope, k * slope])
        z = (expm(whole * (t1 - t0)) @ np.concatenate([z, push]))[:2]
    return z


def servo(
    method: str, table: Rows | CoordinateSine = TABLE, interpolation: Interpolation = "linear"
) -> Running:
    """m x'' = k (y - x) + b (y' - x')."""
    linkage = Linkage(
        body=(Body(name="block", mass=M, inertia=1.0),),
        joint=(
            Joint(
                name="rail",
                type="prismatic",
                child="block",
                drive=PDDrive(table=table, interpolation=interpolation, stiffness=K, damping=B),
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
        found.append(float(np.abs(running.x[: len(exact)] - exact).max()))
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
    spec = ArmHand(target=rows)
    k, b = spec.stiffness[0], spec.damping[0]
    matrix = np.array([[0.0, 1.0], [-k - spec.grip_stiffness[0], -b - spec.grip_damping[0]]])
    x, v = moved(TABLE, k, b, matrix, np.zeros(2))
    exact, steps = np.array([x, 0, 0, v, 0, 0]), [160, 320, 640]
    assert order(errors(Running(hand(spec)), exact, steps, 1.25), steps) == pytest.approx(
        4, abs=0.2
    )


# --- splines and sines ------------------------------------------------------------------------

SINE = CoordinateSine(mean=0.2, amplitude=0.3, frequency=1.3, phase=0.4)


def clamped(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Rates at the rows of the cubic spline with rate 0 at both ends, from the continuity of y''
    (de Boor, A Practical Guide to Splines, IV), as a dense system; with the rows' values."""
    (t, y), n = np.array(rows).T, len(rows)
    matrix, right, h = np.eye(n), np.zeros(n), np.diff(t)
    for i in range(1, n - 1):
        a, b = h[i - 1], h[i]
        matrix[i, i - 1 : i + 2] = b, 2 * (a + b), a
        right[i] = 3 * (b * (y[i] - y[i - 1]) / a + a * (y[i + 1] - y[i]) / b)
    return y, np.linalg.solve(matrix, right)


def splined(
    k: float, b: float, matrix: np.ndarray, start: np.ndarray, rows: Rows = TABLE
) -> np.ndarray:
    """z at the last row, z' = matrix z + (0, k y + b y') with y the clamped spline: on a segment
    (y, y', y'', y''') belongs to a linear system, too."""
    z, (y, m) = start, clamped(rows)
    whole = np.zeros((6, 6))
    whole[:2, :2], whole[1, 2:4], whole[2:5, 3:] = matrix, (k, b), np.eye(3)
    for i, ((t0, _), (t1, _)) in enumerate(pairwise(rows)):
        h, d = t1 - t0, (y[i + 1] - y[i]) / (t1 - t0)
        bend, jerk = 2 * (3 * d - 2 * m[i] - m[i + 1]) / h, 6 * (m[i] + m[i + 1] - 2 * d) / h**2
        z = (expm(whole * h) @ np.concatenate([z, [y[i], m[i], bend, jerk]]))[:2]
    return z


def swung(k: float, b: float, matrix: np.ndarray, start: np.ndarray, until: float) -> np.ndarray:
    """The same with y = SINE, whose sine and cosine belong to a linear system."""
    w = 2 * np.pi * SINE.frequency
    whole = np.zeros((5, 5))
    whole[:2, :2], whole[2, 3], whole[3, 2] = matrix, w, -w
    whole[1, 2:] = k * SINE.amplitude, b * SINE.amplitude * w, k * SINE.mean
    phase = np.array([np.sin(SINE.phase), np.cos(SINE.phase), 1.0])
    return (expm(whole * until) @ np.concatenate([start, phase]))[:2]


@pytest.mark.parametrize("method", METHODS)
def test_a_method_keeps_its_order_on_a_spline_and_on_a_sine(method: str) -> None:
    start, claimed = np.array([0.1, 0.0]), METHODS[method].order
    steps = [20, 40, 80] if claimed > 4 else [320, 640, 1280]
    exact = {"spline": splined(K / M, B / M, MATRIX, start)}
    exact["sine"] = swung(K / M, B / M, MATRIX, start, 1.25)
    running = {"spline": servo(method, TABLE, "spline"), "sine": servo(method, SINE)}
    for path, expected in exact.items():
        found = order(errors(running[path], expected, steps, 1.25), steps)
        assert found == pytest.approx(claimed, abs=0.06 * claimed), path


@pytest.mark.parametrize("path", ["spline", "sine"])
def test_an_arm_follows_a_smooth_path_to_order_four(path: str) -> None:
    """The handle clamped at 0; in x the arm has mass 1 kg."""
    rows = tuple((t, x, 0.0, 0.0) for t, x in TABLE)
    sine = PoseSine(
        mean=(SINE.mean, 0.0, 0.0),
        amplitude=(SINE.amplitude, 0.0, 0.0),
        frequency=(SINE.frequency, 0.0, 0.0),
        phase=(SINE.phase, 0.0, 0.0),
    )
    given = {"spline": ArmHand(target=rows, interpolation="spline")}
    spec = (given | {"sine": ArmHand(target=sine)})[path]
    k, b = spec.stiffness[0], spec.damping[0]
    matrix = np.array([[0.0, 1.0], [-k - spec.grip_stiffness[0], -b - spec.grip_damping[0]]])
    start = np.zeros(2)
    if path == "spline":
        x, v = splined(k, b, matrix, start)
    else:
        x, v = swung(k, b, matrix, start, 1.25)
    exact, steps = np.array([x, 0, 0, v, 0, 0]), [320, 640, 1280]
    assert order(errors(Running(hand(spec)), exact, steps, 1.25), steps) == pytest.approx(
        4, abs=0.2
    )


def test_a_row_of_a_spline_within_a_step_leaves_order_three() -> None:
    """Rows a fifth or two from an end of a step, with any power of 4."""
    rows = ((0.0, 0.1), (0.2, 0.5), (0.6, -0.2), (1.0, 0.0))
    exact = splined(K / M, B / M, MATRIX, np.array([0.1, 0.0]), rows)
    found = errors(servo("dormand-prince-8", rows, "spline"), exact, steps := [64, 256, 1024], 1.0)
    assert order(found, steps) == pytest.approx(3, abs=0.2)
