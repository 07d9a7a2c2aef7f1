"""Laws of the holds on samples, without FMUs: polynomials that each reproduces, and invariants."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.table import TABLE
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from tests.orchestrator.holds.bench import Bench

Vector = NDArray[np.float64]
stamps = st.lists(st.integers(1, 40), min_size=3, max_size=8).map(np.cumsum)
EXTRAPOLATING = [name for name, row in TABLE.items() if not row.needs and not row.gives_samples]


def held(name: str, size: int = 1, **parts: object) -> CompiledHold:
    return Bench().hold(name, size, **parts)


@pytest.mark.parametrize("name", ["delayed", "smooth"])
@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.integers(1, 40), st.integers(0, 60)), min_size=3, max_size=12),
    st.integers(0, 2**32 - 1),
)
def test_delayed_and_smooth_have_no_jump_at_any_stamps_and_arrivals(name, rows, seed):
    """Nor has `smooth` a kink. The arrivals are as irregular as the stamps, and never fall."""
    samples = iter(np.random.default_rng(seed).normal(size=(len(rows) + 1, 1)))
    hold, eps = held(name), 1e-6
    hold.push(0, next(samples), 0)
    stamp = arrival = 0
    for period, late in rows:
        stamp += period
        arrival = max(arrival + 1, stamp + late)
        before = [hold.value(arrival, -s * eps).copy() for s in (1, 0)]
        hold.push(stamp, next(samples), arrival)
        after = [hold.value(arrival, s * eps).copy() for s in (0, 1)]
        np.testing.assert_allclose(after[0], before[1], atol=1e-12)
        if name == "smooth":
            slopes = [(b - a) / eps for a, b in (before, after)]
            size = max(1.0, float(np.abs(slopes[0]).max()), float(np.abs(after[0]).max()))
            assert np.abs(slopes[1] - slopes[0]) < 1e-3 * size


UNAIDED = [name for name, hold in HOLDS.items() if hold.needs is None]


@pytest.mark.parametrize("name", UNAIDED)
@settings(max_examples=30)
@given(times=stamps, asked=st.booleans())
def test_a_second_sample_of_a_stamp_replaces_the_first(name, times, asked):
    """Before the hold is asked for a value at its tick."""
    once, twice = (held(name) for _ in range(2))
    for stamp in (0, *times.tolist()):
        sample = np.array([np.sin(stamp)])
        twice.push(stamp, sample + 5.0, stamp)
        for hold in (once, twice):
            hold.push(stamp, sample, stamp)
            if asked:
                hold.value(stamp)
    later = int(times[-1]) + 3
    np.testing.assert_allclose(twice.value(later), once.value(later), rtol=1e-12, atol=1e-12)


def test_a_mean_that_has_been_read_stays():
    hold = held("mean")
    for stamp in (0, 10, 20):
        hold.push(stamp, np.array([float(stamp)]), stamp)
    assert hold.value(20) == 10.0
    hold.push(20, np.array([7.0]), 20)
    assert hold.value(25) == 10.0


def projector(generator: np.random.Generator, rank: int) -> Vector:
    basis = np.linalg.qr(generator.normal(size=(3, 3)))[0][:, :rank]
    return (basis @ basis.T).ravel()


@pytest.mark.parametrize("name", EXTRAPOLATING)
@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), ahead=st.floats(0, 30))
def test_a_projector_stays_a_projector_of_the_newest_rank(name, seed, ahead):
    generator = np.random.default_rng(seed)
    hold = held(name, 9, matrix="projector")
    rank = int(generator.integers(0, 4))
    for k in range(6):
        new = k == 0 or k == 3
        rank = (rank + int(generator.integers(1, 4))) % 4 if new else rank
        sample = projector(generator, rank)
        hold.push(10 * k, sample, 10 * k)
        if new:  # the first of its rank is not mixed with those before
            np.testing.assert_allclose(hold.value(10 * k, ahead), sample, atol=1e-12)
        p = hold.value(10 * k, ahead).reshape(3, 3)
        np.testing.assert_allclose(p, p.T, atol=1e-14)
        np.testing.assert_allclose(p @ p, p, atol=1e-12)
        assert round(np.trace(p)) == rank


@pytest.mark.parametrize(
    ("rates", "order"),
    [((100, 100), 2), ((25, 100), 2), ((37, 100), 1), ((100, 37), 1), ((30, 512), 1)],
)
def test_lead_has_order_two_where_rates_divide(rates, order):
    """The integral of a sine over 1 s, from samples of the first rate held over steps of the
    second; both rates are multiplied by 4 to 32. `foh` has order 2 at any."""
    errors: dict[str, list[float]] = {"lead": [], "foh": []}
    for name, finer in itertools.product(errors, (4, 8, 16, 32)):
        ticks = math.lcm(*rates) * finer
        source, target = (ticks // (rate * finer) for rate in rates)
        hold, total, worst = Bench(base=Fraction(1, ticks)).hold(name), 0.0, 0.0
        for tick in sorted({*range(0, ticks, source), *range(0, ticks, target)}):
            if tick % source == 0:
                hold.push(tick, np.array([np.sin(3 * tick / ticks)]), tick)
            if tick % target == 0:
                if tick > 0.2 * ticks:  # the first two samples are zero-order
                    worst = max(worst, abs(total - (1 - np.cos(3 * tick / ticks)) / 3))
                total += target / ticks * float(hold.value(tick, target / 2)[0])
        errors[name].append(worst)
    slopes = {n: float(np.log2(e[0] / e[-1])) / 3 for n, e in errors.items()}
    assert slopes["lead"] == pytest.approx(order, abs=0.25)
    assert slopes["foh"] == pytest.approx(2, abs=0.25)
