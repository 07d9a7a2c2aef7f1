"""Blind trials with simulated observers, whose thresholds are known."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.trials.blind_trial import BlindTrial
from hapticlink.analysis.trials.order import MOST, REVERSALS, Staircase, in_random_order
from hapticlink.analysis.trials.psychometric import PsychometricFit, fit_threshold

RATES = "graphics.rate=8,11,16,22,31,44,62"
TRUE, SLOPE = 20.0, -5.0
"""An observer's threshold (Hz), and slope in log(rate): low rates are easy to tell."""


class Observer:
    """Somebody who tells a rate by the logistic curve, seldom lapses, and knows nothing else."""

    def __init__(self, seed: int, threshold: float = TRUE) -> None:
        self._draw, self._threshold = np.random.default_rng(seed), threshold
        self.felt: list[dict[str, str]] = []

    def present(self, trial: int, place: int, settings: dict[str, str]) -> None:
        self.felt = [*self.felt[-1:], settings] if place == 2 else [settings]

    def ask(self, trial: int) -> int:
        varied = 1 if self.felt[0] else 2
        rate = float(self.felt[varied - 1]["graphics.rate"])
        told = 1 / (1 + math.exp(-SLOPE * math.log(rate / self._threshold)))
        share = 0.5 + 0.48 * told
        return varied if self._draw.random() < share else 3 - varied


def asked(seed: int, **how) -> BlindTrial:
    trial, observer = BlindTrial.of([RATES]), Observer(seed)
    trial.ask(observer.present, observer.ask, seed=seed, **how)
    return trial


def test_the_threshold_of_a_known_observer_lies_in_its_interval() -> None:
    """In 95 % of cases; of 20, binomially, in 16 or more with a probability of 99.7 %."""
    inside, fits = 0, []
    for seed in range(20):
        (fit,) = asked(seed, repeats=24).thresholds().values()
        if isinstance(fit, PsychometricFit):
            fits.append(fit.threshold)
            inside += (fit.low or 0) <= TRUE <= (fit.high or math.inf)
    assert len(fits) >= 19
    assert inside >= 16
    assert np.median(fits) == pytest.approx(TRUE, rel=0.1)


@pytest.mark.slow
def test_the_share_of_intervals_that_hold_the_threshold() -> None:
    """120 observers: 95 % within three standard errors."""
    held = total = 0
    for seed in range(120):
        (fit,) = asked(1000 + seed, repeats=24).thresholds().values()
        if isinstance(fit, PsychometricFit):
            total += 1
            held += (fit.low or 0) <= TRUE <= (fit.high or math.inf)
    assert total >= 116
    assert abs(held / total - 0.95) < 3 * math.sqrt(0.95 * 0.05 / total)


def test_staircases_stay_about_the_threshold() -> None:
    """Where 70.7 % are right (Levitt 1971): between the levels next to it, over many observers."""
    at = []
    for seed in range(30):
        trial = asked(seed, staircase=True, reference=120.0)
        rates = [float(trial.settings[a.setting]["graphics.rate"]) for a in trial.answers]
        assert rates[0] == 8.0  # the easiest
        assert len(rates) <= MOST
        at.append(np.exp(np.mean(np.log(rates[len(rates) // 2 :]))))
    share = (0.707 - 0.5) / 0.48
    level = TRUE * math.exp(math.log(share / (1 - share)) / SLOPE)
    assert np.median(at) == pytest.approx(level, rel=0.15)


def test_a_staircase_by_hand() -> None:
    stairs = Staircase([0, 1, 2, 3])
    path = []
    for right in (True, True, True, True, False, True, True, False, False):
        path.append(stairs.setting)
        stairs.answer(right)
    assert path == [0, 0, 1, 1, 2, 1, 1, 2, 1]
    assert stairs.setting == 0
    assert stairs.reversals == 3
    while not stairs.ended:
        stairs.answer(stairs.setting < 2)
    assert stairs.reversals == REVERSALS


def test_the_order_is_drawn_and_balanced() -> None:
    pairs = [*in_random_order(3, 10, 1)]
    assert pairs == [*in_random_order(3, 10, 1)]
    assert pairs != [*in_random_order(3, 10, 2)]
    for setting in range(3):
        own = [p.varied_first for p in pairs if p.setting == setting]
        assert (len(own), sum(own)) == (10, 5)
    assert [p.setting for p in pairs] != sorted(p.setting for p in pairs)


def test_where_there_is_no_threshold() -> None:
    levels, n = [10, 20, 40], [20, 20, 20]
    assert "all answers were right" in str(fit_threshold(levels, n, n))
    assert "guessing explains" in str(fit_threshold(levels, [10, 11, 9], n))
    assert "one level" in str(fit_threshold([10], [3], [4]))
    assert "outside of the levels" in str(fit_threshold(levels, [19, 19, 18], n))


def test_a_curve_of_its_own_shares_gives_its_parameters() -> None:
    """Exact shares of many trials: the maximum of the likelihood is the curve itself."""
    levels = np.array([6.0, 9, 13, 18, 26, 38, 55, 80])
    true = PsychometricFit(20.0, None, None, -4.0, 0.02, True)
    n = 10**6
    right = np.round(n * true.share(levels)).astype(int)
    fit = fit_threshold(levels.tolist(), right.tolist(), [n] * len(levels))
    assert isinstance(fit, PsychometricFit)
    assert fit.threshold == pytest.approx(20.0, rel=1e-3)
    assert fit.slope == pytest.approx(-4.0, rel=1e-2)
    assert fit.lapse == pytest.approx(0.02, abs=1e-3)
    assert fit.high is not None
    assert fit.low is not None
    assert 19.8 < fit.low < 20.0 < fit.high < 20.2


def test_names_have_shares_and_no_threshold(tmp_path) -> None:
    trial = BlindTrial.of({"hold": ["zoh", "foh"]})
    trial.ask(lambda *felt: None, lambda number: 1, repeats=6)
    assert trial.thresholds() == {}
    assert [row["right"] for row in trial.shares()] == [3, 3]  # as often first as second
    trial.write(tmp_path / "answers.csv")
    rows = [*csv.DictReader((tmp_path / "answers.csv").open())]
    assert [*rows[0]] == ["trial", "hold", "varied", "answer", "right"]
    assert [int(r["right"]) for r in rows] == [int(r["varied"] == "1") for r in rows]


def test_refusals() -> None:
    with pytest.raises(hl.InputFault, match="a threshold is one of one key"):
        BlindTrial.of(["graphics.rate=10,20", "haptics.rate=512,1024"])
    with pytest.raises(hl.InputFault, match=r"--staircase: .* vary a number"):
        BlindTrial.of({"hold": ["zoh", "foh"]}).ask(lambda *a: None, lambda n: 1, staircase=True)


def test_a_whole_trial_is_written(tmp_path) -> None:
    """What is felt is the scene or the setting, and nothing but the answers says which."""
    felt: list[float] = []

    def ask(question: str, answers: str) -> str:
        if answers == "y/q":
            return "q" if len(felt) == 12 else "y"
        rates = felt[-2:]
        return "1" if rates[0] < rates[1] else "2"  # whoever feels the lower rate

    made = hl.trial(
        "closed-loop", ["graphics.rate=10,15,20"], ask=ask, out=tmp_path, repeats=4, seed=2,
        feel=lambda scene, folder: felt.append(scene.graphics.rate),
    )  # fmt: skip
    assert str(made) == "6 of 6 answers right"
    assert felt.count(30) == 6
    assert made.lines() == [
        "no threshold of graphics.rate: all answers were right: take levels that are harder to tell"
    ]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["answers.csv", "shares.csv", "trial.png"]
    rows = [*csv.DictReader((tmp_path / "answers.csv").open())]
    assert [r["varied"] for r in rows] == [str(1 + (felt[k] == 30)) for k in range(0, 12, 2)]


def test_nobody_feels_a_simulated_device(tmp_path) -> None:
    with pytest.raises(
        hl.InputFault, match="nobody feels a simulated device: give --device PORT, or --page"
    ):
        hl.trial("closed-loop", ["graphics.rate=10"], ask=lambda *a: "q", out=tmp_path)
