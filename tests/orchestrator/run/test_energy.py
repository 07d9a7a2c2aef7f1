"""The energy of a held force: closed forms of a sampled spring, and where holds are refused."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run.energy.meter import ROWS, Meter

FORCE = "hand.F -> virtual_mechanism.F_hand"


@pytest.mark.parametrize("rate", [20, 64])
def test_a_sampled_spring_makes_half_k_dx_squared(tmp_path, rate):
    experiment = simulate("sampled-spring", tmp_path, [f"haptics.rate={rate}"])
    assert experiment.outcome.fault is None
    x = experiment.results.haptics["virtual_mechanism.x"][:, 0]
    run = experiment.results.run
    energy = run["energies_within_a_rate"][FORCE]
    assert run["energies"] == "none"
    assert energy["generated"] == pytest.approx(50.0 * np.sum(np.diff(x) ** 2), rel=1e-12)
    assert energy["ideal"] == pytest.approx(-50.0 * (x[-1] ** 2 - x[0] ** 2), rel=1e-12)
    # What the hold gave went into the mass, all of it.
    motion = experiment.results.haptics["virtual_mechanism.energy"]
    assert energy["held"] == pytest.approx(motion[-1] - motion[0], rel=1e-9)
    assert energy["until"] == 2.0


@settings(max_examples=25)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1), st.sampled_from([1.0, -1.0]))
def test_a_spring_renewed_more_rarely_than_the_target_steps(every, seed, sign):
    """1/2 K sum dx^2 over the renewals, on any path between them, and over folded rows."""
    path = np.cumsum(np.random.default_rng(seed).normal(size=(4 * ROWS + 1, 3)), axis=0)
    stiffness = np.array([100.0, 50.0, 2.0])
    source, held, x = np.zeros(3), np.zeros(3), np.zeros(3)
    meter = Meter(source.copy, held.copy, lambda: sign * x)
    for tick, place in enumerate(path):
        x[:] = place
        meter.move(tick)
        if tick % every == 0:
            source[:] = -sign * stiffness * place
            meter.sample(tick)
            held[:] = source
            last = tick
        meter.hold(1.0)
    steps = np.diff(path[: last + 1 : every], axis=0)
    made = (0.5 * stiffness * steps**2).sum()
    assert meter.energy(1.0).generated == pytest.approx(made, rel=1e-10)
    assert meter.energy(1.0).peak == pytest.approx(made, rel=1e-10)  # it only grows


@settings(max_examples=25)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_a_fast_spring_held_by_a_slow_target(every, seed):
    """The target moves in straight lines over `every` samples: it gets the newest only."""
    generator = np.random.default_rng(seed)
    frames = np.cumsum(generator.normal(size=2 * ROWS // every + 2))
    source, held, x = np.zeros(1), np.zeros(1), np.zeros(1)
    meter = Meter(source.copy, held.copy, x.copy)
    for n, (here, there) in enumerate(pairwise(frames)):
        x[:] = here
        meter.move(n * every)
        for k in range(every):
            source[:] = -(here + (there - here) * k / every)
            meter.sample(n * every + k)
            if k == 0:
                held[:] = source
                meter.hold(1.0)
    x[:], source[:] = frames[-1], -frames[-1]
    meter.move((len(frames) - 1) * every)
    meter.sample((len(frames) - 1) * every)
    made = (0.5 * np.diff(frames) ** 2).sum()
    assert meter.energy(1.0).generated == pytest.approx(made, rel=1e-10)


@pytest.mark.parametrize("between", [1, 2])
def test_a_constant_force_generates_nothing(between):
    """It does F dx, held or not, from the first sample to the last, between two of the target's
    steps, and over folded rows."""
    path = np.cumsum(np.random.default_rng(5).normal(size=3 * ROWS))
    force, x = np.array([3.0]), np.zeros(1)
    meter = Meter(force.copy, force.copy, x.copy)
    for n, place in enumerate(path):
        x[:] = place
        meter.move(3 * n)
        if not n:
            meter.sample(0)
        meter.hold(1.0)
        if n % 7 == 0:
            meter.sample(3 * n + between)
            last = n
    moved = path[last] + (path[last + 1] - path[last]) * between / 3 - path[0]
    energy = meter.energy(1.0)
    assert energy.ideal == pytest.approx(3.0 * moved, rel=1e-10)
    assert energy.held == pytest.approx(3.0 * moved, rel=1e-10)
    assert abs(energy.generated) < 1e-9


def test_a_passive_hold_takes_back_what_sampling_makes(tmp_path):
    made = {}
    for hold in ("zoh", "passive", "nepce"):
        run = simulate("sampled-spring", tmp_path, [f"holds.hand.F={hold}"]).results.run
        made[hold] = run["energies_within_a_rate"][FORCE]["generated"]
    assert made["zoh"] > 40
    assert made["passive"] < 0
    assert abs(made["nepce"]) < 0.01 * made["zoh"]


def test_power_across_rates_is_told_and_kept_in_check(tmp_path):
    forces = {FORCE, "controller.F_drift -> virtual_mechanism.F_drift"}
    made = {}
    for hold in ("zoh", "passive"):
        options = [f"hold={hold}", "graphics.rate=30"]
        run = simulate("closed-loop-direct", tmp_path, options).results.run
        assert set(run["power_across_rates"]) == set(run["energies"]) == forces
        made[hold] = sum(e["generated"] for e in run["energies"].values())
    assert {run["holds"][name] for name in forces} == {"passive"}
    refused = run["holds_that_did_not_fit"]["virtual_mechanism.x -> controller.x_S"]
    assert "not a declared power connection" in refused["reason"]
    assert made["zoh"] > 0.1
    assert made["passive"] < 0
