"""The holds around a plant whose step is taken when it begins: their laws alone, against SciPy."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from tests.orchestrator.holds.bench import Bench

BASE = Fraction(3, 7680)
N = 3
few = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)


@few
@given(seeds)
def test_between_both_ends_it_is_the_cubic_its_slope_or_the_line(seed):
    rng = np.random.default_rng(seed)
    x, v = rng.normal(size=(2, 2, N))
    stamps = np.array([0, int(rng.integers(5, 60))])
    cubic = CubicHermiteSpline(stamps * float(BASE), x, v)
    laws = {
        "WITH_RATE": (np.hstack([x, v]), cubic),
        "WITH_POSE": (np.hstack([v, x]), cubic.derivative()),
        "ALONE": (x, lambda t: x[0] + (x[1] - x[0]) * t / (stamps[1] * float(BASE))),
    }
    for relation, (samples, law) in laws.items():
        own = {"further": tuple(range(N, samples.shape[1])), "relation": relation}
        hold = Bench(1, BASE).hold("ahead", N, **own)
        for stamp, sample in zip(stamps.tolist(), samples, strict=True):
            hold.push(stamp, sample, 0)
        for tick in (0, stamps[1] // 2, stamps[1]):
            part = rng.uniform(0, 1) if tick < stamps[1] else 0.0
            expected = law((tick + part) * float(BASE))
            np.testing.assert_allclose(hold.value(int(tick), part), expected, rtol=1e-9, atol=1e-9)


@few
@given(seeds)
def test_until_the_result_is_there_it_goes_on_with_the_efforts_that_are_held(seed):
    rng = np.random.default_rng(seed)
    x, v, bias = rng.normal(size=(3, N))
    mobility, signs = rng.normal(size=(N, N)), np.repeat([1.0, -1.0], N)
    s = 20.5 * float(BASE)
    for relation in ("WITH_RATE", "WITH_POSE", "ALONE"):
        pair = (x, v) if relation == "WITH_RATE" else (v, x)
        sample = np.concatenate([*pair, mobility.ravel(), bias])
        bench = Bench(2 * N, BASE)
        own = {"further": tuple(range(N, len(sample))), "relation": relation}
        hold = bench.hold("ahead", N, beside=bench.reader(range(2 * N), signs), **own)
        bench.values[:] = rng.normal(size=2 * N)
        a = mobility @ (bench.values[:N] - bench.values[N:]) + bias
        hold.push(10, sample, 10)
        expected = {"WITH_RATE": x + v * s + a * s**2 / 2, "WITH_POSE": v + a * s, "ALONE": v}
        np.testing.assert_allclose(hold.value(30, 0.5), expected[relation], rtol=1e-9, atol=1e-12)


@few
@given(seeds)
def test_half_lead_goes_on_from_the_mean_of_the_frame(seed):
    rng = np.random.default_rng(seed)
    hold = Bench(base=BASE).hold("half-lead", N)
    y = rng.normal(size=(9, N))
    for k, sample in enumerate(y):
        hold.push(3 * k, sample, 3 * k)
        if k == 4:
            hold.value(3 * k)
    mean = np.trapezoid(y[4:], axis=0) / 4
    for _ in range(2):
        np.testing.assert_allclose(hold.value(24, 7.0), y[8] + (y[8] - mean) / 2, rtol=1e-12)


def reacting(rng, n, F, x, v, mobility):
    """The value of `reaction` over a step of 24 ticks behind a first step without meaning, and the
    mean of both velocities; F, x, v are samples, a row each."""
    m = 2 * n
    bench = Bench(2 * m + n * n, BASE)
    further, beside = tuple(range(n, 3 * n)), bench.reader(range(2 * m + n * n))
    hold = bench.hold("reaction", n, beside=beside, further=further)
    far, near = rng.normal(size=(2, n))
    bench.values[:] = np.concatenate([np.zeros(m), far, near, mobility.ravel()])
    hold.push(0, np.concatenate([F[0], x[0], v[0]]), 0)
    hold.value(0, 12.0)
    for k in range(1, len(F)):
        hold.push(3 * k, np.concatenate([F[k], x[k], v[k]]), 3 * k)
    found = hold.value(3 * len(F) - 3, 12.0)
    np.testing.assert_array_equal(hold.value(3 * len(F) - 3, 7.0), found)
    return found, (far + near) / 2


@few
@given(seeds)
def test_reaction_is_the_mean_effort_of_what_gives_way_as_it_did(seed):
    """k and b by ridge regression of NumPy, the motion by the mean of its parabola."""
    rng = np.random.default_rng(seed)
    n, H = int(rng.integers(1, 5)), 24 * float(BASE)
    x, v, rest = rng.normal(size=(3, 9, n))
    root = rng.normal(size=(n, n))
    k, b = rng.uniform(0, 5, (2, n))
    F, mobility = rest - k * x - b * v, root @ root.T
    found, rate = reacting(rng, n, F, x, v, mobility)
    a = mobility @ found
    for i in range(n):
        z = np.stack([x[:, i], v[:, i]], axis=1)
        z -= z.mean(axis=0)
        scale = np.sqrt((z**2).mean(axis=0) + np.array([1e-5, 1e-5 / H]) ** 2)
        ridge = np.sqrt(0.3 * len(z)) * np.eye(2)
        y = np.concatenate([F[:, i].mean() - F[:, i], [0.0, 0.0]])
        k_i, b_i = np.maximum(np.linalg.lstsq(np.vstack([z / scale, ridge]), y)[0] / scale, 0)
        r = F[:, i] + k_i * x[:, i] + b_i * v[:, i]
        moved, faster = rate[i] * H / 2 + a[i] * H**2 / 6, a[i] * H / 2
        expected = F[-1, i] + (r[-1] - r.mean()) / 2 - k_i * moved - b_i * faster
        assert found[i] == pytest.approx(expected, rel=1e-7, abs=1e-7)


@few
@given(seeds)
def test_reaction_to_motions_far_below_10_um_is_half_lead(seed):
    """A hand of 300 N/m, of which it finds the less the smaller its motions are."""
    rest, H = np.random.default_rng(seed).normal(size=(9, N)), 24 * float(BASE)

    def share(size):
        """Of the hand's stiffness, by what the value gives way to the velocity that follows."""
        x = size * rest
        found, v = reacting(np.random.default_rng(seed), N, -300 * x, x, 0 * x, np.zeros((N, N)))
        gives_way = -300 * (x[-1] + (x[-1] - x.mean(axis=0)) / 2) - found
        return np.abs(gives_way / (300 * v * H / 2)).max()

    assert share(1e-8) < 1e-4
    assert share(1e-7) < 1e-2
    assert share(1e-4) > 0.3


def mid(rng, n, K, B, mobility):
    bench = Bench(4 * n + n * n, BASE)
    reader = bench.reader(range(4 * n + n * n))
    hold = bench.hold("mid", n, beside=reader, gains=(K, B), parts=1)
    bench.values[:] = np.concatenate([rng.normal(size=4 * n), mobility.ravel()])
    hold.push(0, np.zeros(n), 0)
    return bench, hold


def drawn(rng, n):
    K, B = 10.0 ** rng.uniform(-2, 3, (2, n))
    root = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1)
    return K * (rng.uniform(size=n) > 0.2), B * (rng.uniform(size=n) > 0.2), root @ root.T


def moved(e, rate, F, H, K, B, mobility, **options):
    """e, its rate and the integral of rate' B rate after H with F held, by SciPy."""
    n = len(e)

    def slope(t, z):
        return [
            *z[n : 2 * n],
            *(-mobility @ (K * z[:n] + B * z[n : 2 * n] + F)),
            z[n : 2 * n] @ (B * z[n : 2 * n]),
        ]

    z = solve_ivp(slope, (0, H), [*e, *rate, 0.0], "Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    return z[:n], z[n : 2 * n], z[-1]


@pytest.mark.parametrize("seed", range(12))
def test_mid_is_the_force_of_both_ends_and_its_energy_does_not_grow(seed):
    """The motion between the ends with that force, by SciPy, has these ends; and what is stored in
    the motion and twice in the spring grows by no more than the dampers take."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    K, B, mobility = drawn(rng, n)
    bench, hold = mid(rng, n, K, B, mobility)
    ticks = int(rng.integers(5, 200))
    F, H = hold.value(0, ticks / 2), ticks * float(BASE)
    e, rate = (
        bench.values[2 * i * n : (2 * i + 1) * n] - bench.values[(2 * i + 1) * n : (2 * i + 2) * n]
        for i in (0, 1)
    )
    e1, rate1, taken = moved(e, rate, F, H, K, B, mobility)
    scale = 1e-6 * (1 + np.abs(F).max())
    np.testing.assert_allclose(F, K * (e + e1) / 2 + B * (e1 - e) / H, atol=scale)
    inertia = np.linalg.inv(mobility)
    W, W1 = (r @ inertia @ r / 2 + x @ (K * x) for x, r in ((e, rate), (e1, rate1)))
    lost = taken + (e1 - e) @ (B * (e1 - e)) / H
    assert pytest.approx(-lost, abs=1e-6 * (1 + W)) == W1 - W
    assert W1 <= W * (1 + 1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_mid_is_the_same_for_all_parts_of_a_step(seed):
    rng = np.random.default_rng(seed)
    K, B, mobility = drawn(rng, 3)
    whole = mid(rng, 3, K, B, mobility)
    rng = np.random.default_rng(seed)
    drawn(rng, 3)
    parts = mid(rng, 3, K, B, mobility)
    parts[1].c.parts = 4
    expected = whole[1].value(0, 30.0)
    for part in range(4):
        found = parts[1].value(0, 60 / 4 * (part + 0.5))
        np.testing.assert_array_equal(found, expected)
