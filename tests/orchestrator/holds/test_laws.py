"""The laws of the holds in C against references of a few lines: interpolating polynomials,
recursions and sums over the whole history, eigenvectors of LAPACK."""

import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.interpolate import KroghInterpolator

from hapticlink.orchestrator.holds.table import TABLE
from hapticlink.orchestrator.run.compiled.hold_structures import array
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.latency_and_loss import SampleLink
from tests.orchestrator.holds.bench import Bench, generated, vector

BASE = Fraction(3, 7680)
N = 3
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=25, deadline=None)


def close(found, expected, scale=1.0):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * scale)


# --- polynomials in time ------------------------------------------------------------------------


def through(stamps, samples, slopes=()):
    """The polynomial through the samples, and with these slopes (per s) at the same instants."""
    times = [float(t * BASE) for t in stamps]
    order = np.argsort([*times, *times[: len(slopes)]], kind="stable")
    each = [*samples, *slopes]
    return KroghInterpolator(np.array([*times, *times][: len(each)])[order], np.array(each)[order])


def newest(count):
    """The polynomial through so many of the newest samples."""
    return lambda stamps, y, yd, t: through(stamps[-count:], y[-count:])(float(t * BASE))


def along_derivative(stamps, y, yd, t):
    return y[-1] + yd[-1] * float((t - stamps[-1]) * BASE)


def slope(stamps, y, yd, t):
    if len(y) < 2:
        return 0.0 * y[-1]
    return (yd[-1] - yd[-2]) / float((stamps[-1] - stamps[-2]) * BASE)


def hermite(stamps, y, yd, t):
    if len(y) < 2:
        return along_derivative(stamps, y, yd, t)
    return through(stamps[-2:], y[-2:], yd[-2:])(float(t * BASE))


LAWS = {
    "zoh": newest(1),
    "latest": newest(1),
    "foh": newest(2),
    "second-order": newest(3),
    "foh-derivative": along_derivative,
    "slope": slope,
    "hermite": hermite,
}
"""The value at tick t from all samples y, and what they have beside, yd."""
OF_SAMPLES = [
    name
    for name, row in TABLE.items()
    if row.push == "samples" and row.needs not in ("gradient", "step", "coupling")
]
"""Without those whose laws are in test_model_hold.py and test_early_steps.py."""
NOT_ALONE = ("spring", "coupling", "reaction", "step")
"""What a hold needs whose value does not follow from samples alone."""


@pytest.mark.parametrize("name", OF_SAMPLES)
@few
@given(seeds)
def test_values_are_those_of_the_law(name, seed):
    assert name in LAWS, f"write the law of {name} in LAWS of this file"
    generator = np.random.default_rng(seed)
    hold = Bench(base=BASE).hold(name, N)
    stamps, y, yd, tick = [], [], [], 0
    for _ in range(6):
        stamps.append(int(tick))
        y.append(generator.normal(size=N))
        yd.append(10 * generator.normal(size=N))
        sample = np.concatenate([y[-1], yd[-1]]) if TABLE[name].needs else y[-1]
        hold.push(int(tick), sample, int(tick) + 2)
        for ahead in (0.0, generator.uniform(0, 20), 7.5):
            later = int(tick) + 2
            expected = LAWS[name](stamps, y, yd, later + Fraction(ahead))
            close(hold.value(later, ahead), expected, 1e3)
        tick += generator.integers(3, 40)


@pytest.mark.parametrize("name", [n for n in TABLE if TABLE[n].needs not in NOT_ALONE])
@few
@given(seeds)
def test_the_degree_is_that_of_the_value_within_a_step(name, seed):
    """Of differences at equal distances those of this order are none, and one order lower some."""
    generator = np.random.default_rng(seed)
    row, bench = TABLE[name], Bench(2 * N, BASE)
    readers = {"displacement": bench.reader(range(N)), "velocity": bench.reader(range(N, 2 * N))}
    hold = bench.hold(name, N, **readers)
    for tick in range(0, 160, 40):
        hold.push(tick, generator.normal(size=hold.width), tick)
        hold.value(tick)
    values = np.array([hold.value(120, ahead) for ahead in np.linspace(0.0, 30.0, 13)])
    degree, scale = row.degree, np.abs(values).max()
    if degree is None:
        assert np.abs(np.diff(values, axis=0)).max() > 1e-6 * scale
    else:
        assert np.abs(np.diff(values, degree + 1, axis=0)).max() < 1e-9 * scale
        assert np.abs(np.diff(values, degree, axis=0)).max() > 1e-6 * scale


@few
@given(seeds)
def test_towards_samples(seed):
    """`delayed` is the line from the value at the arrival to the sample, `smooth` the cubic with
    the slope of the last two samples at its end; both arrive a period later."""
    generator = np.random.default_rng(seed)
    holds = {name: Bench(base=BASE).hold(name) for name in ("delayed", "smooth")}
    tick, begin, length, last = 0, 0, np.inf, (0, 0.0)
    line = curve = tail = Polynomial([0.0])
    for k in range(8):
        stamp, y = int(tick), float(generator.normal())
        arrival = stamp + int(generator.integers(0, 10))
        for hold in holds.values():
            hold.push(stamp, np.array([y]), arrival)
        H, end = np.inf, Polynomial([y])
        if k == 0:
            line = curve = end
        else:
            H, at = stamp - last[0], arrival - begin
            end = Polynomial([y, (y - last[1]) / H])
            w = line(min(at, length)) if k > 1 else last[1]
            line = Polynomial([w, (y - w) / H])
            before, start = (curve, at) if at < length else (tail, at - length)
            p, v, m = before(start), before.deriv()(start), end.coef[1]
            cubic = 3 * (y - p) - (2 * v + m) * H, (v + m) * H - 2 * (y - p)
            curve = Polynomial([p, v, cubic[0] / H**2, cubic[1] / H**3])
        begin, length, tail, last = arrival, H, end, (stamp, y)
        for ahead in generator.uniform(0, 60, 4):
            close(holds["delayed"].value(arrival, ahead)[0], line(min(ahead, H)) if k else y, 10)
            expected = curve(ahead) if ahead < H else tail(ahead - H)
            close(holds["smooth"].value(arrival, ahead)[0], expected if k else y, 100)
        tick += generator.integers(10, 40)


@few
@given(seeds)
def test_the_mean_is_the_integral_between_two_readings(seed):
    generator = np.random.default_rng(seed)
    hold = Bench(base=BASE).hold("mean", N)
    stamps, samples, read, held = [], [], 0, None
    for tick in np.cumsum(generator.integers(1, 9, 40)).tolist():
        stamps.append(tick)
        samples.append(generator.normal(size=N))
        hold.push(tick, samples[-1], tick)
        if generator.random() < 0.3 or len(stamps) == 1:
            held = samples[0]
            if len(stamps) > 1:
                area = np.trapezoid(samples[read:], stamps[read:], axis=0)
                held = area / (stamps[-1] - stamps[read])
            read = len(stamps) - 1
            close(hold.value(tick), held)
        if held is not None and read == len(stamps) - 1:
            close(hold.value(tick + 1), held)


# --- energy -------------------------------------------------------------------------------------


def account(held, forces, stamps, x):
    """E of the module's text at each tick k = len(held): stamps[n] is the tick of forces[n]."""
    work = sum(h * (b - a) for h, a, b in zip(held, x, x[1:], strict=False))
    ideal = sum(
        (forces[n] + forces[n + 1]) / 2 * (x[stamps[n + 1]] - x[stamps[n]])
        for n in range(len(stamps) - 1)
    )
    return work - ideal - forces[-1] * (x[-1] - x[stamps[-1]])


@pytest.mark.parametrize("name", ["passive", "nepce"])
@few
@given(seeds, st.integers(1, 6))
def test_forces_of_holds_that_observe_their_energy(name, seed, every):
    """From sums over all ticks so far: F_n - beta sign(d) c, and F_n - E/D."""
    generator = np.random.default_rng(seed)
    bench = Bench(2, BASE)
    readers = {"displacement": bench.reader([0], 2.0), "velocity": bench.reader([1], 2.0)}
    hold = bench.hold(name, **readers)
    tick_s = float(BASE)
    x, v, held, forces, stamps = [0.0], [], [], [], []
    beta, ahead, swing, correction = 1.0, 0.0, 0.0, 0.0
    for tick in range(80):
        bench.values[1] = 10 * generator.normal()
        v.append(2.0 * bench.values[1])
        if fresh := tick % every == 0:
            forces.append(float(generator.normal()))
            stamps.append(tick)
            hold.push(tick, np.array(forces[-1:]), tick)
            if len(forces) > 1:
                swing = max(swing, abs(forces[-1] - forces[-2]) / 2)
        E, F = account(held, forces, stamps, x), forces[-1]
        largest = max(abs(force) for force in forces[-2:])
        if name == "passive":
            gained = v[-1] - v[-2] if tick else 0.0
            moved = x[-1] - x[-2] if tick else 0.0
            beta = beta / 2 if moved * ahead < -0.01 * ahead**2 else min(1.1 * beta, 1.0)
            ahead = (v[-1] + gained / 2) * tick_s
            P = E + swing * abs(x[-1] - x[stamps[-1]])
            D = abs(ahead) + (0.0 if P > 0 else abs(v[-1] * tick_s))
            c = np.clip(swing + (P / D if D else 0.0), 0.0, max(swing, largest))
            correction = -np.sign(ahead) * beta * c
        elif fresh:
            D = x[-1] - x[stamps[-2]] if len(stamps) > 1 else 0.0
            correction = float(np.clip(-E / D, -largest, largest)) if D else 0.0
        held.append(float(hold.value(tick, 0.5)[0]))
        close(held[-1], F + correction, 1 + abs(F))
        close(generated(hold), E, 1 + abs(E))
        bench.values[0] += v[-1] * tick_s / 2 * generator.uniform(-0.5, 1.5)
        x.append(2.0 * bench.values[0])


@few
@given(seeds, st.integers(1, 12))
def test_with_late_samples_the_friction_of_passive_has_the_way_since_the_stamp(seed, late):
    """F_n - beta sign(d) c with P = E + r times the length of the way since the stamp of F_n, back
    and forth; r of all samples that are held after the stamp before. E, beta and d are tested with
    samples that are in time, and E with late ones by meters."""
    generator = np.random.default_rng(seed)
    bench = Bench(2, BASE)
    readers = {"displacement": bench.reader([0]), "velocity": bench.reader([1])}
    hold = bench.hold("passive", **readers)
    x, until, swing, stamp, force, largest = [0.0], [], 0.0, 0, 1.0, 1.0
    hold.push(0, np.array([force]), 0)
    for tick in range(80):
        if tick > late and generator.random() < 0.4:
            before, force = force, float(generator.normal())
            hold.push(tick - late, np.array([force]), tick)
            until.append((tick, before))
            held = [other for ended, other in until if ended > stamp]
            swing = max(swing, *(abs((before + force) / 2 - other) for other in held))
            stamp, largest = tick - late, max(abs(force), abs(before))
        bench.values[:] = x[-1], 10 * generator.normal()
        found = float(hold.value(tick, 0.5)[0])
        beta, ahead, steady = (
            float(vector(hold, name)[0]) for name in ("beta", "predicted", "steady")
        )
        way = np.abs(np.diff(x[stamp:])).sum() if until else abs(x[-1])
        P = generated(hold) + swing * way
        D = abs(ahead) + (0.0 if P > 0 else abs(steady))
        c = np.clip(swing + (P / D if D else 0.0), 0.0, max(swing, largest))
        close(found, force - np.sign(ahead) * beta * c, 1 + abs(force))
        share = generator.uniform(0.0, 1.5) if generator.random() < 0.95 else -0.5
        x.append(x[-1] + share * ahead)


@pytest.mark.parametrize("sampled", [False, True])
@few
@given(seeds)
def test_a_set_position_is_modulated_by_the_energy_available(sampled, seed):
    """A from the sum of all that the near side has put in: F.dx of a sampled force, or the bound of
    a spring and damper that act continuously."""
    generator = np.random.default_rng(seed)
    bench = Bench(2 * N, BASE)
    x, v = bench.values[:N], bench.values[N:]
    K, B = 10 ** generator.uniform(0, 2, N), generator.uniform(0, 1, N)
    velocity = bench.reader(range(N, 2 * N)) if sampled else None
    T = 3 * float(BASE)
    tank = bench.tank(K, B, range(N), period=T, sampled=sampled, velocity=velocity)
    position, rate = (bench.hold("pspm", N, tank, row=row) for row in (0, 1))
    x[:] = generator.normal(size=N)
    tick, A, least = 0, 0.0, 0.0
    for k in range(40):
        y, w = generator.normal(size=(2, N))
        v[:] = generator.normal(size=N)
        e = y - x
        V = float(K @ e**2) / 2
        A = V if k == 0 else A
        needed = V + T / 4 * float(B @ w**2)
        s = 1.0 if needed <= max(A, 0.0) else np.sqrt(max(A, 0.0) / needed)
        position.push(tick, y, tick)
        rate.push(tick, w, tick)
        close(position.value(tick), x + s * e, 10)
        close(rate.value(tick), s * w, 10)
        close(tank.available, A, 1e3)
        least = min(least, A)
        steps, dx = int(generator.integers(1, 4)), 0.1 * generator.normal(size=N)
        if sampled:
            A -= float((s * (K * e + B * w) - B * v) @ dx)
        else:
            A += float(
                K @ (dx**2 / 2 - s * e * dx) + (B * dx) @ (dx / (steps * float(BASE)) - s * w)
            )
        x += dx
        tick += steps
    close(array(tank.least, 1)[0], least, 1e3)


# --- what is around a hold ----------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n, row in TABLE.items() if row.needs in (None, "power")])
@few
@given(seeds)
def test_samples_that_are_late_and_lost(name, seed):
    """As a hold that gets each of them when it has arrived."""
    generator = np.random.default_rng(seed)
    latency = Latency(min=0.001, max=0.02, loss=0.2, seed=5)
    benches = [Bench(2 * N, BASE) for _ in range(2)]
    late, plain = (
        bench.hold(
            name, N, latency=way,
            displacement=bench.reader(range(N)), velocity=bench.reader(range(N, 2 * N)),
        )
        for bench, way in zip(benches, (latency, None), strict=True)
    )  # fmt: skip
    way, tick, stamp = SampleLink(latency, BASE), 0, 0
    for k in range(60):
        sample = generator.normal(size=N)
        for bench in benches:
            bench.values[:] = np.sin(np.arange(2 * N) + 0.1 * tick)
        if k == 0 or generator.random() < 0.7:
            late.push(stamp, sample, tick)
            if k:
                way.send(stamp, sample, tick)
            else:
                plain.push(stamp, sample, tick)
        for arrival, sent, item in way.arrived(tick):
            plain.push(sent, item, arrival)
        for ahead in (0.0, 3.5):
            assert late.value(tick, ahead).tobytes() == plain.value(tick, ahead).tobytes()
        tick += int(generator.integers(0, 30))
        stamp = int(generator.integers(stamp, tick + 1)) if generator.random() < 0.8 else stamp
    counts = late.link.sent, late.link.lost, late.link.overtaken
    assert counts == (way.sent, way.lost, way.overtaken)


@pytest.mark.parametrize("turn", [2 * np.pi, 360.0, 400.0])
@few
@given(seeds)
def test_angles_are_unwrapped_as_numpy_does(turn, seed):
    """Each in the turn of its own unit: a walk in steps below half a turn."""
    generator = np.random.default_rng(seed)
    hold = Bench(base=BASE).hold("foh", 2, turns={0: 2 * np.pi, 1: turn})
    walk = np.cumsum(generator.uniform(-0.49, 0.49, size=30)) * turn
    seen = (walk + turn / 2) % turn - turn / 2
    straight = np.unwrap(seen, period=turn)
    for k, angle in enumerate(seen.tolist()):
        hold.push(10 * k, np.array([0.0, angle]), 10 * k)
        close(hold.value(10 * k)[1], straight[k], 1e3)
    beyond = hold.value(10 * k + 5)
    close(beyond[1], straight[-1] + (straight[-1] - straight[-2]) / 2, 1e3)
    assert beyond[0] == 0.0


MATRICES = [name for name, row in TABLE.items() if not row.needs and not row.gives_samples]


@pytest.mark.parametrize("matrix", ["projector", "semidefinite"])
@pytest.mark.parametrize("name", MATRICES)
@few
@given(seeds, st.integers(1, 6))
def test_matrices_are_those_of_lapack(name, matrix, seed, rows):
    """Of the same hold entry by entry: onto the eigenvectors of the largest eigenvalues, or without
    the negative ones in the scale of the newest sample."""
    generator = np.random.default_rng(seed)
    hold, plain = (Bench(base=BASE).hold(name, rows**2, matrix=kind) for kind in (matrix, None))
    rank = int(generator.integers(0, rows + 1))
    for k in range(8):
        root = generator.normal(size=(rows, rank)) * 10.0 ** generator.integers(-3, 4)
        root = np.linalg.qr(root)[0] if matrix == "projector" else root
        sample = root @ root.T
        for each in (hold, plain):
            each.push(10 * k, sample.ravel(), 10 * k)
        for ahead in (0.0, 4.5):
            x = plain.value(10 * k, ahead).reshape(rows, rows)
            scale = np.sqrt(np.abs(np.diag(sample)))
            scale = np.outer(*2 * [np.where(scale > 0, scale, 1.0)])
            if matrix == "projector":
                values, vectors = np.linalg.eigh((x + x.T) / 2)
                apart = np.diff(values)[rows - rank - 1] if 0 < rank < rows else 1.0
                expected, atol = (
                    vectors[:, rows - rank :] @ vectors[:, rows - rank :].T,
                    1e-12 / apart,
                )
            else:
                values, vectors = np.linalg.eigh((x + x.T) / (2 * scale))
                expected = (vectors * np.maximum(values, 0.0)) @ vectors.T * scale
                atol = 1e-12 * np.abs(x / scale).max() * scale.max()
            found = hold.value(10 * k, ahead).reshape(rows, rows)
            np.testing.assert_allclose(found, expected, rtol=0, atol=max(atol, 1e-12))


@given(st.integers(0, 2**32 - 1), st.integers(1, 10), st.integers(-12, 12))
def test_a_matrix_without_negative_eigenvalues_stays_as_it_is(seed, n, power):
    """Jacobi's method finds eigenvectors that are orthonormal and belong to their eigenvalues: of
    multiple ones and zeros, too."""
    generator = np.random.default_rng(seed)
    basis = np.linalg.qr(generator.normal(size=(n, n)))[0]
    eigenvalues = generator.choice([0.0, 1.0, 1.0, 3.0, abs(generator.normal())], n) * 10.0**power
    matrix = (basis * eigenvalues @ basis.T).ravel()
    hold = Bench().hold("zoh", n * n, matrix="semidefinite")
    hold.push(0, matrix, 0)
    assert np.abs(hold.value(0) - matrix).max() <= 1e-13 * max(np.abs(matrix).max(), 1e-300)


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_diagonal_projectors_stay_as_they_are(n):
    hold = Bench().hold("lead", n * n, matrix="projector")
    diagonal = np.diag(np.arange(n) % 2 == 0).astype(float).ravel()
    hold.push(0, diagonal, 0)
    assert hold.value(0).tobytes() == diagonal.tobytes()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", MATRICES)
def test_what_is_no_projector_has_a_rank_within_its_rows(name):
    """Of traces that are negative, or beyond the largest integer of C, or overflow."""
    generator, rows = np.random.default_rng(4), 3
    hold = Bench().hold(name, rows * rows, matrix="projector")
    for tick, scale in enumerate([1.0, 1e20, -1e20, 1e308, -1e308, 5e-324, 0.0, 7.0]):
        sample = scale * np.where(np.eye(rows) > 0, 1.0, generator.uniform(-1, 1, (rows, rows)))
        hold.push(9 * tick, sample.ravel(), 9 * tick)
        value = hold.value(9 * tick)
        if np.isfinite(value).all():
            assert 0 <= round(value[:: rows + 1].sum()) <= rows


LARGE = """
import ctypes, threading
import numpy as np
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.library import load
from tests.orchestrator.holds.bench import Bench

N = 100_000
bench = Bench(N)
bench.values[:] = np.arange(float(N))
hold = bench.hold("foh", N)
points = np.array([(0.25, 0.0), (0.75, 0.0)])
ops = (structures.Op * 2)(
    structures.Op(structures.PUSH), structures.Op(structures.BLEND, 0, 0, len(points))
)
bench.loop.fill(ops=ops, points=points, holds=(ctypes.c_void_p * 1)(hold.address))
at = structures.At(0, len(ops))
threading.stack_size(1 << 18)
addresses = ctypes.addressof(bench.loop), ctypes.addressof(at), 0
run = threading.Thread(target=load().block, args=addresses)
run.start()
run.join()
assert np.array_equal(hold.c.kept["held"], bench.values)
"""


def test_a_large_array_takes_no_place_on_the_stack():
    """Of 256 KB: that of a thread is 512 KB on macOS, and an FMU may have a million numbers."""
    subprocess.run([sys.executable, "-c", LARGE], check=True)
