"""Runs that begin at another time than 0: against FMPy, and against the same run at 0."""

import json
import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from tests.little_fmus import slave
from tests.orchestrator.c_fmus import clock_fmu3, equations_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, ran
from tests.shared_fixtures import status

SINE = "[[connection]]\nfrom = { formula = 'sin(5*t)' }\nto = 'fed.u'\n"
HELD = {"hand": {"type": "constant", "wrench": [0.3, 0.1, 0.0]}, "duration": 0.1}


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_a_sine_acts_as_in_fmpy_with_that_start_time(tmp_path, isolate):
    """An integral of it, the times of the steps, and an event at an absolute time."""
    body = """self.y += size*self.u
        self.t = time
        self.gained = self.gain"""
    variables = ("input", {"u": 0.0}), ("tunable", {"gain": 1.0})
    path = slave(tmp_path, "Fed", *variables, ("output", {"y": 0.0, "t": 0.0, "gained": 0.0}),
                 body=body)  # fmt: skip
    event = "[[at]]\ntime = 2.5\nset = { 'fed.gain' = 3.0 }\n"
    text = fmu_table("fed", "Fed", f"timing = 'sampled'\n{isolate}") + SINE + event
    found = ran(tmp_path, text, "start_time=2.0", "duration=1.0").haptics
    np.testing.assert_array_equal(time := found["time"], 2 + np.arange(65) / 64)
    given = np.array([*zip(time, np.sin(5 * time), strict=True)], [("time", "f8"), ("u", "f8")])
    theirs = simulate_fmu(
        str(path), start_time=2.0, stop_time=3.0, step_size=1 / 64, output_interval=1 / 64,
        input=given, output=["y", "t"],
    )  # fmt: skip
    # FMPy's row of an instant is the end of the step before, ours of a sampled FMU its beginning.
    np.testing.assert_allclose(found["fed.y"][:-1], theirs["y"][1:], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found["fed.t"][:-1], theirs["t"][1:])
    np.testing.assert_array_equal(found["fed.gained"], np.where(time < 2.5, 1.0, 3.0))


def test_what_was_recorded_from_a_start_time_on_drives_another_run_from_there(tmp_path):
    """To the same bits: an input over time, and a hand."""
    hand = {"type": "profile", "table": [[2.3, 0.0, 0.0, 0.0], [2.4, 0.3, 0.1, 0.0]]}
    options = {"start_time": 2.3, "duration": 0.1, "hand": hand}
    own = hl.run("closed-loop-ideal", options, out=tmp_path / "own", figures=False)
    log = {"path": str(tmp_path / "own" / "haptics.csv"), "columns": ["time", "hand.F"]}
    fed = {"connection.+": {"from": {"table": log}, "to": "haptic_device.F_hand"}}
    for again in ({"hand": {"type": "profile", "table": log}}, fed):
        run = hl.run("closed-loop-ideal", options | again)
        assert np.array_equal(own["haptic_device.x_true"], run["haptic_device.x_true"])


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_model_exchange_has_the_bits_of_fmpy(tmp_path, fmi):
    path = equations_fmu(tmp_path, fmi)
    found = ran(tmp_path, fmu_table("one", "equations"), "start_time=2.0", "duration=1.5").haptics
    theirs = simulate_fmu(
        path, validate=False, fmi_type="ModelExchange", start_time=2.0, stop_time=3.5,
        output_interval=1 / 64, record_events=False,
    )  # fmt: skip
    assert found["one.falls"][-1] == 4
    for name in ("x", "falls", "entered"):
        np.testing.assert_array_equal(found[f"one.{name}"], theirs[name])


def test_a_periodic_clock_ticks_from_the_start_time_on(tmp_path):
    """At start + shift + k interval (FMI 3.0.2 section 2.2.8)."""
    clock_fmu3(tmp_path)
    found = ran(tmp_path, fmu_table("one", "clocks"), "start_time=2.02", "duration=0.5").haptics
    instants = 2.02 + 0.05 + 0.1 * np.arange(5)
    expected = np.searchsorted(instants + 1e-9, found["time"])
    np.testing.assert_array_equal(found["one.sample_count"], expected)


def without_time(folder: Path) -> dict[str, list[str]]:
    tables = {path.name: path.read_text().splitlines() for path in folder.glob("*.csv")}
    assert {*tables} == {"haptics.csv", "graphics.csv"}
    return {name: [line.partition(",")[2] for line in lines] for name, lines in tables.items()}


@pytest.mark.parametrize("start", [2.0, 0.1])
def test_where_nothing_depends_on_time_only_the_times_differ(tmp_path, start):
    """Latencies that are drawn, a foreign start that is no whole tick, and a change while it runs,
    too; and a run that goes on from a state has the bytes of the one that was not interrupted."""
    late = {"virtual_environment.Lambda_inv": {"min": 0.01, "max": 0.03, "loss": 0.2, "seed": 3}}
    options = HELD | {"graphics.rate": 60, "delays": late}
    runs = []
    for begin in (0.0, start):
        let_go = {"time": begin + 0.06, "set": {"hand.wrench": [0.0, 0.0, 0.0]}}
        own = options | {"start_time": begin, "at": [let_go]}
        out = tmp_path / str(begin)
        runs.append(hl.run("closed-loop-ideal", own, out=out, figures=False, save=[begin + 0.05]))
    first, later = (run.haptics["time"] for run in runs)
    np.testing.assert_allclose(later, first + start, rtol=1e-15)
    assert np.ptp(runs[1]["hand.F[1]"]) == 0.3
    assert without_time(runs[0].folder) == without_time(runs[1].folder)
    known = [{e["until"] for e in json.loads((run.folder / "run.json").read_text())[
        "energies_within_a_rate"].values()} for run in runs]  # fmt: skip
    assert [*known[1]] == pytest.approx([start + until for until in known[0]])
    again = hl.run(runs[1].folder / f"at-{start + 0.05:g}.state", out=tmp_path / "again",
                   figures=False)  # fmt: skip
    rows = {name: len(lines) - 1 for name, lines in without_time(again.folder).items()}
    assert min(rows.values()) > 1
    for name, n in rows.items():
        whole, rest = ((f / name).read_bytes().splitlines() for f in (runs[1].folder, again.folder))
        assert whole[-n:] == rest[1:]


def test_frames_at_times_of_their_own_end_then(tmp_path):
    """A trace counts from its first stamp, at which the run begins."""
    frames = [0.5, 2.03, 2.06, 2.11, 2.2]
    run = hl.run("closed-loop-ideal", HELD | {"graphics.rate": frames, "start_time": 2.0})
    found, near = run.tables["graphics"]["time"], 1 / 512
    assert found[0] == 2.0
    assert all(0 <= b - a < near for a, b in zip(frames[1:3], found[1:], strict=True))
    assert all(b > a for a, b in pairwise(found))
    (tmp_path / "frames.csv").write_text("7.0\n7.03\n7.06\n7.11\n7.2\n")
    trace = {"trace": str(tmp_path / "frames.csv")}
    again = hl.run("closed-loop-ideal", HELD | {"graphics.rate": trace, "start_time": 2.0})
    assert np.array_equal(again.tables["graphics"]["time"], found)


@pytest.mark.parametrize("command", ["stability", "build --as-one", "run --real-time", "view"])
def test_what_begins_at_0_refuses_it(command, capsys):
    assert status(*command.split(), "closed-loop-ideal", "--set", "start_time=2.0") == 2
    assert "start_time = 2: runs, sweeps and SSPs alone begin at an" in capsys.readouterr().err


def test_an_ssp_has_it_as_its_start_time(tmp_path):
    begun = HELD | {"start_time": 2.0}
    path = hl.export("closed-loop-ideal", begun, out=tmp_path / "scene.ssp")
    text = zipfile.ZipFile(path).read("SystemStructure.ssd").decode()
    assert '<ssd:DefaultExperiment startTime="2.0" stopTime="2.1"' in text
    read, own = hl.run(path), hl.run("closed-loop-ideal", begun)
    np.testing.assert_array_equal(read.haptics["time"], own.haptics["time"])
    np.testing.assert_array_equal(read["virtual_mechanism.q[1]"], own["virtual_mechanism.q[1]"])


def test_an_event_before_the_start_and_a_state_of_another_are_refused(tmp_path):
    early = {"time": 1.0, "set": {"hand.wrench": [0.0, 0.0, 0.0]}}
    with pytest.raises(SceneFault, match=r"1 s is before the run, whose start_time is 2 s"):
        hl.run("closed-loop-ideal", HELD | {"start_time": 2.0, "at": [early]})
    hl.run("closed-loop-ideal", HELD, out=tmp_path / "a", figures=False, save=[0.05])
    with pytest.raises(InputFault, match="start_time is another: leave it as it was"):
        hl.run(tmp_path / "a" / "at-0.05.state", {"start_time": 2.0}, out=tmp_path / "b")
