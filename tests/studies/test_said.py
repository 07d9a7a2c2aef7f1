"""What the study of printed numbers takes for the growth rate of a run, and for a contradiction."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from studies.said.growth import SCALES, Growth, Odd, growth_of, step_of
from studies.said.measure import _rate, compare

P, RATE = 0.05, 400


class Motion:
    """The rows of a run of which two modes move handle and mechanism, the slower one `uneven` over
    each second, and an even creep (m/s)."""

    fault = None

    def __init__(
        self,
        rate: float,
        hertz: float,
        size: float,
        seconds: float,
        creep: float = 0.0,
        faint: tuple[float, float] = (0.0, 0.0),
        uneven: float = 0.0,
    ) -> None:
        self.t = np.arange(round(seconds * RATE)) / RATE
        turning = np.cos(2 * np.pi * hertz * self.t + 0.3)
        fast = 5.0 * np.exp(-9.0 * self.t)
        grown = np.exp(rate * self.t + uneven * np.sin(2 * np.pi * self.t))
        self.x = 0.05 + size * (grown * turning + fast) + creep * self.t
        self.faint = faint[0] * size * np.exp(faint[1] * self.t)

    def time(self, name: str) -> Any:
        return self.t

    def __getitem__(self, name: str) -> Any:
        weights = np.linspace(1.0, 2.0, 3) + list(SCALES).index(name)
        return self.x[:, None] * weights + self.faint[:, None] * [1.0, -1.0, 0.5]


@pytest.mark.parametrize(
    ("rate", "hertz", "size"), [(-0.6, 0.7, 3e-7), (-2.0, 0.0, 3e-7), (1.5, 3.0, 1e-10)]
)
def test_growth_and_decay_are_those_of_the_slowest_mode(
    rate: float, hertz: float, size: float
) -> None:
    found = growth_of(Motion(rate, hertz, size, 8.0), P, rate)
    assert found.rate == pytest.approx(rate, abs=0.005)
    told = {"growth_rate": rate, "frequency": hertz, "uncertainty": 0.0}
    assert compare(told, found)[0] == "agree"
    for wrong in ({"growth_rate": 1.1 * rate}, {"growth_rate": -rate}):
        assert compare(told | wrong, found)[0] == "contradicted"
    said = "contradicted" if rate > 0.0 else "undecided"
    assert compare(told | {"frequency": hertz + 4.0}, found)[0] == said


def test_what_creeps_on_evenly_hides_no_mode() -> None:
    found = growth_of(Motion(-2.0, 0.0, 3e-7, 20.0, creep=1e-9), P, -2.0)
    assert found.rate == pytest.approx(-2.0, abs=0.01)


@pytest.mark.parametrize("creep", [7e-11, 2e-12])
def test_what_decays_least_is_found_where_it_is_still_faint(creep: float) -> None:
    told = {"growth_rate": -1.8, "frequency": 0.0, "uncertainty": 0.0}
    found = growth_of(Motion(-2.0, 1.6, 4e-7, 14.0, creep, faint=(0.01, -1.8)), P, -1.8)
    assert compare(told, found)[0] == "agree"
    assert compare(told | {"growth_rate": -2.0}, found)[0] == "contradicted"


def test_a_slow_decay_is_no_creep() -> None:
    assert growth_of(Motion(-0.02, 0.0, 3e-7, 60.0), P, -0.02).rate == pytest.approx(
        -0.02, rel=0.01
    )


def test_a_run_that_is_too_short_decides_nothing() -> None:
    assert "0 periods" in growth_of(Motion(-2.0, 0.0, 3e-7, 0.05), P, -2.0).why


def test_what_is_not_clean_decides_nothing() -> None:
    motion = Motion(-2.0, 0.0, 3e-7, 8.0)
    motion.x += 1e-9 * np.random.Generator(np.random.PCG64(1)).standard_normal(len(motion.x))
    told = {"growth_rate": -0.5, "frequency": 0.0, "uncertainty": 0.0}
    assert compare(told, growth_of(motion, P, -0.5))[0] == "undecided"


def test_what_goes_with_the_square_of_a_nudge_is_no_mode() -> None:
    told = {"growth_rate": -1.8, "frequency": 1.6, "uncertainty": 0.0}
    to, fro = (Motion(-1.8, 1.6, s * 4e-7, 14.0, faint=(s * 1e-3, -0.2)) for s in (1.0, -1.0))
    assert compare(told, growth_of(to, P, -1.8))[0] == "contradicted"
    assert compare(told, growth_of(Odd(to, fro), P, -1.8))[0] == "agree"


def test_what_is_uneven_over_a_hyperperiod_is_fitted_over_whole_ones() -> None:
    told = {"growth_rate": -1.5, "frequency": 0.0, "uncertainty": 0.0}
    motion = Motion(-1.5, 0.0, 3e-7, 14.0, uneven=0.1)
    assert compare(told, growth_of(motion, 12 / RATE, -1.5))[0] == "contradicted"
    step = step_of(Fraction(RATE), Fraction(33), -1.5)
    assert compare(told, growth_of(motion, step, -1.5))[0] == "agree"
    assert compare(told | {"growth_rate": -1.7}, growth_of(motion, step, -1.5))[0] == "contradicted"


@pytest.mark.parametrize(("graphics", "says"), [(33, "undecided"), (50, "contradicted")])
def test_frames_of_different_lengths_contradict_nothing(graphics: int, says: str) -> None:
    case = {"growth_rate": 10.7, "frequency": 4.5, "uncertainty": 0.0, "saturated": False}
    scene: Any = SimpleNamespace(
        record={"hands": {"firm grip": {}}},
        haptic=Fraction(RATE),
        graphics=Fraction(graphics),
        step=lambda told, _: step_of(Fraction(RATE), Fraction(graphics), told),
        run=lambda *_: (Growth(22.0, 0.8, 0.0, 0.03), None),
    )
    assert _rate(scene, case | {"hand": "firm grip", "pose": "0 s"})[2] == says


def test_a_decay_ends_above_what_is_rounded() -> None:
    told = {"growth_rate": -0.436, "frequency": 0.25, "uncertainty": 0.0}
    for seed in range(8):
        motion = Motion(-0.436, 0.25, 3e-6, 50.0)
        motion.x += 1e-15 * np.random.Generator(np.random.PCG64(seed)).standard_normal(
            len(motion.t)
        )
        assert compare(told, growth_of(motion, 1.0, -0.436))[0] == "agree"


def test_frames_agree_where_hyperperiods_are_too_few() -> None:
    motion = Motion(-1.86, 0.0, 3e-7, 8.0)
    scene: Any = SimpleNamespace(
        record={"hands": {"firm grip": {}}},
        haptic=Fraction(RATE),
        graphics=Fraction(33),
        step=lambda *_: 1.0,
        run=lambda *_: (Growth(-2.03, 0.16, 0.0, 1.0), motion),
    )
    case = {"frequency": 0.0, "uncertainty": 0.0, "saturated": False, "hand": "firm grip"}
    for told, says in ((-1.86, "agree"), (-1.7, "undecided")):
        assert _rate(scene, case | {"growth_rate": told, "pose": "0 s"})[2] == says
