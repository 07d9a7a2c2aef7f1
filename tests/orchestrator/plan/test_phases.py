"""Phases of blocks: clocks of their own, holds, --explain, run.json, SSP, sweeps, faults."""

import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.analysis.sweep.job import jobs
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.system.timeline import timeline
from tests.orchestrator.plan.test_explain import explained
from tests.shared_fixtures import sets, status


@given(st.sampled_from([(1, 4), (1, 2), (3, 4), (1, 1)]), st.sampled_from(["haptics", "graphics"]))
def test_a_phase_of_our_block_moves_it_alone(share, rate):
    part = Fraction(*share)
    phase = part / (512 if rate == "haptics" else 30)
    options = [f'phases.virtual_mechanism="{phase}"', f"mechanism_at={rate}"]
    time = timeline(open_scene.load("closed-loop", options))
    moved = time.of["virtual_mechanism"]
    others = {name for fmu, name in time.of.items() if fmu != "virtual_mechanism"}
    assert others == {"haptics", "graphics"}
    assert (moved in others) == (part == 1)
    starts = time.clock(moved).starts
    assert starts[1] * time.base == phase
    assert starts[2] * time.base == phase * (1 + 1 / part)


def test_explain_and_run_json_tell_phases(tmp_path, capsys):
    options = ["phases.virtual_mechanism=0.0005", "duration=0.1"]
    told = explained(capsys, "closed-loop", *options)
    # 1/512 s, 1/30 s and 1/2000 s meet on ticks of 1/192000 s.
    assert "ticks of 1/192000 s" in told
    assert "haptics_at_0.0005s: every 375 ticks, first 96: virtual_mechanism" in told
    rows = re.findall(r"^ +(\d+) .* controller: .*x_S@(\d+) ", told, re.M)
    assert rows[:4] == [("0", "0"), ("375", "96"), ("750", "471"), ("1125", "846")]
    found = simulate("closed-loop", tmp_path, options).results
    clock = {"first": 0.0005, "shortest": 1 / 512, "longest": 1 / 512}
    assert found.run["clocks"]["haptics_at_0.0005s"] == clock
    at = 0.0005 + np.arange(51) / 512
    rows_of = found.tables["haptics_at_0.0005s"]
    np.testing.assert_allclose(rows_of["time"], [0, *at], rtol=0, atol=1e-15)
    assert rows_of["virtual_mechanism.x"].shape == (52, 3)
    age = found.run["delays"]["virtual_mechanism.x -> controller.x_S"]
    assert age["min"] == age["max"] == pytest.approx(1 / 512 - 0.0005, rel=1e-15)


def test_explain_goes_on_until_all_phases_have_begun_and_come_again(tmp_path, capsys):
    options = ["graphics.rate=128", "phases.virtual_mechanism='1/1024'"]
    told = explained(capsys, "closed-loop", *options)
    rows = re.findall(r"^ +(\d+)  .* virtual_mechanism: F_drift@\d+ F_hand@(\d+)", told, re.M)
    # Ticks of 1/1024 s: graphics comes every 8; steps start at 0 and after half a haptic period.
    assert rows == [("0", "0"), ("1", "0"), ("3", "2"), ("5", "4"), ("7", "6"), ("9", "8")]


def test_clocks_that_a_phase_parts_hold_the_newest_sample_unless_named(tmp_path):
    options = ["duration=0.02", "hold=foh", "downsampling=mean"]
    options += ["phases.virtual_mechanism='1/1024'", "holds.controller.F_drift=lead"]
    run = simulate("closed-loop", tmp_path, options).results.run
    assert run["holds"] == {
        "virtual_mechanism.x -> controller.x_S": "zoh",
        "virtual_mechanism.v -> controller.v_S": "zoh",
        "controller.F_drift -> virtual_mechanism.F_drift": "lead",
        "hand.F -> virtual_mechanism.F_hand": "zoh",
        "virtual_mechanism.q -> virtual_environment.q_ref": "mean",
        "virtual_mechanism.qd -> virtual_environment.qd_ref": "mean",
        "virtual_environment.Lambda_inv -> controller.Lambda_inv": "foh",
        "virtual_environment.P_c -> controller.P_c": "foh",
    }
    assert "controller.F_drift -> virtual_mechanism.F_drift" in run["energies"]


def test_rates_and_phases_survive_an_ssp(tmp_path):
    options = ["duration=0.2", "graphics.phase=0.01", "phases.virtual_mechanism='1/1024'"]
    options += ["phases.controller=0.0005"]
    assert status("export", "closed-loop", "--out", str(tmp_path), *sets(options)) == 0
    first = simulate("closed-loop", tmp_path / "a", options)
    again = simulate(str(tmp_path / "closed-loop.ssp"), tmp_path / "b")
    assert again.outcome.fault is None
    names = [c.name for c in first.system.timeline.clocks]
    assert len(names) == 4
    for name in names:
        table = f"{name}.csv"
        assert (tmp_path / "a" / table).read_bytes() == (tmp_path / "b" / table).read_bytes()


def test_a_sweep_varies_phases():
    points = [{"phases.virtual_mechanism": text} for text in ("0.0005", "1/1024", "0.002")]
    made = jobs("closed-loop", [], points)
    phases = [j.scene and j.scene.phases["virtual_mechanism"] for j in made]
    assert phases == [0.0005, "1/1024", None]
    assert "within a period, 1/512 s" in made[2].refusal
    assert made[0].key != made[1].key
