"""Growth under switched matrices, against closed forms and Kronecker squares."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

import hapticlink as hl
from hapticlink.analysis.stability.switching import (
    Edge,
    lyapunov,
    mean_square,
)
from hapticlink.analysis.stability.varying_rate import (
    VaryingStability,
    growth,
    varying_stability,
)
from tests.analysis.stability.own_hand import own_hand
from tests.analysis.stability.test_stability import HELD


def switched(matrices: list[np.ndarray], probability: float) -> list[Edge]:
    return [Edge(0, 0, A, probability) for A in matrices]


def test_second_moments_grow_by_the_mean_kronecker_square() -> None:
    generator = np.random.default_rng(1)
    matrices = [generator.standard_normal((4, 4)) for _ in range(3)]
    square = sum(np.kron(A, A) for A in matrices) / 3
    expected = np.abs(np.linalg.eigvals(square)).max()
    assert mean_square(switched(matrices, 1 / 3)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("rest", [0, 30])
def test_second_moments_of_a_pair_that_swaps_coordinates_have_two_eigenvalues_of_one_size(
    rest: int,
) -> None:
    """X -> sum p A X A' of A = [[0, a], [b, 0]] swaps the diagonal of X as well: its eigenvalues
    are +- sqrt(E a^2 E b^2), and the power method alternates. `rest` further numbers decay."""
    pairs = ((2.0, 0.25), (1.0, 0.75))
    matrices = [np.diag(np.full(2 + rest, 0.1)) for _ in pairs]
    for A, (a, b) in zip(matrices, pairs, strict=True):
        A[:2, :2] = [[0.0, a], [b, 0.0]]
    a2, b2 = (sum(x * x for x in each) / 2 for each in zip(*pairs, strict=True))
    assert mean_square(switched(matrices, 0.5)) == pytest.approx(math.sqrt(a2 * b2), rel=1e-9)


def test_the_exponent_of_scalars_is_their_mean_logarithm() -> None:
    mean, width = lyapunov(switched([np.array([[0.5]]), np.array([[1.5]])], 0.5), seed=3)
    assert abs(mean - math.log(0.75) / 2) < 2 * width < 0.05


def test_the_half_width_is_students_of_the_means_of_forty_batches() -> None:
    """A third of the steps grow, by e: a batch of 500 has 166 or 167 of these, as it begins."""
    cycle = [Edge(i, (i + 1) % 3, np.array([[math.e if i == 0 else 1.0]])) for i in range(3)]
    mean, width = lyapunov(cycle)
    means = np.reshape(np.arange(41 * 500) % 3 == 0, (41, 500))[1:].mean(axis=1)
    assert mean == pytest.approx(means.mean(), rel=1e-12)
    assert width == pytest.approx(stats.sem(means) * stats.t(39).ppf(0.975), rel=1e-9)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_rate_that_varies_is_judged_by_the_frames_that_it_draws(hold: str) -> None:
    """A frame of 4 ticks, after one of 4, is what 128 Hz repeats."""
    varying = HELD | {"hold": hold, "graphics.rate": {"min": 102, "max": 128, "seed": 0}}
    varying["duration"] = 1 / 512  # in which frames of 5 ticks alone are drawn
    found = hl.equilibrium_stability("closed-loop-direct", varying)
    at_128 = HELD | {"hold": hold, "graphics.rate": 128}
    fixed = own_hand("closed-loop-direct", at_128)
    assert isinstance(found, hl.VaryingStability)
    assert found.frames == (4, 5)
    assert found.second_moment >= fixed.radius**2 / 2 - 1e-6  # of its frames alone
    assert math.log(found.second_moment) / 2 >= found.exponent * 4 / 512 - 0.01


def test_frames_of_a_hold_that_keeps_lengths_are_those_of_its_equations() -> None:
    """A wall at 64 to 128 Hz on m = 0.3 kg, b = 5 N.s/m, whose force is the mean of two samples,
    in frames of 4 to 8 ticks: x, v, and the last sample f.

        F = (f - K x)/2,   f <- -K x,   (x, v) <- exact step of N ticks under F
    """
    K, m, b = 700.0, 0.3, 5.0
    options = {
        "fmu.wall.settings.unilateral": False,
        "hand.wrench": [0.0, 0.0, 0.0],
        "fmu.wall.rate": {"min": 64, "max": 128, "seed": 3},
        "holds": {"wall.F": "mean"},
        "fmu.wall.start.stiffness": K,
    }
    frames = []
    for n in range(4, 9):
        A = expm(np.array([[0, 1, 0], [0, -b / m, 1 / m], [0, 0, 0]]) * n / 512)
        A[2, 2] = 0.0
        F = np.array([-K / 2, 0.0, 0.5])
        A[:2] = np.column_stack([A[:2, :2], np.zeros(2)]) + np.outer(A[:2, 2], F)
        A[2] = -K, 0.0, 0.0
        frames.append(A)
    second = np.abs(np.linalg.eigvals(sum(np.kron(A, A) for A in frames) / len(frames))).max()
    found = varying_stability("virtual-wall", options)
    assert found.second_moment == pytest.approx(second, rel=1e-5)


def test_the_hold_that_a_refusal_names_is_not_refused() -> None:
    """foh and lead reach back by more than two frames where the graphics copy publishes late."""
    target = [[0.0, 0.0445, 0.0148, -0.788]]
    hand = {"type": "spring", "stiffness": [100.0, 100.0, 0.3], "target": target}
    options = {"graphics.rate": {"min": 34, "max": 46, "seed": 37}, "hand": hand, "hold": "foh"}
    with pytest.raises(hl.InputFault, match="more than two frames") as refused:
        hl.equilibrium_stability("closed-loop-ideal", options)
    named = re.findall(r"hold=([\w-]+)", str(refused.value))
    assert named
    for hold in named:
        assert hl.equilibrium_stability("closed-loop-ideal", {**options, "hold": hold}).verdict


@pytest.mark.parametrize(
    ("radius", "exponent", "said"),
    [
        (1.0000016, 3.2e-5, ("marginal", "undecided")),
        (0.9999984, -3.2e-5, ("marginal", "undecided")),
        (0.99, -0.5, ("stable", "stable")),
        (1.01, -0.5, ("unstable", "stable")),
    ],
)
def test_what_takes_more_than_a_minute_to_double_is_marginal(
    radius: float, exponent: float, said: tuple[str, str]
) -> None:
    found = VaryingStability("", (9, 10, 11), 0.0025, radius, exponent, 3e-3, 1, ())
    assert (found.mean_square, found.almost_surely) == said
    assert found.exponent <= growth(radius, found.frames, found.tick) + 1e-6


def test_second_moments_of_one_matrix_grow_twice_as_its_eigenvalue() -> None:
    """Of x' = a x each frame the bound is the Lyapunov exponent, ln a over the frame."""
    second = mean_square(switched([np.array([[1.2]])] * 2, 0.5))
    assert growth(second, (10, 10), 0.0025) == pytest.approx(math.log(1.2) / 0.025, rel=1e-9)
