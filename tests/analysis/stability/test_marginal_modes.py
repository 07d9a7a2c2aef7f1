"""What a mode that is marginal, by a large uncertainty, counts for in a margin, and how uncertain
eigenvalues that coincide are."""

from __future__ import annotations

import numpy as np
import pytest

from hapticlink.analysis.stability.hand_cases import SLIGHT, Bounds, InHands
from hapticlink.analysis.stability.modes import Linearisation, Mode, judged_modes, modes, verdict
from hapticlink.orchestrator.base.errors import InputFault


class OfGrowth(InHands):
    """A scene whose leading mode has a growth rate (1/s) and an uncertainty; a period is 1 s."""

    def __init__(self, growth: float, uncertainty: float) -> None:
        none = np.zeros(0)
        self._mode = Mode(complex(np.exp(growth)), uncertainty, growth, 10.0, none, none)
        self._seconds = 1.0

    def _leading(self, hand):  # type: ignore[no-untyped-def]
        return self._mode, self, 0

    def traced(self, mode: Mode) -> Mode:
        return mode


@pytest.mark.parametrize(
    ("changed", "own", "is_"),
    [
        ((0.06, 1e-3), (-0.06, 1e-3), "unstable"),
        ((0.06, 0.04), (-0.06, 1e-3), "unstable"),  # within two small uncertainties
        ((0.3, 0.2), (-0.06, 1e-3), "unsure"),  # within two large ones
        ((0.5, 0.2), (-0.06, 1e-3), "unstable"),
        ((0.06, 0.5), (-0.06, 1e-3), "unsure"),  # as likely as not, and it was stable
        ((0.06, 0.5), (-0.04, 0.5), "unsure"),  # it was marginal, and decayed
        ((0.06, 0.5), (0.05, 0.5), "stable"),  # it was marginal, and grew as fast
        ((0.06, 0.5), (0.02, 0.5), "unsure"),  # more than twice as fast as before
        ((0.8, 9.0), (0.02, 0.5), "unstable"),  # z is beyond DOUBLED
        ((SLIGHT / 2, 0.5), (-0.06, 1e-3), "stable"),
        ((-0.06, 0.5), (-0.06, 1e-3), "stable"),
    ],
)
def test_what_grows_within_its_uncertainty_is_not_known_to_be_unstable(
    changed: tuple[float, float], own: tuple[float, float], is_: str
) -> None:
    def word() -> str:
        try:
            worst = OfGrowth(*changed).worst({"a": None}, Bounds(), OfGrowth(*own).slow)
        except InputFault as fault:
            return "unsure" if "is uncertain" in str(fault) else "failed"
        return "unstable" if worst > 0.0 else "stable"

    assert word() == is_


@pytest.mark.parametrize(("error", "said"), [(1e-9, "stable"), (0.05, "marginal")])
def test_eigenvalues_that_coincide_are_as_uncertain_as_errors_move_them(
    error: float, said: str
) -> None:
    """Those of [[.8, 1], [0, .8]] move to .8 +- sqrt(error (1 + error)) and a little further; by
    the first order, to infinity."""
    A, E = np.array([[0.8, 1.0], [0.0, 0.8]]), np.full((2, 2), error)
    (first, *_) = modes(Linearisation(np.zeros(2), np.zeros(2), np.eye(2), A, E), 1.0)
    assert abs(first.z) == pytest.approx(0.8, abs=1e-6)
    assert first.uncertainty == pytest.approx(np.sqrt(error), rel=0.25)
    assert verdict(abs(first.z), first.uncertainty) == said


def test_two_eigenvalues_1_without_two_directions_are_neutral() -> None:
    """Rounding by 1e-16 takes them 1e-8 apart."""
    A = np.array([[1.0, 1.0, 0.0], [1e-16, 1.0, 0.0], [0.0, 0.0, 0.5]])
    found = modes(Linearisation(np.zeros(3), np.zeros(3), np.eye(3), A, 0.0 * A), 1.0)
    assert abs(found[0].z - 1.0) > 1e-9
    assert [mode.neutral for mode in found] == [True, True, False]
    assert judged_modes(found) == [found[2]]


@pytest.mark.parametrize("exponent", [100, 150, 250])
def test_growth_beyond_what_eigenvalues_of_lapack_reach(exponent: int) -> None:
    """As of a vibration at half the haptic rate over a hyperperiod of half a second."""
    A = np.array([[1.0, 2.0], [3.0, -(10.0**exponent)]])
    none = np.zeros(2)
    (first, *_) = modes(Linearisation(none, none, np.eye(2), A, 0.0 * A), 0.5)
    assert first.growth == pytest.approx(exponent * np.log(10) / 0.5, rel=1e-12)
    assert first.participation == pytest.approx([0.0, 1.0])
