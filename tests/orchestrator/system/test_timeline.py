"""Rates of every FMU: exact ticks, shared clocks, stamps on real FMUs, SSP, faults."""

import math
import re
from fractions import Fraction
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import uses
from hapticlink.orchestrator.results.run_results import RunResults
from hapticlink.orchestrator.run.execute_plan import run
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.system.timeline import clocks, timeline
from tests.little_fmus import edited, python_fmu
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.timelines import CAUSAL, LOOP, fixed, scene_of, scenes, varying


@given(scenes())
def test_every_fmu_steps_at_the_times_that_its_rate_and_phase_say(scene):
    """Those that step together share a clock."""
    time, pace = timeline(scene), {}
    haptic = 1 / exact(scene.haptics.rate)
    for fmu in scene.fmu:
        at = [start * time.base for start in time.clock(time.of[fmu.name]).starts]
        assert at[0] == 0
        assert at[-1] > time.end * time.base
        if isinstance(fmu.rate, VariableRate):
            assert all(Fraction(1, 60) <= b - a <= Fraction(1, 10) for a, b in pairwise(at))
            assert all(t % haptic == 0 for t in at)
        elif isinstance(fmu.rate, tuple):
            times = [math.ceil(exact(t) / haptic) * haptic for t in fmu.rate]
            assert at[1:-1] == times
        else:
            period = haptic if fmu.rate == "haptics" else 1 / exact(fmu.rate)
            first = exact(scene.phases.get(fmu.name, str(period)))
            assert at[1:] == [first + k * period for k in range(len(at) - 1)]
            pace[fmu.name] = period, first
        pace.setdefault(fmu.name, fmu.rate)
    of = clocks(scene).of
    for a, b in combinations(LOOP, 2):
        assert (of[a] == of[b]) == (pace[a] == pace[b])
    assert all(re.fullmatch(r"[\w.+-]+", clock.name) for clock in time.clocks)


RATES = dict.fromkeys(("device", "controller"), "haptics") | {
    "mechanism": "1000/3", "hand": VariableRate(min=10, max=60, seed=5), "graphics": 30,
}  # fmt: skip
SHARES = {"controller": Fraction(1, 4), "mechanism": Fraction(2, 3), "graphics": Fraction(1, 7)}
TIMELINES = {
    "60": fixed(Fraction(512), Fraction(60), 256),
    "24 on ticks": fixed(Fraction(512), Fraction(24), 256, "tick"),
    "variable": varying(Fraction(512), Fraction(10), Fraction(60), 7, 256),
    "five clocks": timeline(scene_of(Fraction(512), 200, RATES, SHARES)),
}


@pytest.mark.parametrize("coupling", CAUSAL)
@pytest.mark.parametrize("name", TIMELINES)
def test_what_the_plan_says_is_what_the_fmus_see(stamped, name, coupling):
    """What it may say is in plan/test_plan.py."""
    time = TIMELINES[name]
    system = stamped(time, coupling)
    results = RunResults()
    assert run(Plan(system), results).fault is None
    tables = results.tables()
    assert len(tables) == (5 if name == "five clocks" else 2)
    said = list(uses(Plan(system)))
    for c in system.connections:
        seen = tables[system.fmu[c.target].clock][f"{c.target}.seen_{c.target_port}"]
        stamps = [time.seconds(use.described) for use in said if use.connection == c.name]
        if not system.fmu[c.target].sampled:  # a row holds what the step that ends there has read
            stamps = [0.0, *stamps]
        np.testing.assert_allclose(seen, stamps, rtol=0, atol=1e-12)
    for clock in time.clocks:
        at = [time.seconds(start) for start in clock.starts if start <= time.end]
        np.testing.assert_array_equal(tables[clock.name]["time"], at)
    np.testing.assert_array_equal(tables["haptics"]["device.stamp"], tables["haptics"]["time"])


def pair(folder: Path, gives: str, takes: str) -> Path:
    """A scene of two FMUs with these rates: the one puts out its time, which the other takes."""
    python_fmu(folder, "Gives")
    python_fmu(folder, "Takes", "self.y = self.u")
    text = fmu_table("gives", "Gives", f"rate = {gives}\n")
    text += fmu_table("takes", "Takes", f"rate = {takes}\n")
    return scene(folder, text + wire_table("gives.y", "takes.u"))


def test_rates_of_an_fmu_are_what_graphics_takes(tmp_path):
    (tmp_path / "stamps.csv").write_text("time\n7.00\n7.10\n7.26\n7.50")
    path = pair(tmp_path, '{ trace = "stamps.csv" }', "{ min = 8, max = 32, seed = 3 }")
    ended = simulate(str(path), tmp_path / "out")
    assert ended.outcome.fault is None
    found = ended.results
    given = found.tables["times_of_gives"]["time"]
    np.testing.assert_array_equal(given, np.array([0, 7, 17, 32]) / 64)
    taken = found.tables["8to32hz_seed3"]["time"]
    assert len(taken) > 4
    assert set(np.diff(taken) * 64) <= set(range(2, 9))
    assert found.run["seeds"]["fmu.takes.rate"] == 3
    assert found.run["scene"]["fmu"][0]["rate"] == [0.1, 0.26, 0.5]
    # Each step of `takes` has had the newest frame of `gives`.
    seen = found.tables["8to32hz_seed3"]["takes.y"][1:]
    newest = given[np.searchsorted(given, taken[:-1], side="right") - 1]
    np.testing.assert_array_equal(seen, newest)
    by_list = simulate(str(path), tmp_path / "again", ["fmu.gives.rate=[0.1, 0.26, 0.5]"])
    assert by_list.results.tables.keys() == found.tables.keys()


@pytest.mark.parametrize(
    ("rate", "why"),
    [
        ("{ min = 60, max = 10 }", "swap them"),
        ("[0.1, 0.2]", "the times end before duration = 0.5 s"),
        ("[0.3, 0.2, 0.5]", "times must rise"),
        ("'often'", 'should be "haptics" or "graphics", a number .Hz., a fraction'),
        ("'graphics'", "add .graphics."),
        ("{ trace = 'none.csv' }", "cannot be read as a trace"),
        ("{ min = 60, max = 61 }", "is a whole haptic tick"),
        ("{ min = 8, max = 32 }", "gives takes steps of one size only"),
        ("'haptics'\n[phases]\ngives = 0.01", "gives takes steps of one size only"),
    ],
)
def test_rates_of_an_fmu_that_make_no_sense_are_told_where_they_stand(tmp_path, rate, why):
    flag = 'canHandleVariableCommunicationStepSize="true"'
    edited(python_fmu(tmp_path, "Gives"), lambda text: text.replace(flag, ""))
    path = scene(tmp_path, fmu_table("gives", "Gives", f"rate = {rate}\n"))
    with pytest.raises(SceneFault, match=why) as refused:
        simulate(str(path), tmp_path / "out")
    where = refused.value.findings[0].key
    assert where == "phases.gives" if "phases" in rate else where.startswith("fmu[0] (gives).rate")
