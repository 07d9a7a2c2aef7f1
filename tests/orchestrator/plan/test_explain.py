"""`--explain`, phases and recorded traces: the printed plan is the plan that is executed."""

import re
from fractions import Fraction
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.analysis.sweep.job import jobs
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan import explain, operations
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.system.timeline import timeline
from tests.shared_fixtures import sets, status


def test_explain_tells_blocks_and_the_samples_behind_inputs(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = explained(capsys, "closed-loop-ideal", "graphics.rate=128", "hold=foh")
    assert not list(tmp_path.iterdir())
    assert "ticks of 1/512 s, gauss-seidel" in told
    assert "haptics: every 1 ticks: hand (sampled), controller (sampled)" in told
    assert "virtual_environment.P_c -> controller.P_c: foh of a projector" in told
    assert re.search(r"^block A: the start, haptics 1, graphics 4$", told, re.M)
    assert re.search(r"^  evaluate virtual_environment.P_c -> controller.P_c$", told, re.M)
    assert re.search(r"^  step virtual_environment dticks 4$", told, re.M)
    # Up to the end of the second frame: the projector describes the beginning of the newest one.
    rows = re.findall(r"^ +(\d+)  .* controller: x_D@(\d+) .* P_c@(\d+)$", told, re.M)
    assert rows == [(t, t, "4" if t == "8" else "0") for t in "012345678"]


def test_the_legend_has_every_operation_and_what_it_does():
    classes = {k for k in vars(operations).values() if isinstance(k, type)}
    classes = {k for k in classes if issubclass(k, operations.Instruction)}
    bases = {base for k in classes for base in k.__bases__}
    assert classes - bases == {*get_args(operations.Operation)}
    told = dict(re.findall(r"^  (\w+) +(.+)$", explain.LEGEND, re.M))
    assert told == {k.__name__.lower(): k.does for k in classes - bases}
    assert len({*told.values()}) == len(told)


def explained(capsys: pytest.CaptureFixture[str], scene: str, *options: str) -> str:
    assert status("run", scene, "--explain", *sets(options)) == 0
    return capsys.readouterr().out


def test_a_run_keeps_what_explain_prints(tmp_path, capsys):
    options = ["duration=0.2", "graphics.rate={min=20, max=60, seed=2}"]
    told = explained(capsys, "closed-loop-ideal", *options)
    assert (
        status("run", "closed-loop-ideal", "--no-figures", "--out", tmp_path, *sets(options)) == 0
    )
    assert (tmp_path / "plan.txt").read_text() == told
    assert "plan.txt" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("scene", "option"),
    [
        ("closed-loop-ideal", "graphics.rate={min=20, max=60, seed=2}"),
        ("closed-loop-direct", "delays.hand.F={min=0.001, max=0.02}"),
    ],
)
def test_what_does_not_come_round_is_told_to_its_end(tmp_path, capsys, scene, option):
    options = ["duration=1.5", "haptics.rate=500", option]
    told = explained(capsys, scene, *options).splitlines()
    assert told[-1] == "cut after 600 events; a run writes them all to plan.txt"
    assert status("run", scene, "--no-figures", "--out", tmp_path, *sets(options)) == 0
    haptics = read_results.load(tmp_path).haptics["time"]
    kept = (tmp_path / "plan.txt").read_text().splitlines()
    table = next(i for i, line in enumerate(told) if line.startswith("tick, "))
    assert kept[kept.index(told[table]) :][: len(told) - table - 1] == told[table:-1]
    ends = [line.split()[1] for line in kept[kept.index(told[table]) + 1 :]]
    assert float(ends[-1]) == pytest.approx(haptics[-1], abs=1e-8)  # a last tick only reads
    assert len(set(ends)) >= len(haptics) - 1


@pytest.mark.parametrize("align", ["exact", "tick"])
def test_a_phase_moves_the_frames(tmp_path, align):
    options = ["duration=0.2", "graphics.phase=0.01", f"graphics.align={align}"]
    experiment = simulate("closed-loop-ideal", tmp_path, options)
    assert experiment.outcome.fault is None
    frames = experiment.results.graphics["time"]
    expected = np.array([0.0, *(0.01 + np.arange(6) / 30)])
    if align == "tick":
        expected = np.ceil(expected * 512 - 1e-9) / 512
    np.testing.assert_allclose(frames, expected[expected <= 102 / 512], rtol=0, atol=1e-15)


def test_a_recorded_trace_is_a_list_of_frames_beside_its_scene(tmp_path):
    stamps = ["1.600", "1.617", "1.634", "1.700  # a hitch", "1.716", "1.8"]
    (tmp_path / "frames.csv").write_text("time,fps\n" + "\n".join(stamps))
    scene = tmp_path / "traced.toml"
    scene.write_text(
        'extends = "closed-loop-ideal"\nduration = 0.2\n[graphics]\nrate.trace="frames.csv"'
    )
    experiment = simulate(str(scene), tmp_path / "out")
    run = experiment.results.run
    assert run["scene"]["graphics"]["rate"] == [0.017, 0.034, 0.1, 0.116, 0.2]
    frames = experiment.results.graphics["time"]
    expected = np.ceil(np.array([0, 0.017, 0.034, 0.1, 0.116]) * 512) / 512
    np.testing.assert_allclose(frames, expected, rtol=0, atol=0)


@given(st.sampled_from([(1, 4), (1, 2), (3, 4), (1, 1)]), st.sampled_from(["haptics", "graphics"]))
def test_a_phase_of_our_block_moves_it_alone(share, rate):
    part = Fraction(*share)
    phase = part / (512 if rate == "haptics" else 30)
    options = [f'phases.virtual_mechanism="{phase}"', f"mechanism_at={rate}"]
    time = timeline(open_scene.load("closed-loop-ideal", options))
    moved = time.of["virtual_mechanism"]
    others = {name for fmu, name in time.of.items() if fmu != "virtual_mechanism"}
    assert others == {"haptics", "graphics"}
    assert (moved in others) == (part == 1)
    starts = time.clock(moved).starts
    assert starts[1] * time.base == phase
    assert starts[2] * time.base == phase * (1 + 1 / part)


def test_explain_and_run_json_tell_phases(tmp_path, capsys):
    options = ["phases.virtual_mechanism=0.0005", "duration=0.1"]
    told = explained(capsys, "closed-loop-ideal", *options)
    # 1/512 s, 1/30 s and 1/2000 s meet on ticks of 1/192000 s.
    assert "ticks of 1/192000 s" in told
    assert "haptics_at_0.0005s: every 375 ticks, first 96: virtual_mechanism" in told
    rows = re.findall(r"^ +(\d+) .* controller: .*x_S@(\d+) ", told, re.M)
    assert rows[:4] == [("0", "0"), ("375", "96"), ("750", "471"), ("1125", "846")]
    found = simulate("closed-loop-ideal", tmp_path, options).results
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
    told = explained(capsys, "closed-loop-ideal", *options)
    rows = re.findall(r"^ +(\d+)  .* virtual_mechanism: F_drift@\d+ F_hand@(\d+)", told, re.M)
    # Ticks of 1/1024 s: graphics comes every 8; steps start at 0 and after half a haptic period.
    assert rows == [("0", "0"), *((str(t), str(t - 1)) for t in range(1, 19, 2))]


def test_clocks_that_a_phase_parts_hold_the_newest_sample_unless_named(tmp_path):
    options = ["duration=0.02", "hold=foh", "downsampling=mean"]
    options += ["phases.virtual_mechanism='1/1024'", "holds.controller.F_drift=lead"]
    run = simulate("closed-loop-ideal", tmp_path, options).results.run
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


def test_a_sweep_varies_phases():
    points = [{"phases.virtual_mechanism": text} for text in ("0.0005", "1/1024", "0.002")]
    made = jobs("closed-loop-ideal", [], points)
    phases = [j.scene and j.scene.phases["virtual_mechanism"] for j in made]
    assert phases == [0.0005, "1/1024", None]
    assert "within a period, 1/512 s" in made[2].refusal
    assert made[0].key != made[1].key
