"""One energy tank for both sides of a coupling: a handle and a body that move at random, samples
that are late and lost, wrapped angles. What the coupling gives to both sides is counted from the
forces and motions alone."""

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hapticlink.orchestrator.holds import HOLDS, HoldContext
from hapticlink.orchestrator.holds.energy_account import Account
from hapticlink.orchestrator.holds.energy_tank import EnergyTank, NearEnd
from hapticlink.orchestrator.holds.hold import Hold
from hapticlink.orchestrator.holds.holds_on_manifolds import Unwrapped
from hapticlink.orchestrator.run.make_holds import WithFurther
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.latency_and_loss import Late, SampleLink

Vector = NDArray[np.float64]
N, TICK, TURN = 3, 1e-3, 2 * np.pi


class Coupling:
    """A handle at every tick and a body at every `every`-th, coupled by F = K (y - x) + B (w - v),
    sampled: pose and velocity of the body are held by pspm, the force on it by passive. The last
    entry is an angle, which both ends read wrapped if `wrapped`."""

    def __init__(
        self, stiffness: Vector, damping: Vector, every: int, latency: Latency, wrapped: bool
    ) -> None:
        self.K, self.B, self.every, self.wrapped = stiffness, damping, every, wrapped
        self.x, self.v, self.y, self.w = (np.zeros(N) for _ in range(4))
        turns = np.array([0.0, 0.0, TURN * wrapped])
        near = NearEnd(
            lambda: self.read(self.x), turns, TICK, lambda t: t * TICK, lambda: self.v, True
        )
        self.tank = EnergyTank(stiffness, damping, near)
        far = HoldContext(N, lambda t: t * TICK, lambda: -self.y, lambda: -self.w)
        found = HOLDS["passive"](far)
        assert isinstance(found, Account)
        self.back, self.back.tank = found, self.tank
        self.credit = np.zeros(1)
        self.ends = [self._held(row, latency) for row in (0, 1)]
        self.near = self.far = 0.0
        self.surplus = self.unforeseen = self.beyond = self.most = 0.0
        self.force, self.effort = np.zeros(N), np.zeros(N)

    def _held(self, row: int, latency: Latency) -> Hold:
        def make() -> Hold:
            return HOLDS["pspm"](HoldContext(N, tank=(self.tank, row)))

        held = Unwrapped(make, [2], [TURN]) if self.wrapped and row == 0 else make()
        late = Late(held, SampleLink(latency, Fraction(1, 1000)))
        if row:
            return late
        return WithFurther(late, lambda: self.credit.copy(), (self.back, self.credit))

    def read(self, pose: Vector) -> Vector:
        wrapped = pose.copy()
        if self.wrapped:
            wrapped[2] -= TURN * np.round(wrapped[2] / TURN)
        return wrapped

    def tick(self, tick: int) -> None:
        """Sample, hold and couple; the force of this tick then acts until the next."""
        if tick % self.every == 0:
            self.ends[0].push(tick, self.read(self.y), tick)
            self.ends[1].push(tick, self.w, tick)
        y, w = (hold.value(tick).copy() for hold in self.ends)
        self.force = self.K * (y - self.read(self.x)) + self.B * (w - self.v)
        self.back.push(tick, self.force, tick)
        if tick % self.every == 0:
            self.effort = self.back.value(tick, self.every / 2).copy()

    def move(self, dx: Vector) -> None:
        """The handle's step, which the force acts over."""
        sampled = (self.K / 2 * dx + self.B * (dx / TICK - self.v)) * dx
        against = np.maximum(-self.B * self.v * dx, 0.0)
        self.surplus = max(self.surplus, float(sampled.sum()))
        self.unforeseen += float(against.sum()) * (self.tank.available < 0.0)
        self.near += float(self.force @ dx)
        self.x += dx

    def go(self, dy: Vector) -> None:
        """The body's step; beside the premise, its work is counted as unforeseen."""
        predicted, d = -self.back.predicted, np.abs(self.back.predicted)
        furthest = d + np.abs(self.back.predicted_steady)
        drawn = -self.effort * dy
        driven = -self.effort * predicted > 0.0
        right = np.where(driven, np.abs(dy) <= furthest, drawn <= 0.0)
        self.unforeseen += float(np.abs(drawn)[~right].sum())
        self.beyond += float(np.abs(drawn)[~right].sum())
        self.far += float(drawn.sum())
        self.y += dy

    def run(self, generator: np.random.Generator, ticks: int, against: float) -> float:
        """The largest net energy that the coupling gives, beyond the premises' share; the body goes
        `against` the prediction with that probability."""
        worst, step = 0.0, np.zeros(N)
        for tick in range(ticks):
            if tick % self.every == 0:
                self.go(step)
                self.w[:] = generator.normal(size=N) * 10 ** generator.uniform(-3, 1)
            net = self.near + self.far - self.start if tick else 0.0
            worst = max(worst, net - self.surplus - self.unforeseen)
            self.most = max(self.most, net)
            self.tick(tick)
            if tick == 0:
                self.start = float(self.K @ (self.y - self.x) ** 2) / 2
            if tick % self.every == 0:
                d = -self.back.predicted
                step = d * generator.choice([1.0, generator.uniform()])
                if generator.random() < against:
                    step = generator.normal(size=N) * np.abs(d).max()
            self.move(self.v * TICK * generator.choice([1.0, generator.uniform(-0.5, 2.0)]))
            self.v[:] = generator.normal(size=N) * 10 ** generator.uniform(-3, 1)
            if generator.random() < 0.3:  # pulled along or held back: what costs most
                self.v[:] = (
                    generator.choice([-1.0, 1.0]) * self.force * 10 ** generator.uniform(-3, 0)
                )
        return worst


@settings(max_examples=50, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 9),
    st.booleans(),
    st.sampled_from([0.0, 0.0, 0.2]),
    st.sampled_from([(0.0, 0.0, 0.0), (0.004, 0.004, 0.0), (0.0, 0.02, 0.3)]),
)
def test_the_coupling_gives_both_sides_no_more_than_it_got(seed, every, wrapped, against, link):
    """At every tick, beyond one step's sampling surplus and the unforeseen steps themselves; each
    of these is counted here, none is bounded by what the hold says."""
    generator = np.random.default_rng(seed)
    stiffness, damping = 10 ** generator.uniform(0, 3, N), 10 ** generator.uniform(-3, 1.3, N)
    latency = Latency(min=link[0], max=link[1], loss=link[2], seed=seed % 1000)
    coupling = Coupling(stiffness, damping, every, latency, wrapped)
    coupling.y[2] = np.pi - 0.01  # on the edge of its turn
    coupling.x[:] = coupling.y + generator.normal(size=N) * generator.choice([0.0, 0.1])
    worst = coupling.run(generator, 200, against)
    scale = abs(coupling.near) + abs(coupling.far)
    assert worst <= 1e-9 * (1.0 + scale)
    # What the run then reports: the steps beside the premise, and what the tank was short of.
    steps, outside, stake = coupling.back.premises
    assert stake <= coupling.beyond + 1e-9 * (1.0 + scale)
    assert outside <= steps <= N * 200
    assert coupling.most <= stake - coupling.tank.least[0] + 1e-9 * (1.0 + scale)
