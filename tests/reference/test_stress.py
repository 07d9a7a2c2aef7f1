"""The short form of `hapticlink bench stress`: hard scenes that end as the catalogue says."""

import json
from collections import Counter

import pytest

from benchmarks import stress
from tests.shared_fixtures import status

CASES = stress.cases()


@pytest.mark.parametrize("case", [c for c in CASES if c.quick], ids=lambda c: c.name)
def test_ends_as_it_has_to(case):
    assert not stress.make(case).wrong(case)


def test_names_are_unique_and_every_outcome_is_expected_of_some():
    assert max(Counter(case.name for case in CASES).values()) == 1
    assert {case.expect for case in CASES} == {"stable", "warned", "stopped", "ended", "refused"}


def test_an_instability_is_told_from_a_good_end(tmp_path):
    """By the command's status, and in run.json by the reason of the end and its fault."""
    for rate, code, reason in (("10", 1, "diverged"), ("60", 0, "duration")):
        options = [f"--set=graphics.rate={rate}", "--set=duration=1", "--no-figures"]
        gains = "--set=controller.teleoperation.damping=[70,70,0.375]" if code else "--set=hold=foh"
        out = tmp_path / rate
        assert status("run", "closed-loop-direct", *options, gains, "--out", out) == code
        told = json.loads((out / "run.json").read_text())
        assert told["end"]["reason"] == reason
        assert bool(told["fault"]) == bool(code)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"expect": "ended"}, "stable, expected ended"),
        ({"says": "diverged"}, "does not say 'diverged': duration at 1 s"),
        ({"map": "unstable"}, "the map says stable, expected unstable"),
    ],
)
def test_a_wrong_end_is_noticed(changed, said):
    fields = {"name": "wall", "kind": "contact", "why": "", "expect": "stable", "map": "stable"}
    case = stress.Case(scene="virtual-wall", **(fields | changed))
    made = stress.Made(outcome="stable", status=0, end="duration at 1 s", rise=0.0, map="stable")
    assert said == made.wrong(case)
