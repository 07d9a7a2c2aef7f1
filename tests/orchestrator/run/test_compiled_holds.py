"""Each hold in C returns the bits of its Python class, whatever it is given; those of matrices
agree to rounding, since Python takes the eigenvectors of LAPACK."""

import ctypes
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.holds import HOLDS, HoldContext
from hapticlink.orchestrator.holds.energy_tank import EnergyTank, NearEnd
from hapticlink.orchestrator.holds.hold import Hold
from hapticlink.orchestrator.holds.holds_on_manifolds import Projector, Semidefinite, Unwrapped
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import (
    KINDS,
    CompiledHold,
    compiled_tank,
    parts,
)
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.energy.bonds import Reader
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.latency_and_loss import Late, SampleLink

NUMERATOR, DENOMINATOR = 3, 7680
SIZE = 3
NAMES = [*HOLDS.names(lambda kind: kind in KINDS)]


class Signals:
    """As many as a hold reads: samples with their derivatives, positions, velocities."""

    def __init__(self) -> None:
        self.values = np.zeros(4 * SIZE)


def seconds(ticks: float) -> float:
    return ticks * NUMERATOR / DENOMINATOR


def delayed(hold: Hold) -> Late:
    latency = Latency(min=0.001, max=0.02, loss=0.2, seed=5)
    return Late(hold, SampleLink(latency, Fraction(NUMERATOR, DENOMINATOR)))


class Twins:
    """The hold that `make` gives, of so many entries in samples of a width, and the same in C."""

    def __init__(
        self, make: Callable[[], Hold], size: int, width: int = 0, signals: Signals | None = None
    ) -> None:
        self.python, own = make(), make()
        self._values = signals.values if signals else np.zeros(size)
        self._loop = structures.Loop(
            values=self._values.ctypes.data, numerator=NUMERATOR, denominator=DENOMINATOR
        )
        tank = getattr(parts(own).own, "tank", None)
        shared, places = compiled_tank(tank) if tank else None, range(width or size)
        loop = ctypes.addressof(self._loop)
        self.compiled = CompiledHold(load(), loop, own, places, np.zeros(size), shared)
        self.holds = self.python, self.compiled

    def same(self, tick: int, ahead: float) -> bool:
        """To the bit."""
        expected = np.array(self.python.value(tick, ahead), copy=True)
        return self.compiled.value(tick, ahead).tobytes() == expected.tobytes()


def made(name: str, wrapped: str, moves: bool, signals: Signals) -> Hold:
    """moves: whether the target has its velocity as an output."""
    position, velocity = ([*range(i * SIZE, (i + 1) * SIZE)] for i in (2, 3))
    reader = Reader(signals, position, np.ones(SIZE))
    turns, sampled = np.array([0.0, 0.0, 2 * np.pi * (wrapped == "angle")]), wrapped == "late"
    near = NearEnd(reader, turns, 0.02, seconds, reader if moves else None, sampled)
    tank = EnergyTank(np.array([40.0, 3.0, 7.0]), np.full(SIZE, 0.5), near)
    needed = (tank, 0) if HOLDS[name].needs == "spring" else None
    x, v = (Reader(signals, at, np.array([2.0, -1.0, 0.5])) for at in (position, velocity))
    context = HoldContext(SIZE, seconds, x, v if moves else None, needed)
    if wrapped == "angle":
        return Unwrapped(lambda: HOLDS[name](context), [0, 2], [2 * np.pi, 360.0])
    return delayed(HOLDS[name](context)) if wrapped == "late" else HOLDS[name](context)


def _counted(hold: Hold) -> list[float]:
    """What a hold has counted outside its premises, and its tank beyond what it had."""
    own = hold.own if isinstance(hold, CompiledHold) else parts(hold).own
    tank = getattr(own, "tank", None)
    return [*getattr(own, "premises", ()), *(tank.least if tank else ())]


@pytest.mark.parametrize("wrapped", ["", "angle", "late"])
@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_holds_in_c_are_those_in_python(name, wrapped, seed):
    generator = np.random.default_rng(seed)
    signals, moves = Signals(), bool(generator.integers(2))
    width = SIZE * (1 + (HOLDS[name].needs in ("derivative", "integral")))
    pair = Twins(lambda: made(name, wrapped, moves, signals), SIZE, width, signals)
    tick, stamp = 0, 0
    for step in range(60):
        sample = generator.normal(size=width) * 10.0 ** generator.integers(-3, 4)
        signals.values[2 * SIZE :] = generator.normal(size=2 * SIZE)
        if step == 0 or generator.random() < 0.7:
            for hold in pair.holds:
                hold.push(stamp, sample, tick)
        for ahead in (0.0, float(generator.integers(1, 40)) / 2):
            assert pair.same(tick, ahead)
        tick += int(generator.integers(0, 30))
        stamp = int(generator.integers(stamp, tick + 1)) if generator.random() < 0.8 else stamp
    assert _counted(pair.compiled) == _counted(pair.python)
    if wrapped == "late":
        ways = [hold.link for hold in pair.holds]
        counts = [(way.sent, way.lost, way.overtaken) for way in ways]
        assert counts[0] == counts[1]


@pytest.mark.parametrize("size", [1, 2])
@pytest.mark.parametrize("name", [name for name in NAMES if HOLDS[name].needs == "power"])
def test_a_long_path_is_added_up_in_the_same_order(name, size):
    """Of one entry NumPy adds eight numbers or more in an order of its own. 20 steps of the target
    for each sample, which comes 13 of them late; the force works against a motion at about 1 m/s,
    so that the friction is within its limits."""
    generator, signals = np.random.default_rng(1), Signals()
    readers = (Reader(signals, [*range(i, i + size)], np.ones(size)) for i in (SIZE, 2 * SIZE))
    context = HoldContext(size, seconds, *readers)
    pair = Twins(lambda: HOLDS[name](context), size, signals=signals)
    for tick in range(400):
        speed = 1.0 + 0.1 * generator.normal(size=SIZE)
        signals.values[SIZE : 2 * SIZE] += speed * seconds(1)
        signals.values[2 * SIZE : 3 * SIZE] = speed
        if tick % 20 == 0:
            sample = -3.0 + np.cos(tick) + np.zeros(size)
            for hold in pair.holds:
                hold.push(max(tick - 13, 0), sample, tick)
        assert pair.same(tick, 0.5)


MATRICES = [*HOLDS.names(lambda kind: kind in KINDS and not kind.needs and not kind.gives_samples)]


def matrices(
    wrap: type[Projector | Semidefinite], name: str, rows: int, late: bool = False
) -> Twins:
    """Holds of matrices."""
    size = rows * rows

    def make() -> Hold:
        hold = wrap(lambda: HOLDS[name](HoldContext(size, seconds)), size)
        return delayed(hold) if late else hold

    return Twins(make, size)


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("wrap", [Projector, Semidefinite])
@pytest.mark.parametrize("name", MATRICES)
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_holds_of_matrices_in_c_are_those_in_python(name, wrap, late, seed, rows):
    """To the rounding errors of the matrix whose eigenvalues are taken. A projector has more of
    them the closer the smallest eigenvalue that it keeps is to the largest that it drops."""
    generator = np.random.default_rng(seed)
    pair = matrices(wrap, name, rows, late)
    python = parts(pair.python).matrix
    tick, rank = 0, rows

    def compare(tick, ahead):
        expected, found = (np.array(hold.value(tick, ahead)) for hold in pair.holds)
        atol = 1e-8
        if isinstance(python, Semidefinite):
            outer = np.outer(python._scale, python._scale).ravel()
            atol = 1e-12 * np.abs(python.hold.value(tick, ahead) / outer).max() * outer.max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol)

    for _ in range(40):
        if generator.random() < 0.2:
            rank = int(generator.integers(0, rows + 1))
        root = generator.normal(size=(rows, rank)) * 10.0 ** generator.integers(-3, 4)
        sample = root @ root.T
        if wrap is Projector:
            basis = np.linalg.qr(root)[0]
            sample = basis @ basis.T
        for hold in pair.holds:
            hold.push(tick, sample.ravel(), tick)
        for ahead in (0.0, float(generator.integers(1, 40)) / 2):
            compare(tick, ahead)
        tick += int(generator.integers(0, 30))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 10), st.integers(-12, 12))
def test_a_matrix_without_negative_eigenvalues_stays_as_it_is(seed, n, power):
    """Jacobi's method finds eigenvectors that are orthonormal and belong to their eigenvalues: of
    multiple ones and zeros, too."""
    generator = np.random.default_rng(seed)
    basis = np.linalg.qr(generator.normal(size=(n, n)))[0]
    eigenvalues = generator.choice([0.0, 1.0, 1.0, 3.0, abs(generator.normal())], n) * 10.0**power
    matrix = (basis * eigenvalues @ basis.T).ravel()
    pair = matrices(Semidefinite, "zoh", n)
    pair.compiled.push(0, matrix, 0)
    assert np.abs(pair.compiled.value(0) - matrix).max() <= 1e-13 * max(
        np.abs(matrix).max(), 1e-300
    )


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_diagonal_projectors_stay_as_they_are(n):
    pair = matrices(Projector, "lead", n)
    diagonal = np.diag(np.arange(n) % 2 == 0).astype(float).ravel()
    pair.compiled.push(0, diagonal, 0)
    assert pair.compiled.value(0).tobytes() == diagonal.tobytes()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", MATRICES)
def test_what_is_no_projector_has_a_rank_within_its_rows(name):
    """Of traces that are negative, or beyond the largest integer of C, or overflow."""
    generator, rows = np.random.default_rng(4), 3
    pair = matrices(Projector, name, rows)
    for tick, scale in enumerate([1.0, 1e20, -1e20, 1e308, -1e308, 5e-324, 0.0, 7.0]):
        sample = scale * np.where(np.eye(rows) > 0, 1.0, generator.uniform(-1, 1, (rows, rows)))
        ranks = []
        for hold in pair.holds:
            hold.push(9 * tick, sample.ravel(), 9 * tick)
            value = hold.value(9 * tick)
            ranks.append(round(value[:: rows + 1].sum()) if np.isfinite(value).all() else None)
        assert ranks[0] in (None, ranks[1])
        assert ranks[1] is None or 0 <= ranks[1] <= rows


LARGE = """
import ctypes, threading
import numpy as np
from hapticlink.orchestrator.holds import HOLDS, HoldContext
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.library import load

N = 100_000
values, held = np.arange(float(N)), np.zeros(N)
points = np.array([(0.25, 0.0), (0.75, 0.0)])
ops = (structures.Op * 2)(
    structures.Op(structures.PUSH), structures.Op(structures.BLEND, 0, 0, len(points))
)
loop = structures.Loop(values=values.ctypes.data, ops=ctypes.addressof(ops))
hold = HOLDS["foh"](HoldContext(N, float))
compiled = CompiledHold(load(), ctypes.addressof(loop), hold, range(N), held)
holds = (ctypes.c_void_p * 1)(compiled.address)
loop.holds, loop.points = ctypes.addressof(holds), points.ctypes.data
at = structures.At(0, len(ops))
threading.stack_size(1 << 18)
run = threading.Thread(target=load().block, args=(ctypes.addressof(loop), ctypes.addressof(at), 0))
run.start()
run.join()
assert np.array_equal(held, values)
"""


def test_a_large_array_takes_no_place_on_the_stack():
    """Of 256 KB: that of a thread is 512 KB on macOS, and an FMU may have a million numbers."""
    subprocess.run([sys.executable, "-c", LARGE], check=True)
