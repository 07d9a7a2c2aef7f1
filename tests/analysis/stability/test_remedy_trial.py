"""Trials of remedies that end early choose what judging all poses would choose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from hapticlink.analysis.stability import remedy_trial
from hapticlink.analysis.stability.hand_cases import Case, hardest_first
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import Pose
from hapticlink.analysis.stability.remedy_trial import Remedy, Trial, find_best, those_that_help
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.orchestrator.base.errors import InputFault

HANDS = {"soft": None, "firm": None}
POSES = [Pose(float(t), {}, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for t in range(4)]
GROWTHS = (-0.3, -0.2, -0.1, -0.02, 0.4)


class Cases:
    """Cases drawn at random, in the place of what poses of a scene have, and which were asked."""

    def __init__(self, seed: int) -> None:
        draw = np.random.default_rng(seed)
        self.fails = draw.random(3) < 0.15
        self.breaks = draw.random(3) < 0.3
        self.without = draw.random((3, len(POSES))) < 0.05
        self.of = {
            (k, pose.name): [
                Case(
                    pose.name, hand, growth, 0.0, 2.0, "oscillation",
                    "marginal" if draw.random() < 0.15 else "unstable" if growth > 0 else "stable",
                    (),
                )
                for hand, growth in zip(HANDS, draw.choice(GROWTHS, 2).tolist(), strict=True)
            ]
            for k in range(3)
            for pose in POSES
        }  # fmt: skip
        self.asked = 0

    def in_poses(
        self, number: int, poses: Iterable[Pose], *_: object
    ) -> tuple[list[Case], dict[str, str]]:
        found, why = list[Case](), dict[str, str]()
        for pose in poses:
            self.asked += 1
            if self.without[number, int(pose.time)]:
                why[pose.name] = "no equilibrium"
            else:
                found += self.of[number, pose.name]
        return found, why

    def visited(self, number: int) -> tuple[list[Pose], str]:
        if self.fails[number]:
            raise InputFault("its run fails")
        return POSES, "too far" * bool(self.breaks[number])

    def trials(self, hardest: list[str]) -> list[Trial]:
        return [
            Trial(
                (str(k),), k, self.visited, hardest, HANDS, DRIFT, lambda pose: None, SharedWork()
            )  # type: ignore[arg-type]
            for k in range(3)
        ]


@pytest.mark.parametrize("hardest", [[], ["2 s", "1 s"]], ids=str)
def test_the_best_remedy_is_that_of_judging_all_poses_by_fewer(
    hardest: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    fewer = every = 0
    for seed in range(300):
        cases = Cases(seed)
        monkeypatch.setattr(remedy_trial, "in_poses", cases.in_poses)
        found = find_best(cases.trials(hardest))
        fewer, cases.asked = fewer + cases.asked, 0
        whole = [trial.judge() for trial in cases.trials(hardest)]
        every += cases.asked
        assert found == min(whole, key=lambda remedy: remedy.rank)
        for remedy, trial in zip(whole, cases.trials(hardest), strict=True):
            assert trial.judge(lambda remedy: remedy.suffices).suffices == remedy.suffices
    assert fewer < 0.8 * every


def test_the_rank_of_a_trial_never_becomes_better(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(100):
        cases = Cases(seed)
        monkeypatch.setattr(remedy_trial, "in_poses", cases.in_poses)
        for trial in cases.trials([]):
            ranks = [trial.remedy.rank]
            while not trial.ended:
                trial.judge_further()
                ranks.append(trial.remedy.rank)
            assert ranks == sorted(ranks)


def test_a_remedy_ranks_by_what_is_worse_first() -> None:
    good = Remedy(("a",), -0.1, True)
    worse = [
        replace(good, growth=-0.09),
        replace(good, growth=-0.2, marginal=("firm",)),
        replace(good, growth=-0.2, breaks="too far"),
        replace(good, growth=0.1),
        replace(good, growth=float("inf")),
    ]
    assert sorted([*reversed(worse), good], key=lambda remedy: remedy.rank) == [good, *worse]


def test_the_hardest_pose_has_the_most_marginal_hands_then_what_grows_most() -> None:
    def case(pose: str, growth: float, verdict: str) -> Case:
        return Case(pose, "firm", growth, 0.0, 2.0, "oscillation", verdict, ())

    cases = [case("a", -0.1, "stable"), case("b", 2.0, "unstable"), case("c", 0.0, "marginal")]
    assert hardest_first(cases) == ["c", "b", "a"]


def test_what_grows_as_fast_as_without_it_is_no_remedy() -> None:
    """Poses are those of the run with a change, in which it may do worse."""
    calm, better, worse = (Remedy((), growth, growth < 0.0) for growth in (-0.2, 0.3, 0.47))
    assert those_that_help([calm, better, worse], 0.391) == (calm, better)
    assert those_that_help([replace(calm, growth=np.inf)], 0.391) == ()
