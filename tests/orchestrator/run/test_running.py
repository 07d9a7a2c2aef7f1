"""Result folder and messages of a run, what counts as its time, and runs of any length, whose first
rows come at once: nothing walks through them before."""

import json
import subprocess
from dataclasses import replace

import pytest

from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.run import execute_plan
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import COMMAND, fault, fmu_table, run, scene
from tests.shared_fixtures import run_once, status

SHORT = ("--set", "duration=0.2")
ROCKER = "linkage.start.rocker=2.9"


def test_a_run_replaces_the_files_of_the_one_before_and_no_others(tmp_path):
    out = tmp_path / "out"
    assert status("run", "closed-loop-ideal", "--out", out, *SHORT) == 0
    first = {p.name for p in out.iterdir()}
    assert set(read_results.load(out).run["files"]) == first
    assert {"graphics.csv", "constraints.png"} <= first
    (out / "notes.txt").write_text("mine")
    outside = tmp_path / "outside.txt"
    outside.write_text("mine")
    run = json.loads((out / "run.json").read_text())
    run["files"] += ["../outside.txt", str(outside), "..", 3]
    (out / "run.json").write_text(json.dumps(run))
    assert status("run", "four-bar", "--no-figures", "--out", out, *SHORT) == 0
    found = {p.name for p in out.iterdir()}
    assert found == {*read_results.load(out).run["files"], "notes.txt"}
    assert "graphics.csv" not in found
    assert outside.read_text() == "mine"


@pytest.mark.parametrize("command", ["run", "build", "export"])
def test_a_folder_that_cannot_be_is_bad_input(bar, tmp_path, command, capsys):
    (tmp_path / "file").write_text("")
    assert status(command, bar, "--out", tmp_path / "file") == 2
    assert "is a file; name a folder" in capsys.readouterr().err
    assert status(command, bar, "--out", tmp_path / "file" / "below") == 2
    assert "cannot be created" in capsys.readouterr().err


def test_a_start_that_assembly_moves_far_is_told(tmp_path, capsys):
    for options, count in (((), 0), (("--set", ROCKER), 1)):
        assert status("info", "four-bar", *options) == 0
        assert status("run", "four-bar", "--no-figures", "--out", tmp_path, *SHORT, *options) == 0
        told = capsys.readouterr().out
        assert told.count("the loops do not close at the given start") == 2 * count
    assert told.count("rocker = 2.9 }. Assembled: linkage.start = { crank = ") == 2
    head, assembled = told.rsplit("linkage.start = ", 1)
    assert head.rindex("done at") < head.rindex("warning:") < told.rindex("loops close within")
    closed = f"linkage.start={assembled.splitlines()[0]}"
    assert status("info", "four-bar", "--set", closed) == 0
    assert "warning" not in capsys.readouterr().out


def test_held_outputs_and_what_did_not_go_well_are_told(tmp_path):
    python_fmu(tmp_path, "Lost", "self.y = float('nan') if self.steps > 3 else 1.0")
    _, found = run(tmp_path, 'faults.nan = "hold"\n' + fmu_table("one", "Lost"))
    held = found.run["held_outputs"]["one"]
    assert held > 0
    told = f'one: {held} outputs were not finite and held (faults.nan = "hold")'
    assert list(summary.lines(found)) == [told]
    changed = found.run | {
        "links": {"a.y -> b.u": {"sent": 9, "lost": 2, "overtaken": 1}},
        "iterations": {"unconverged": 2, "steps": 5},
        "holds_that_did_not_fit": {
            f"{a}.y -> b.u": {"hold": "passive", "reason": "no power"} for a in "ac"
        },
    }
    assert list(summary.lines(replace(found, run=changed)))[1:] == [
        "warning: 2 of 5 iterated steps did not converge",
        "a.y -> b.u: 2 of 9 samples were lost, 1 overtaken",
        "zoh instead of the hold passive for b.u, b.u: no power",
    ]


def test_a_scene_of_given_fmus_has_nothing_to_build(tmp_path, capsys):
    python_fmu(tmp_path, "Given")
    path = scene(tmp_path, fmu_table("one", "Given"), duration=1)
    assert status("build", path, "--out", tmp_path / "fmus") == 2
    assert "nothing to build" in capsys.readouterr().err
    assert not (tmp_path / "fmus").exists()


def test_a_signal_of_another_rate_is_told_where_it_is():
    found = run_once("closed-loop-ideal", {"duration": 0.2, "phases.virtual_mechanism": 0.0005})
    (table,) = (n for n, t in found.tables.items() if "virtual_mechanism.x" in t)
    assert table != "haptics"
    with pytest.raises(KeyError, match=rf"it is in tables\['{table}'\]"):
        found.haptics["virtual_mechanism.x"]


def test_a_reader_that_has_enough_is_no_fault():
    command, pipe = [*COMMAND, "run", "closed-loop-ideal", "--explain"], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe) as told:
        assert told.stdout.readline().startswith(b"Time is counted in ticks")
        told.stdout.close()
        assert told.stderr.read() == b""
    assert told.returncode == 0


ONE = fmu_table("one", "One")


def test_what_the_fmu_said_is_in_the_fault(tmp_path):
    error = "__import__('pythonfmu').enums.Fmi2Status.error"
    python_fmu(tmp_path, "One", f"self.log('the belt slipped', {error}); return False")
    assert "the belt slipped" in fault(tmp_path, ONE)


def test_loading_and_unloading_are_no_part_of_the_runs_time(tmp_path, monkeypatch):
    """By a clock that goes on while these are done only."""
    python_fmu(tmp_path, "One")
    done = []
    monkeypatch.setattr(execute_plan, "perf_counter", lambda: float(len(done)))

    def timed(method):
        def call(instance):
            done.append(method.__name__)
            return method(instance)

        return call

    for name in ("_load", "close"):
        monkeypatch.setattr(InProcess, name, timed(getattr(InProcess, name)))
    outcome = run(tmp_path, ONE)[0].outcome
    assert done == ["_load", "close"]
    assert outcome.wall_time == 0.0


LONG = "duration=1e5"  # the longest that a scene takes
SOON = "stop_when='virtual_mechanism.energy > 1e-5'"


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["graphics.align=tick", "graphics.rate=29.97"],
        ["graphics.phase=0.01", "phases.virtual_mechanism=0.0005"],
        ["delays.hand.F={ min = 0.001, max = 0.004, seed = 1 }"],
    ],
    ids=["exact", "aligned", "phases", "drawn latencies"],
)
def test_a_run_of_1e5_s_has_rows(tmp_path, options):
    experiment = simulate("closed-loop-ideal", tmp_path, [LONG, SOON, *options])
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason) == (None, "stop_when")
    assert 0 < outcome.end_time < 1
    assert experiment.results.run["delays"]["haptic_device.x -> controller.x_D"]["max"] == 0.0


def test_ages_of_a_run_are_those_of_its_plan(tmp_path):
    experiment = simulate("closed-loop-direct", tmp_path, ["duration=0.6"])
    assert experiment.outcome.details.delays == delays(Plan(experiment.system))
