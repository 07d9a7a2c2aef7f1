"""Time is exact."""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.ticks import (
    Clock,
    Timeline,
    align_to_ticks,
    common_base,
    exact,
    periodic,
    round_up_to_ticks,
    variable,
    write_exact,
)

rates = st.fractions(min_value=Fraction(1, 10), max_value=5000, max_denominator=1001)


def test_report_rates_meet_on_1_over_7680_s():
    assert common_base([Fraction(1, 512), Fraction(1, 30)]) == Fraction(1, 7680)


def test_a_rate_is_the_rational_that_was_written():
    assert exact(29.97) == Fraction(2997, 100)
    assert exact("30000/1001") == Fraction(30000, 1001)


@pytest.mark.parametrize(
    ("rate", "text"),
    [(Fraction(512, 3), "512/3"), (Fraction(256, 5), "51.2"), (Fraction(1024), "1024"),
     (Fraction(30000, 1001), "30000/1001")],
)  # fmt: skip
def test_a_rate_that_is_printed_sets_the_same_rate(rate: Fraction, text: str) -> None:
    assert write_exact(rate) == text
    read = open_scene.load("closed-loop-ideal", ["haptics.rate=2048", f"graphics.rate={text}"])
    assert read.graphics
    assert exact(read.graphics.rate) == rate


@given(rates, rates)
def test_base_divides_every_period_and_no_coarser_one_does(a, b):
    base = common_base([1 / a, 1 / b])
    ticks = [1 / a / base, 1 / b / base]
    assert all(t.denominator == 1 for t in ticks)
    assert math.gcd(*map(int, ticks)) == 1


@given(rates, st.integers(0, 10**7))
def test_seconds_round_the_exact_time_once(rate, tick):
    base = 1 / rate
    assert Timeline(base, tick, ()).seconds(tick) == float(tick * base)


@given(rates, st.fractions(Fraction(1, 50), 1, max_denominator=997), st.integers(1, 300))
def test_aligned_frames_end_on_the_first_tick_at_or_after(fast, ratio, end):
    base, slow = 1 / fast, fast * ratio
    frames = align_to_ticks(1 / slow, base, end)
    for i, tick in enumerate(frames):
        assert tick * base >= i / slow > (tick - 1) * base
    assert frames[-1] > end


@given(st.integers(0, 2**32), st.integers(1, 2000))
def test_variable_periods_stay_in_their_bounds_and_follow_the_seed(seed, end):
    base = Fraction(1, 512)
    starts = variable(Fraction(10), Fraction(60), seed, base, end)
    periods = [b - a for a, b in pairwise(starts)]
    assert starts[0] == 0
    assert starts[-1] > end
    assert all(Fraction(1, 60) <= p * base <= Fraction(1, 10) for p in periods)
    assert starts == variable(Fraction(10), Fraction(60), seed, base, end)


BASE = Fraction(1, 512)
CLOSE = [Fraction(1, 30), Fraction(1, 30) + Fraction(1, 9999)]


def test_listed_times_go_to_ticks():
    assert round_up_to_ticks([Fraction(0), Fraction(1, 30), Fraction(1, 10)], BASE) == (0, 18, 52)


@pytest.mark.parametrize(
    ("starts", "why"),
    [
        (lambda: variable(Fraction(60), Fraction(60), 0, BASE, 10), "no period between"),
        (
            lambda: variable(Fraction(10), Fraction(60), 0, BASE, 512 * 10**9),
            "at most 1000000 are: take a",
        ),
        (lambda: round_up_to_ticks(CLOSE, BASE), "falls on tick 18"),
        (lambda: periodic(Fraction(1, 30), BASE, 10), "not a whole number of ticks"),
    ],
)
def test_starts_that_cannot_be_are_refused(starts, why):
    with pytest.raises(ValueError, match=why):
        starts()


@given(
    rates,
    st.fractions(Fraction(1, 50), 1, max_denominator=97),
    st.fractions(0, 1, max_denominator=9),
    st.integers(1, 300),
)
def test_steps_that_are_made_when_asked_for_tell_their_bounds(fast, ratio, phase, end):
    """Longest and shortest come from one round of the frames, not from all of them."""
    base, period = 1 / fast, 1 / (fast * ratio)
    first = max(phase * period, base)
    fine = common_base([period, first])
    assert align_to_ticks(period, base, end, first).repeats == (period / base).numerator
    for frames in (align_to_ticks(period, base, end, first), periodic(period, fine, end, first)):
        steps = [b - a for a, b in pairwise(tuple(frames))]
        clock = Clock("graphics", frames)
        assert len(frames) == len(steps) + 1
        assert clock.first == steps[0]
        assert clock.longest >= max(steps)
        assert clock.shortest <= min(steps[1:], default=clock.longest)
        if len(steps) > getattr(frames, "round", 1):
            assert (clock.longest, clock.shortest) == (max(steps), min(steps[1:]))
