"""Holds that keep account of the energy that they make: what they prove, on forces and motions
without FMUs, and what no hold can."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hapticlink.orchestrator.holds import HOLDS, HoldContext

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


@pytest.mark.parametrize("seed", range(5))
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
