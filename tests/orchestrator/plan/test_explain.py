"""`--explain`, phases and recorded traces: the printed plan is the plan that is executed."""

import re

import numpy as np
import pytest

from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.experiment import simulate
from tests.shared_fixtures import sets, status


def test_explain_tells_blocks_and_the_samples_behind_inputs(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = explained(capsys, "closed-loop", "graphics.rate=128", "hold=foh")
    assert not list(tmp_path.iterdir())
    assert "ticks of 1/512 s, gauss-seidel" in told
    assert "haptics: every 1 ticks: hand (sampled), controller (sampled)" in told
    assert "virtual_environment.P_c -> controller.P_c: foh of a projector" in told
    assert re.search(r"^block A: the start, haptics 1, graphics 4$", told, re.M)
    assert re.search(r"^  evaluate virtual_environment.P_c -> controller.P_c$", told, re.M)
    assert re.search(r"^  step virtual_environment dticks 4$", told, re.M)
    # One hyperperiod, both ends in it: the projector is of the newest frame.
    rows = re.findall(r"^ +(\d+)  .* controller: x_D@(\d+) .* P_c@(\d+)$", told, re.M)
    assert rows == [(t, t, "4" if t == "4" else "0") for t in "01234"]


def explained(capsys: pytest.CaptureFixture[str], scene: str, *options: str) -> str:
    assert status("run", scene, "--explain", *sets(options)) == 0
    return capsys.readouterr().out


def test_a_run_keeps_what_explain_prints(tmp_path, capsys):
    options = ["duration=0.2", "graphics.rate={min=20, max=60, seed=2}"]
    told = explained(capsys, "closed-loop", *options)
    assert status("run", "closed-loop", "--no-figures", "--out", tmp_path, *sets(options)) == 0
    assert (tmp_path / "plan.txt").read_text() == told
    assert "plan.txt" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("scene", "option"),
    [
        ("closed-loop", "graphics.rate={min=20, max=60, seed=2}"),
        ("closed-loop-direct", "delays.hand.F={min=0.001, max=0.02}"),
    ],
)
def test_what_does_not_come_round_is_told_to_its_end(tmp_path, capsys, scene, option):
    options = ["duration=1.5", "haptics.rate=500", option]
    told = explained(capsys, scene, *options).splitlines()
    assert told[-1] == "cut after 600 events; a run writes them all to plan.txt"
    haptics = simulate(scene, tmp_path, options).results.haptics["time"]
    kept = (tmp_path / "plan.txt").read_text().splitlines()
    table = next(i for i, line in enumerate(told) if line.startswith("tick, "))
    assert kept[kept.index(told[table]) :][: len(told) - table - 1] == told[table:-1]
    ends = [line.split()[1] for line in kept[kept.index(told[table]) + 1 :]]
    assert float(ends[-1]) == pytest.approx(haptics[-1], abs=1e-8)  # a last tick only reads
    assert len(set(ends)) >= len(haptics) - 1


@pytest.mark.parametrize("align", ["exact", "tick"])
def test_a_phase_moves_the_frames(tmp_path, align):
    options = ["duration=0.2", "graphics.phase=0.01", f"graphics.align={align}"]
    experiment = simulate("closed-loop", tmp_path, options)
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
    scene.write_text('extends = "closed-loop"\nduration = 0.2\n[graphics]\nrate.trace="frames.csv"')
    experiment = simulate(str(scene), tmp_path / "out")
    run = experiment.results.run
    assert run["scene"]["graphics"]["rate"] == [0.017, 0.034, 0.1, 0.116, 0.2]
    frames = experiment.results.graphics["time"]
    expected = np.ceil(np.array([0, 0.017, 0.034, 0.1, 0.116]) * 512) / 512
    np.testing.assert_allclose(frames, expected, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time\n0.1\nsoon", "line 3: 'soon' is no time"),
        ("0.2\n0.1", "line 2: 0.1 s is not after 0.2 s"),
        ("0.1", "1 time stamps"),
    ],
)
def test_what_is_no_trace_is_told_by_its_line(tmp_path, text, why):
    (tmp_path / "frames.csv").write_text(text)
    with pytest.raises(Fault, match=re.escape(why)):
        simulate("closed-loop", tmp_path, [f"graphics.rate={{trace='{tmp_path}/frames.csv'}}"])
