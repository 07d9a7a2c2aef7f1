"""The choice of a method, from rows that are known; the draws; and one scene from end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.advise import advise_method as advise
from hapticlink.analysis.advise import refine_gains
from hapticlink.analysis.advise.draws import FACTOR, draws
from hapticlink.analysis.advise.method import Measured, Method
from hapticlink.analysis.search.acceptance import AcceptanceLimits
from hapticlink.analysis.search.settings import HOLDS
from hapticlink.analysis.sweep.run_sweep import Means
from hapticlink.orchestrator import open_scene
from tests.analysis.search.test_acceptance import row

LIMITS = AcceptanceLimits(42.0)


def test_the_smallest_error_within_the_limits_of_all_draws_is_advised() -> None:
    """`exact` leaves them once, `zoh` is twice as far off; `foh` and `even` win two draws each."""

    def of(hold: str, errors: list[float], within: int = 4) -> Measured:
        return Measured(Method(hold, "own"), np.array(errors), np.zeros(4), np.arange(4) < within)

    exact, zoh = of("exact", [0.1] * 4, 3), of("zoh", [2.0, 4.0, 6.0, 8.0])
    foh, even = of("foh", [1.0, 2.0, 3.0, 4.0]), of("even", [1.3, 1.9, 3.6, 3.9])
    found = advise._chosen("", [zoh, exact, even, foh], {}, LIMITS)
    assert found.taken is foh
    assert found.ties == (even,)
    assert set(found.others) == {exact, zoh}
    assert "1 of" not in next(found.lines())
    none = advise._chosen("", [exact, of("lost", [9.0] * 4, 1)], {}, LIMITS)
    assert none.taken is exact
    assert next(none.lines()).startswith("nothing keeps the limits")


@pytest.mark.parametrize(
    ("worst", "fails", "matters"), [(1.09, False, False), (1.11, False, True), (1.09, True, True)]
)
def test_a_hold_that_matters_little_is_no_advice(worst: float, fails: bool, matters: bool) -> None:
    """It matters where it decides whether a run keeps the limits."""
    rows = {Method("zoh", "own"): row(1.0), Method("foh", "own"): row(worst)}
    if fails:
        rows[Method("exact", "own")] = row(1.0, end="diverged")
    rows[Method("foh", "soft")] = row(5.0)
    taken = Measured(Method("zoh", "own"), np.ones(2), np.zeros(2), np.ones(2, bool))
    lines = list(advise.Advice("", taken, (), (), rows, LIMITS).lines())
    assert ("all 2 keep the limits and leave 1 to 1.09 mm" in lines[0]) is not matters


@pytest.mark.parametrize("scene", ["closed-loop-direct", "closed-loop-b1", "enclosure"])
def test_draws_are_other_hands_of_the_same_kind(scene: str) -> None:
    read = open_scene.load(scene)
    drawn = list(draws(read, 5, 1))
    assert drawn == list(draws(read, 5, 1)) != list(draws(read, 5, 2))
    hands = [open_scene.load(scene, options).hand for options in drawn]
    assert {type(hand) for hand in hands} == {type(read.hand)}
    assert len({str(hand) for hand in hands}) == 5
    for hand in hands:
        if hasattr(hand, "wrench"):
            ratio = np.hypot(*hand.wrench[:2]) / np.hypot(*read.hand.wrench[:2])  # type: ignore[union-attr]
            assert 1 / FACTOR <= ratio <= FACTOR


def test_a_scene_without_a_hand_gets_no_advice(tmp_path: Path) -> None:
    with pytest.raises(hl.InputFault, match="nothing to advise"):
        advise.advise("pendulum", (), Means(tmp_path))


@pytest.mark.parametrize(
    ("own", "told"),
    [((), True), (("device.observer.k_D=120",), False), (("sensing=ideal",), False)],
)
def test_what_another_observer_makes_of_the_advice_is_what_its_run_says(
    own: tuple[str, ...], told: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advise, "all_methods", lambda _: [Method("zoh", "own")])
    monkeypatch.setattr(refine_gains, "STEPS", ())
    given = ("duration=0.3", "controller.bias=full", *own)
    found = advise.advise("closed-loop", given, Means(tmp_path), count=1)
    lines = [line for line in found.lines() if advise.OTHER_OBSERVER in line]
    assert len(lines) == told
    if found.kalman:
        run = hl.run("closed-loop", (*given, "hold=zoh", advise.OTHER_OBSERVER), figures=False)
        assert found.kalman.error_mm[0] == run.measures().tracking[""].max_mm
        assert found.kalman.error_mm[0] < found.taken.error_mm[0]


def test_the_advice_of_a_scene_is_what_its_runs_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two holds and the scene's gains on half a second: the numbers are those of a run."""
    monkeypatch.setattr(advise, "HOLDS", {name: HOLDS[name] for name in ("zoh", "passive")})
    monkeypatch.setattr(refine_gains, "STEPS", (4,))
    given = ("duration=0.5", "controller.teleoperation.stiffness=[100.0, 100.0, 0.1]")
    monkeypatch.setattr(advise, "ROUND", 2)
    found = advise.advise("closed-loop-direct", given, Means(tmp_path), count=1)
    assert found.taken.admitted
    run = hl.run("closed-loop-direct", (*given, *found.taken.method.options), figures=False)
    assert found.taken.error_mm[0] == run.measures().tracking[""].max_mm
    assert len(found.screened) >= 4
