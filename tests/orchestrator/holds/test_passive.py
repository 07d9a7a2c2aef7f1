"""Holds that keep account of the energy that they make, on forces and motions without FMUs: what
they prove, what no hold can, and what they know where samples are late, against the meter, which
knows all."""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hapticlink.orchestrator.holds import HOLDS, HoldContext
from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.passive import Passive
from hapticlink.orchestrator.run.energy.meter import Meter
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.latency_and_loss import Late, SampleLink

Vector = NDArray[np.float64]


def account(name: str, forces: Vector, motion: Vector, every: int) -> Vector:
    """What a hold of forces renewed every so many ticks has made at each renewal (J)."""
    x = np.concatenate([[0.0], np.cumsum(motion)])
    now = np.zeros(1)
    hold = HOLDS[name](HoldContext(1, displacement=lambda: now))
    held, made, ideal = 0.0, [], 0.0
    for tick in range(len(x)):
        now[:] = x[tick]
        if tick % every == 0 and (n := tick // every) < len(forces):
            hold.push(tick, forces[n : n + 1], tick)
            if n:
                ideal += (forces[n - 1] + forces[n]) / 2 * (x[tick] - x[tick - every])
            made.append(held - ideal)
        if tick < len(motion):
            held += hold.value(tick)[0] * motion[tick]
    return np.array(made)


forces = st.lists(st.floats(-10, 10), min_size=4, max_size=40).map(np.array)


@settings(max_examples=50)
@given(forces, st.integers(1, 8), st.floats(1e-4, 1.0), st.booleans())
def test_passive_holds_leave_nothing_made_but_the_last_period(forces, every, speed, back):
    """Any force on a steady motion: what a period made is gone when the next has passed."""
    motion = np.full(every * len(forces), -speed if back else speed)
    first = np.concatenate([[0.0], -np.diff(forces) / 2 * motion[0] * every])  # zoh, a period
    tiny = 1e-12 * 10 * np.abs(motion).sum()
    assert np.allclose(account("zoh", forces, motion, every), np.cumsum(first), atol=tiny)
    assert np.all(account("passive", forces, motion, every) <= np.maximum(first, 0.0) + tiny)
    assert np.allclose(account("nepce", forces, motion, every), first, atol=tiny)
    rest = np.concatenate([forces, np.full(2, forces[-1])])
    motion = np.full(every * len(rest), motion[0])
    assert account("passive", rest, motion, every)[-1] <= tiny


@pytest.mark.parametrize("seed", range(2))
def test_passive_holds_make_next_to_nothing_of_random_smooth_signals(seed):
    """A spring on random motion, renewed every fifth tick: a tenth of what zero order makes."""
    generator = np.random.default_rng(seed)
    t = np.arange(4001)
    rates, phases = generator.uniform(0.005, 0.05, 8), generator.uniform(0, 6.28, 8)
    x = np.sin(np.outer(t, rates) + phases).sum(axis=1)
    spring = -100.0 * (x[::5] - x[0])
    made = {n: account(n, spring, np.diff(x), 5)[-1] for n in ("zoh", "passive", "nepce")}
    assert made["zoh"] > 0
    assert made["passive"] < 0.1 * made["zoh"]
    assert abs(made["nepce"]) < 0.1 * made["zoh"]


@pytest.mark.parametrize(("reversals", "apart"), [(0, 1), (1, 1), (8, 1), (60, 3)])
def test_a_step_back_by_a_nanometre_costs_next_to_nothing(reversals, apart):
    """A spring of 1000 N/m on a steady motion, renewed every fifth tick; some steps go back by 1
    nm. What these make is theirs, (R + C) |dx|, and not that of the steps after them."""
    steps = np.full(400, 1e-4)
    steps[50 : 50 + apart * reversals : apart] = -1e-9
    made, swing = {}, 0.0
    for name in ("zoh", "passive"):
        now = np.zeros(1)
        context = HoldContext(1, displacement=lambda at=now: at, velocity=lambda: np.full(1, 1e-4))
        hold = HOLDS[name](context)
        work = ideal = peak = force = at_sample = 0.0
        for tick, step in enumerate(steps):
            if tick % 5 == 0:
                fresh = -1000.0 * float(now[0])
                ideal += (force + fresh) / 2 * (float(now[0]) - at_sample)
                force, at_sample = fresh, float(now[0])
                hold.push(tick, np.array([fresh]), tick)
                peak = max(peak, work - ideal)
            held = float(hold.value(tick, 0.5)[0])
            work += held * step
            now[:] += step
            swing = max(swing, abs(held))
        made[name] = peak
    first = 0.5 * 1000.0 * (5e-4) ** 2  # while no swing is known
    assert made["zoh"] > 50 * first
    assert made["passive"] <= first + reversals * 2 * swing * 1e-9


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_what_passive_makes_is_at_stake_or_the_first_of_a_swing(seed, every):
    """Forces of any size on a motion of any steps, half of them not as predicted: the energy made
    at any renewal is at most what the hold says is at stake and, where a force differs more from
    the one before than any did, that difference times the distance until it is known."""
    generator = np.random.default_rng(seed)
    now, v = np.zeros(1), np.zeros(1)
    hold = HOLDS["passive"](HoldContext(1, displacement=lambda: now, velocity=lambda: v))
    work = ideal = swing = allowed = force = begun = way = 0.0
    for tick in range(200):
        if tick % every == 0:
            fresh = float(generator.normal()) * 10 ** generator.uniform(-2, 2)
            if tick:
                ideal += (force + fresh) / 2 * (float(now[0]) - begun)
                more = abs(fresh - force) / 2 - swing
                allowed += max(more, 0.0) * way
                swing = max(swing, abs(fresh - force) / 2)
            hold.push(tick, np.array([fresh]), tick)
            force, begun, way = fresh, float(now[0]), 0.0
            _ = hold.value(tick, 0.5)
            stake = hold.premises[2]
            assert work - ideal <= allowed + stake + 1e-9 * (1.0 + abs(work) + abs(ideal))
        held = float(hold.value(tick, 0.5)[0])
        step = float(v[0])
        if generator.random() < 0.5:
            step = float(generator.normal()) * 10 ** generator.uniform(-3, 0)
        work += held * step
        way += abs(step)
        now[0] += step
        v[:] = generator.normal() * 10 ** generator.uniform(-3, 0)


# --- samples that are late ----------------------------------------------------------------

LARGEST = 5.0
SWING = 2 * LARGEST
"""The most by which a mean of forces within +-LARGEST can leave one of them."""


@dataclass
class Told:
    """A hold, and a meter that is told no more than the hold."""

    hold: Account
    sample: Vector = field(default_factory=lambda: np.zeros(1))
    meter: Meter | None = None

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self.sample[:] = sample
        if self.meter:
            self.meter.sample(stamp)
        self.hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.hold.value(tick, ahead)


@dataclass
class Line:
    """A force sampled every so many ticks, held behind a link by a target that steps every so many
    ticks and is straight between: `truth` is told every sample, `told` those that arrived."""

    name: str
    latency: Latency
    every: int
    step: int

    def __post_init__(self) -> None:
        self.x, self.v, self.force, self.held = (np.zeros(1) for _ in range(4))
        hold = HOLDS[self.name](
            HoldContext(1, displacement=lambda: self.x, velocity=lambda: self.v)
        )
        assert isinstance(hold, Account)
        self.hold = hold
        arrived = Told(hold)
        self.late = Late(arrived, SampleLink(self.latency, Fraction(1)))
        self.truth, self.told = (
            Meter(source.copy, self.held.copy, self.x.copy)
            for source in (self.force, arrived.sample)
        )
        arrived.meter = self.told

    def run(
        self, ticks: int, force: Callable[[], float], go: Callable[[int], float], begin: int = 0
    ) -> None:
        """`go` sets v, and gives the displacement of the step to come when the force is held."""
        moved = 0.0
        for tick in range(begin, begin + ticks):
            stands = (tick - begin) % self.step == 0
            if stands:
                self.x += moved
                self.truth.move(tick)
                self.told.move(tick)
            if (tick - begin) % self.every == 0:
                self.force[:] = force()
                self.truth.sample(tick)
                self.late.push(tick, self.force, tick)
            if stands:
                moved = go(tick)
                self.truth.hold(1.0)
                self.told.hold(1.0)


@pytest.mark.parametrize("name", ["passive", "nepce"])
@settings(max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 9),
    st.integers(1, 9),
    st.floats(0, 40),
    st.floats(0, 40),
    st.floats(0, 0.5),
)
def test_its_account_is_the_meters(name, seed, every, step, least, spread, loss):
    """Any latencies and losses, random forces and motions, then a rest until all has arrived: the
    hold has booked what a meter of the samples that it got does; and where none is lost and none
    overtaken, that is all."""
    generator = np.random.default_rng(seed)
    latency = Latency(min=least, max=least + spread, loss=loss, seed=seed % 1000)
    line = Line(name, latency, every, step)

    def go(tick):
        moves = tick < 200
        line.v[:] = generator.normal() * moves
        line.held[:] = line.late.value(tick, step / 2)
        return float(generator.normal()) * step * moves

    line.run(500, lambda: generator.uniform(-LARGEST, LARGEST), go)
    made, scale = float(line.hold.generated.sum()), 5.0 * 200
    assert made == pytest.approx(line.told.energy(1.0).generated, abs=1e-12 * scale)
    link = line.late.link
    if not link.lost and not link.overtaken:
        assert made == pytest.approx(line.truth.energy(1.0).generated, abs=1e-12 * scale)


def path_over(xs: list[float], steps: int) -> float:
    """The longest way in so many steps."""
    ways = np.concatenate([[0.0], np.abs(np.diff(xs)).cumsum()])
    ahead = ways[np.minimum(np.arange(len(ways)) + steps, len(ways) - 1)]
    return float((ahead - ways).max())


rates = st.sampled_from([(1, 1), (5, 1), (1, 5), (3, 2), (2, 7)])


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), rates, st.none() | st.integers(0, 30), st.booleans())
def test_passive_makes_nothing_where_the_way_is_foreseen(seed, rates, least, known):
    """The theorem, its premise reaching over the latency: random forces and speeds, no latency, for
    which half the swing suffices, or ones that vary without overtaking. Where no swing as large was
    seen before, what is made stays below the swing's on the way from a stamp to the step in which
    it is known."""
    generator = np.random.default_rng(seed)
    every, step = rates
    late = (0, 0) if least is None else (least, least + every - 1)
    line = Line("passive", Latency(min=late[0], max=late[1], seed=seed % 1000), every, step)
    begin = 100
    swing = SWING / 2 if least is None and every % step == 0 else SWING
    if known:
        line.hold.push(0, np.array([-swing]), 0)
        line.hold.value(0)
        line.hold.push(begin // 2, np.array([swing]), begin // 2)
        line.hold.value(begin // 2)
    xs = []

    def go(tick):
        xs.append(float(line.x[0]))
        before = float(line.v[0])
        line.v[:] = generator.normal()
        line.held[:] = line.late.value(tick, step / 2)
        gained = float(line.v[0]) - before if known or tick > begin else 0.0
        share = generator.choice([1.0, generator.uniform(0.0, 1.0)])
        return float(share * (line.v[0] + gained / 2) * step)

    def force():
        return float(generator.choice([-LARGEST, LARGEST, generator.uniform(-LARGEST, LARGEST)]))

    line.run(250, force, go, begin)
    window = -(-(late[0] + 2 * every) // step) + 2
    limit = 0.0 if known else SWING * path_over(xs, window)
    assert line.truth.energy(1.0).peak <= limit + 1e-9


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), rates, st.integers(0, 30), st.booleans())
def test_what_passive_makes_of_white_noise_is_bounded(seed, rates, least, known):
    """White forces on white motions, foreseen or not: beside the swing's first time, only steps
    that go against what was foreseen, or further, make anything, each at most (R + C) |dx|, and
    those while it is not trusted again (1 - beta) C |dx|: R the largest swing, C the friction."""
    generator = np.random.default_rng(seed)
    every, step = rates
    line = Line("passive", Latency(min=least, max=least + every - 1, seed=seed % 1000), every, step)
    hold, xs, allowed = line.hold, [], 0.0
    assert isinstance(hold, Passive)

    def go(tick):
        nonlocal allowed
        xs.append(float(line.x[0]))
        line.v[:] = generator.normal()
        line.held[:] = line.late.value(tick, step / 2)
        way = (float(line.v[0]) if known else 0.0) + generator.normal() * generator.choice([0.1, 1])
        moved, ahead = way * step, float(hold.predicted[0])
        limit = abs(ahead) + abs(float(hold.predicted_steady[0]))
        foreseen = moved * ahead > 0 and abs(moved) <= limit
        allowed += ((1.0 - hold.beta[0]) if foreseen else 2.0) * SWING * abs(moved)
        return moved

    line.run(250, lambda: generator.uniform(-LARGEST, LARGEST), go)
    window = -(-(least + 2 * every) // step) + 2
    assert line.truth.energy(1.0).peak <= SWING * path_over(xs, window) + allowed
