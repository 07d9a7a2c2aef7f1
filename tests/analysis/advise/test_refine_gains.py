"""Gains beside the sets: on errors whose best gains are known, and on a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.advise import advise_method as advise
from hapticlink.analysis.advise.draws import draws
from hapticlink.analysis.advise.method import Measured, Method
from hapticlink.analysis.advise.refine_gains import NOTCH, Draws, Refined, refine
from hapticlink.analysis.sweep.run_sweep import Means
from hapticlink.orchestrator import open_scene

SCENE = "closed-loop-direct"
AROUND, APART, LAST = [("a=0",), ("a=1",), ("a=2",)], [("b=0",), ("b=1",)], [("c=0",), ("c=1",)]
SOFT = (25.0, 5.0)
Error = Callable[[float, float, str], float]
"""Of stiffness, damping and draw; infinite where a limit is broken."""


class Runs:
    """Judges methods by an error, and counts the runs."""

    def __init__(self, error: Error) -> None:
        self.error = error
        self.ran: list[tuple[str, str]] = []

    def judge(self, methods: Sequence[Method], drawn: Draws) -> list[Measured]:
        return [self._measured(method, [draw for (draw,) in drawn]) for method in methods]

    def _measured(self, method: Method, drawn: Sequence[str]) -> Measured:
        self.ran += [(method.name, draw) for draw in drawn]
        K, B = gains(method)
        errors = np.array([self.error(K, B, draw) for draw in drawn])
        return Measured(method, errors, np.zeros(len(drawn)), np.isfinite(errors))


def refined(error: Error) -> tuple[Refined, Runs]:
    runs = Runs(error)
    (start,) = runs.judge([Method("zoh", "soft")], AROUND)
    runs.ran.clear()
    return refine(open_scene.load(SCENE), start, runs.judge, AROUND, APART, LAST), runs


def gains(method: Method) -> tuple[float, float]:
    controller = open_scene.load(SCENE, method.options).controller
    coupling = controller and controller.teleoperation
    assert coupling
    return coupling.stiffness[0], coupling.damping[0]


@pytest.mark.parametrize("best", [(170.0, 3.0), (9.0, 40.0), (25.0, 5.0)])
def test_the_best_gains_are_found_to_half_a_notch(best: tuple[float, float]) -> None:
    """Whatever the draw, the error grows with the distance from the best gains."""

    def error(K: float, B: float, draw: str) -> float:
        return float(np.exp(abs(np.log(K / best[0])) + abs(np.log(B / best[1]))))

    found, runs = refined(error)
    for value, known in zip(gains(found.found.method), best, strict=True):
        assert abs(np.log(value / known)) < 0.51 * np.log(NOTCH)
    assert len(set(runs.ran)) <= len(AROUND) * (found.tried + 1) + 2 * len(APART) + 2 * len(LAST)
    told = runs.judge([found.found.method, found.start.method], LAST)
    ratio = told[0].error_mm[0] / told[1].error_mm[0]
    if best == SOFT:
        assert found.found is found.start
        assert f"gains: {found.tried} others were tried; none" in found.line
    else:
        assert f"the error is {ratio:.2f} times that of soft" in found.line
        assert ratio < 1.0


def test_gains_that_break_a_limit_in_any_draw_are_not_taken() -> None:
    """Stiffer is better, but one draw bears 60 N/m, and one of those kept apart 45."""
    most = {"a=1": 60.0, "b=0": 45.0}

    def error(K: float, B: float, draw: str) -> float:
        return 1e3 / K if most.get(draw, np.inf) >= K else np.inf

    found, _ = refined(error)
    K, B = gains(found.found.method)
    assert 45.0 / NOTCH < K <= 45.0
    assert SOFT[1] == B
    assert found.no_part
    assert found.no_part[1].within == len(LAST)


def test_what_breaks_a_limit_in_the_scene_itself_runs_in_no_draw() -> None:
    def error(K: float, B: float, draw: str) -> float:
        return 1.0 if (K, B) == SOFT else np.inf

    found, runs = refined(error)
    assert found.found is found.start
    assert len(runs.ran) == found.tried + len(APART)
    assert {draw for _, draw in runs.ran} == {AROUND[0][0], *(draw for (draw,) in APART)}


def test_a_better_median_of_noise_is_no_better() -> None:
    """Half of the draws gain a factor of 2, the others lose as much."""

    def error(K: float, B: float, draw: str) -> float:
        return (K / SOFT[0]) ** (1.0 if draw in ("a=0", "b=0") else -1.0)

    found, _ = refined(error)
    assert found.found is found.start


def test_where_the_set_breaks_limits_gains_that_break_fewer_are_taken() -> None:
    """However large their error is."""

    def error(K: float, B: float, draw: str) -> float:
        return 1e3 / K if K < 15.0 or draw == "a=0" else np.inf

    found, _ = refined(error)
    assert gains(found.found.method)[0] < 15.0
    assert found.found.admitted


def test_gains_that_only_suit_the_draws_of_the_search_are_not_taken() -> None:
    def error(K: float, B: float, draw: str) -> float:
        return SOFT[0] / K if draw.startswith("a") else K / SOFT[0]

    found, _ = refined(error)
    assert found.found is found.start


def test_a_scene_gets_gains_beyond_the_sets_that_its_runs_confirm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mechanism at the haptic rate is followed better with more damping than this scene has."""
    monkeypatch.setattr(advise, "all_methods", lambda _: [Method("zoh", "own")])
    given = (
        "duration=0.3",
        "controller.teleoperation.stiffness=[10.0, 10.0, 0.004]",
        "controller.teleoperation.damping=[4.0, 4.0, 0.002]",
    )
    found = advise.advise("closed-loop-ideal", given, Means(tmp_path), count=1)
    assert found.gains
    assert gains(found.taken.method)[1] > 2 * 4.0
    (*_, last) = draws(open_scene.load("closed-loop-ideal", given), 3, 0)
    own, taken = (
        hl.run("closed-loop-ideal", (*given, *last, *options), figures=False)
        for options in (("hold=zoh",), found.taken.method.options)
    )
    ratio = taken.measures().tracking[""].max_mm / own.measures().tracking[""].max_mm
    assert ratio < 0.7
    assert (
        f"On 1 draws that took no part in the choice the error is {ratio:.2f} times that of own"
        in found.gains.line
    )
