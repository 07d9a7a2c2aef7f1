"""Motion along tables, splines and sines: the order of every method, against closed forms.

A path y is on each of its segments the first entry of w with w' = S w, so that z' = A z +
(0, k y + b y') is a linear system with it, whose solution is an exponential of a matrix.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from hapticlink.components.blocks.hand import hand
from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.drives import PDDrive
from hapticlink.components.specs.hand import ArmHand
from hapticlink.components.specs.linkage import Body
from hapticlink.components.specs.paths import CoordinateSine, Interpolation, PoseSine
from tests.blocks import Running, order, running
from tests.mechanisms import one_body

Rows = tuple[tuple[float, float], ...]
Segment = tuple[float, list[float], np.ndarray]
"""Its length (s), w where it begins, and S."""

TABLE = ((0.0, 0.1), (0.25, 0.4), (0.5, 0.3), (1.0, 0.3), (1.25, -0.2))
LATE = ((0.0, 0.1), (0.2, 0.5), (0.6, -0.2), (1.0, 0.0))
"""Its rows come a fifth or two from an end of a step, with any power of 4."""
SINE = CoordinateSine(mean=0.2, amplitude=0.3, frequency=1.3, phase=0.4)
END = TABLE[-1][0]
PATHS = ("linear", "spline", "sine")
K, B, M = 400.0, 8.0, 2.0


def segments(path: str, rows: Rows) -> Iterator[Segment]:
    (t, y), rates = np.array(rows).T, clamped(rows)
    if path == "sine":
        w, phase = 2 * np.pi * SINE.frequency, SINE.phase
        a = SINE.amplitude * np.array([np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)])
        yield END, [SINE.mean + a[0], a[1], a[2]], np.array([[0, 1, 0], [0, 0, 1], [0, -(w**2), 0]])
        return
    for i, j in pairwise(range(len(rows))):
        h, d = t[j] - t[i], (y[j] - y[i]) / (t[j] - t[i])
        if path == "linear":
            yield h, [y[i], d], np.eye(2, k=1)
        else:
            bend = 2 * (3 * d - 2 * rates[i] - rates[j]) / h
            jerk = 6 * (rates[i] + rates[j] - 2 * d) / h**2
            yield h, [y[i], rates[i], bend, jerk], np.eye(4, k=1)


def clamped(rows: Rows) -> np.ndarray:
    """Rates at the rows of the cubic spline with rate 0 at both ends, from the continuity of y''
    (de Boor, A Practical Guide to Splines, IV), as a dense system."""
    (t, y), n = np.array(rows).T, len(rows)
    matrix, right, h = np.eye(n), np.zeros(n), np.diff(t)
    for i in range(1, n - 1):
        a, b = h[i - 1], h[i]
        matrix[i, i - 1 : i + 2] = b, 2 * (a + b), a
        right[i] = 3 * (b * (y[i] - y[i - 1]) / a + a * (y[i + 1] - y[i]) / b)
    return np.linalg.solve(matrix, right)


def moved(
    path: str, k: float, b: float, pull: tuple[float, float], start: float = 0.0, rows: Rows = TABLE
) -> np.ndarray:
    """z at the end, z = (x, x') from (start, 0) with A = ((0, 1), pull)."""
    z = np.array([start, 0.0])
    for h, w, S in segments(path, rows):
        whole = np.zeros((2 + len(w), 2 + len(w)))
        whole[0, 1], whole[1, :2], whole[1, 2:4], whole[2:, 2:] = 1.0, pull, (k, b), S
        z = (expm(whole * h) @ np.concatenate([z, w]))[:2]
    return z


def servo(method: str, path: str, rows: Rows = TABLE) -> tuple[Running, np.ndarray]:
    """m x'' = k (y - x) + b (y' - x'), and its exact state at the end of the path."""
    given: dict = {"table": SINE if path == "sine" else rows}
    if path == "spline":
        given["interpolation"] = path
    drive = PDDrive(**given, stiffness=K, damping=B)
    block = Body(name="block", mass=M, inertia=1.0)
    linkage = one_body(block, start=0.1, type="prismatic", drive=drive)
    exact = moved(path, K / M, B / M, (-K / M, -B / M), 0.1, rows)
    return running(linkage, integrator=method), exact


def observed(block: Running, exact: np.ndarray, steps: list[int], end: float = END) -> float:
    """The order of the state at the end, for these numbers of steps."""
    start, errors = block.x.copy(), []
    for n in steps:
        block.x, block.t = start.copy(), 0.0
        for _ in range(n):
            block.step(end / n)
        errors.append(np.abs(block.x[: len(exact)] - exact).max())
    return order(errors, steps)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("method", METHODS)
def test_a_method_keeps_its_order_where_rows_meet_its_steps(method: str, path: str) -> None:
    claimed = METHODS[method].order
    steps = [20, 40, 80] if claimed > 4 else [320, 640, 1280]
    assert observed(*servo(method, path), steps) == pytest.approx(claimed, abs=0.06 * claimed)


@pytest.mark.parametrize(
    ("path", "method", "left", "near"),
    [("linear", "rk4", 2, 0.15), ("spline", "dormand-prince-8", 3, 0.2)],
)
def test_a_row_within_a_step_leaves_a_lower_order(
    path: Interpolation, method: str, left: int, near: float
) -> None:
    block, exact = servo(method, path, LATE)
    assert observed(block, exact, [64, 256, 1024], 1.0) == pytest.approx(left, abs=near)


@pytest.mark.parametrize("path", PATHS)
def test_an_arm_follows_its_path_to_order_four(path: str) -> None:
    """The handle clamped at 0; in x the arm has mass 1 kg."""
    rows = tuple((t, x, 0.0, 0.0) for t, x in TABLE)
    fields = ("mean", "amplitude", "frequency", "phase")
    sine = PoseSine(**{name: (getattr(SINE, name), 0.0, 0.0) for name in fields})
    targets: dict[str, dict] = {"linear": {"target": rows}, "sine": {"target": sine}}
    targets["spline"] = {"target": rows, "interpolation": "spline"}
    spec = ArmHand(**targets[path])
    k, b, grip = spec.stiffness[0], spec.damping[0], (spec.grip_stiffness[0], spec.grip_damping[0])
    x, v = moved(path, k, b, (-k - grip[0], -b - grip[1]))
    steps = [160, 320, 640] if path == "linear" else [320, 640, 1280]
    exact = np.array([x, 0, 0, v, 0, 0])
    assert observed(Running(hand(spec)), exact, steps) == pytest.approx(4, abs=0.2)
