"""The energy of a held force: closed forms of a sampled spring, whatever its units, factors and the
order of its outputs, and where holds are refused."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.run.energy.meter import ROWS
from tests.little_fmus import entries, slave, with_units
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.holds.bench import Bench

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
    bench = Bench(9)
    source, held, x = bench.values.reshape(3, 3)
    meter = bench.meter(range(3), range(3, 6), bench.reader(range(6, 9), sign))
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
    bench = Bench(3)
    source, held, x = bench.values.reshape(3, 1)
    meter = bench.meter([0], [1], bench.reader([2]))
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
    bench = Bench(2)
    bench.values[0] = 3.0
    x, meter = bench.values[1:], bench.meter([0], [0], bench.reader([1]))
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


# --- numbers that are converted on the way, or stand apart on the board --------------------

STIFFNESS = np.array([300.0, 50.0])
"""N/m, along x[1] and x[2]."""


def path(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way that Moves goes (m)."""
    return np.stack([0.02 * np.sin(9 * t), 0.03 * (np.cos(7 * t) - 1)], axis=1)


def fmus(folder: Path, length: str = "m", force: str = "N", sign: int = -1) -> None:
    """Moves goes its way in `length` and takes efforts in `force`; Spring takes m and gives N. Of
    each, what is put out stands apart in the file, or not in order."""
    scale = {"m": 1.0, "mm": 1e3}[length]
    way = f"""values["x[1]"] = {scale} * .02 * sin(9 * end)
        values["x[2]"] = {scale} * .03 * (cos(7 * end) - 1)"""
    x = {"x[1]": 0.0, "z": 7.0, "x[2]": 0.0}
    moves = slave(folder, "Moves", ("input", entries("f", 2)), ("output", x), body=way)
    with_units(moves, **entries("f", 2, force), **entries("x", 2, length))
    pull = "\n        ".join(
        f"values['F[{i}]'] = {sign * k} * values['d[{i}]']" for i, k in enumerate(STIFFNESS, 1)
    )
    f = {"F[2]": 0.0, "e": 7.0, "F[1]": 0.0}
    spring = slave(folder, "Spring", ("input", entries("d", 2)), ("output", f), body=pull)
    with_units(spring, **entries("d", 2, "m"), **entries("F", 2, "N"))


FMUS = (
    fmu_table("moves", "Moves")
    + fmu_table("spring", "Spring", 'timing = "sampled"\n')
    + '[[power]]\neffort = "moves.f"\ndisplacement = "moves.x"\n'
)
BACK = wire_table("moves.x[{0}]", "spring.d[{0}]")
PULL = wire_table("spring.F[{0}]", "moves.f[{0}]")


def run(folder: Path, how: str = "", head: str = "") -> Experiment:
    text = head + FMUS + "".join(BACK.format(i) + PULL.format(i) + how for i in (1, 2))
    experiment = simulate(str(scene(folder, text)), folder / "out")
    assert experiment.outcome.fault is None
    return experiment


def energies(experiment: Experiment) -> dict[str, NDArray[np.float64]]:
    """made, held and ideal (J) of both entries."""
    found = experiment.results.run["energies_within_a_rate"]
    rows = [found[f"spring.F[{i}] -> moves.f[{i}]"] for i in (1, 2)]
    return {key: np.array([row[key] for row in rows]) for key in ("generated", "held", "ideal")}


@pytest.mark.parametrize("length", ["m", "mm"])
@pytest.mark.parametrize("force", ["N", "kN"])
@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (-2.5, 0.0), (0.5, 0.004)])
def test_a_sampled_spring_through_conversions(tmp_path, length, force, factor, offset):
    fmus(tmp_path, length, force)
    found = energies(run(tmp_path, f"factor = {factor}\noffset = {offset}\n"))
    stiffness, push = factor * STIFFNESS, offset * {"N": 1.0, "kN": 1e3}[force]
    x = path(np.arange(33) / 64)
    gone = x[-1] - x[0]
    made = 0.5 * stiffness * np.sum(np.diff(x, axis=0) ** 2, axis=0)
    ideal = -0.5 * stiffness * (x[-1] ** 2 - x[0] ** 2) + push * gone
    np.testing.assert_allclose(found["generated"], made, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found["ideal"], ideal, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found["held"], made + ideal, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("hold", ["passive", "nepce"])
def test_holds_that_keep_account_do_so_in_the_units_of_the_target(tmp_path, hold):
    head = f'holds."spring.F[1]" = "{hold}"\nholds."spring.F[2]" = "{hold}"\n'
    fmus(tmp_path)
    plain = energies(run(tmp_path, head=head))
    fmus(tmp_path, "mm", "kN", sign=1)
    turned = energies(run(tmp_path, "factor = -1.0\n", head))
    for key, value in plain.items():
        np.testing.assert_allclose(turned[key], value, rtol=1e-9)
    fmus(tmp_path)
    assert (plain["generated"] < 0.2 * energies(run(tmp_path))["generated"]).all()


def test_a_vector_whose_entries_stand_apart_is_booked_as_one(tmp_path):
    fmus(tmp_path, "mm", "kN")
    one_by_one = energies(run(tmp_path))
    text = FMUS + (BACK + PULL).replace("[{0}]", "")
    experiment = simulate(str(scene(tmp_path, text)), tmp_path / "whole")
    found = experiment.results.run["energies_within_a_rate"]["spring.F -> moves.f"]
    for key, values in one_by_one.items():
        assert found[key] == pytest.approx(values.sum(), rel=1e-12)


PRETENSIONED = """
title = "A pretensioned drawer pushes the hand"
duration = 2.0
haptics.rate = 512
graphics.rate = 30
device = {}
controller.bias = "full"
[linkage]
operational_point = { body = "drawer" }
body = [{ name = "drawer", mass = 0.5, inertia = 1e-4 }]
[[linkage.joint]]
name = "rail"
type = "prismatic"
child = "drawer"
axis = 0.0
stiffness = 200.0
rest = 0.03
[hand]
type = "spring"
stiffness = [300, 300, 0]
damping = [10, 10, 0]
target = [[0, 0, 0, 0]]
"""


def test_what_a_spring_of_the_mechanism_gives_back_is_counted(tmp_path):
    """It gives the hand 58 mJ; sampling and holding generate 2."""
    (tmp_path / "scene.toml").write_text(PRETENSIONED)
    run = simulate(tmp_path / "scene.toml", tmp_path / "out").results
    energy = run.haptics["virtual_mechanism.energy"]
    generated = sum(e.generated for e in run.record.meters.values())
    assert energy[0] == pytest.approx(0.5 * 200 * 0.03**2)
    assert 1e-3 < generated < energy[0] - energy[-1]
    assert run.record.unstable == ""
