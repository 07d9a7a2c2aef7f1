"""Laws of the holds on samples, without FMUs: polynomials that each reproduces, and invariants."""

import itertools
import math
from collections.abc import Callable
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


def fed(hold: CompiledHold, times: Vector, signal: Callable[[float], Vector]) -> CompiledHold:
    """Every sample pushed at its stamp, the hold asked at each."""
    for t in times:
        hold.push(int(t), signal(t), int(t))
        hold.value(int(t))
    return hold


@given(stamps, st.integers(0, 40), st.floats(0, 20), st.integers(0, 2))
def test_a_polynomial_of_the_holds_degree_is_continued_exactly(times, later, ahead, degree):
    coefficients = np.array([0.5, -0.3, 0.01][: degree + 1])

    def signal(t):
        return np.array([np.polynomial.polynomial.polyval(t, coefficients)])

    def slope(t):
        derivative = np.polynomial.polynomial.polyder(coefficients)
        return np.array([np.polynomial.polynomial.polyval(t, derivative) if degree else 0.0])

    tick = int(times[-1]) + later
    true = signal(tick + ahead)
    for name, exact_to in (("zoh", 0), ("foh", 1), ("second-order", 2)):
        if degree <= exact_to:
            value = fed(held(name), times, signal).value(tick, ahead)
            np.testing.assert_allclose(value, true, rtol=1e-9, atol=1e-9)
    if degree <= 1:
        own = held("foh-derivative")
        own.push(int(times[0]), np.concatenate([signal(times[0]), slope(times[0])]), int(times[0]))
        np.testing.assert_allclose(own.value(tick, ahead), true, rtol=1e-9, atol=1e-9)
        period = times[-1] - times[-2]
        lead = fed(held("lead"), times, signal).value(tick)
        np.testing.assert_allclose(lead, signal(times[-1] + period / 2), rtol=1e-9, atol=1e-9)


@given(stamps, st.integers(0, 40), st.floats(0, 20), st.floats(1, 20))
def test_a_slope_is_the_rate_of_what_foh_makes_of_the_pose(times, later, ahead, apart):
    pose = lambda t: np.array([np.sin(0.3 * t), t * t])  # noqa: E731
    poses = fed(held("foh", 2), times, pose)
    slope = fed(
        Bench(base=Fraction(1, 512)).hold("slope", 2),
        times,
        lambda t: np.concatenate([np.array([np.nan, np.nan]), pose(t)]),
    )
    tick = int(times[-1]) + later
    moved = poses.value(tick, ahead + apart) - poses.value(tick, ahead)
    np.testing.assert_allclose(slope.value(tick, ahead), moved * 512 / apart, rtol=1e-6, atol=1e-6)


def test_until_the_second_sample_a_slope_is_zero_as_the_pose_is_constant():
    slope = held("slope", 2)
    slope.push(0, np.array([3.0, 4.0, 1.0, 2.0]), 0)
    np.testing.assert_array_equal(slope.value(5, 2.5), [0.0, 0.0])


@given(stamps)
def test_delayed_and_smooth_reach_each_sample_a_period_later(times):
    signal = lambda t: np.array([np.sin(0.3 * t), t * t])  # noqa: E731
    arrival = int(times[-1])
    period = arrival - int(times[-2])
    for name in ("delayed", "smooth"):
        hold = fed(held(name, 2), times, signal)
        np.testing.assert_allclose(hold.value(arrival + period), signal(arrival), atol=1e-9)


@given(st.integers(1, 40), st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_delayed_goes_from_sample_to_sample_at_a_fixed_period(period, share, seed):
    samples = np.random.default_rng(seed).normal(size=(6, 2))
    hold = held("delayed", 2)
    for n, sample in enumerate(samples):
        hold.push(n * period, sample, n * period)
        expected = samples[max(n - 1, 0)] * (1 - share) + sample * share
        np.testing.assert_allclose(hold.value(n * period, share * period), expected, atol=1e-12)


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


def test_delayed_where_periods_vary():
    """Samples at 0, 20, 40, 50: at 50 it stands halfway between the two before."""
    hold = held("delayed")
    for stamp, sample in ((0, 0.0), (20, 1.0), (40, 2.0), (50, 3.0)):
        hold.push(stamp, np.array([sample]), stamp)
    assert [float(hold.value(50, s)[0]) for s in (0, 5, 10, 20)] == [1.5, 2.25, 3.0, 3.0]


@given(stamps)
def test_mean_over_a_slow_step_is_the_integral_of_the_samples(times):
    hold = held("mean")
    hold.push(0, np.array([0.0]), 0)
    assert hold.value(0) == 0.0
    for t in times.tolist():
        hold.push(t, np.array([3.0 * t]), t)
    np.testing.assert_allclose(hold.value(int(times[-1])), 1.5 * times[-1], rtol=1e-12)
    np.testing.assert_allclose(hold.value(int(times[-1]) + 5), 1.5 * times[-1], rtol=1e-12)


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


def test_a_turning_direction_is_continued_not_frozen():
    """A first-order hold between lines at 0 and 10 degrees points near 15 half a period later."""
    hold = held("foh", 4, matrix="projector")
    for stamp, angle in ((0, 0.0), (10, np.radians(10))):
        line = np.array([np.cos(angle), np.sin(angle)])
        hold.push(stamp, np.outer(line, line).ravel(), stamp)
    p = hold.value(15).reshape(2, 2)
    assert np.degrees(np.arctan2(p[1, 0], p[0, 0])) == pytest.approx(15, abs=0.3)


@pytest.mark.parametrize("name", EXTRAPOLATING)
@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), ahead=st.floats(0, 30), scale=st.floats(-3, 3))
def test_a_mobility_stays_semidefinite_in_any_units(name, seed, ahead, scale):
    generator = np.random.default_rng(seed)
    units = np.outer(u := np.array([1.0, 1.0, 10**scale]), u).ravel()
    plain, scaled = (held(name, 9, matrix="semidefinite") for _ in range(2))
    for k in range(4):
        root = generator.normal(size=(3, 2))
        sample = (root @ root.T).ravel()
        plain.push(10 * k, sample, 10 * k)
        scaled.push(10 * k, sample * units, 10 * k)
    m = plain.value(30, ahead).reshape(3, 3)
    np.testing.assert_allclose(m, m.T, atol=1e-12 * np.abs(m).max())
    assert np.linalg.eigvalsh(m)[0] >= -1e-12 * np.abs(m).max()
    other = scaled.value(30, ahead) / units
    np.testing.assert_allclose(other, m.ravel(), rtol=0, atol=1e-9 * max(np.abs(m).max(), 1.0))


@pytest.mark.parametrize("turn", [2 * np.pi, 360.0, 400.0])
@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_turn_is_one_in_the_unit_of_each_angle(turn, seed):
    """A walk in steps below half a turn, wrapped, is the walk again."""
    walk = np.cumsum(np.random.default_rng(seed).uniform(-0.49, 0.49, size=30)) * turn
    walk -= walk[0]
    hold = held("zoh", 2, turns={0: turn, 1: 2 * np.pi})
    for k, angle in enumerate(walk.tolist()):
        both = np.array([(angle + turn / 2) % turn - turn / 2, 0.0])
        hold.push(k, both, k)
        assert hold.value(k)[0] == pytest.approx(angle, abs=1e-9 * turn)
        assert hold.value(k)[1] == 0.0


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
