"""FMUs that behave badly: what they return is not believed, and what they change is restored."""

import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.orchestrator.results import read_results
from tests.orchestrator.c_fmus import HOSTILE_LOG, hostile_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, RUN, hostile_scene, process
from tests.orchestrator.hostile_slave import hostile_slave
from tests.orchestrator.run.test_interrupt import children, waited_for

pytest.importorskip("resource")  # the FMU needs POSIX


ACTS = [
    ("step", "minus"), ("step", "least"), ("step", "pending"), ("step", "most"), ("get", "minus"),
    ("set", "minus"), ("enter", "minus"), ("leave", "least"), ("end", "minus"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("fmi", "isolate", "place", "act"),
    [
        *((fmi, "", *act) for fmi in "23" for act in ACTS),
        # Python steps it, and its worker, which is the same for every version of FMI, passes on any
        # status of a call alike.
        *(("2", ISOLATED, place, act) for place, act in dict(ACTS).items()),
    ],
)
def test_only_ok_and_warning_are_success(tmp_path, fmi, isolate, place, act):
    hostile_fmu(tmp_path, fmi)
    scene = hostile_scene(tmp_path, f"{place}_{act}_20", isolate)
    outcome = simulate(scene, tmp_path / "out").outcome
    assert outcome.reason == "fault"
    name = {"minus": "status -1", "least": "status -2147483648", "most": "status 2147483647"}
    assert f"returned {name.get(act, act)}" in str(outcome.fault)
    ends = {"step": 19 / 64, "get": 19 / 64, "set": 20 / 64, "enter": 0, "leave": 0, "end": 0.5}
    assert outcome.end_time == ends[place]


@pytest.mark.parametrize("place", ["save", "restore"])
def test_a_state_that_is_saved_or_restored_in_part_is_none(tmp_path, place):
    description = describe(hostile_fmu(tmp_path))
    outputs = np.zeros(len(description.outputs))
    with in_process(description)(f"{place}_minus_0", description, outputs) as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.exit_initialization()
        if place == "restore":
            instance.save()
        call = instance.save if place == "save" else instance.rollback
        with pytest.raises(FmuFault, match=r"FMUstate returned status -1 at t = 0 s"):
            call()


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize(
    ("place", "where"), [("step", "root"), ("step", "gone"), ("enter", "root"), ("make", "gone")]
)
def test_a_change_of_the_current_directory_is_undone_and_told(
    tmp_path, fmi, place, where, monkeypatch, caplog
):
    hostile_fmu(tmp_path, fmi)
    hostile_scene(tmp_path, name := f"{place}_{where}_7")
    monkeypatch.chdir(tmp_path)
    run = hl.run("scene.toml", out="out", figures=False)
    assert run.fault is None
    assert Path.cwd() == tmp_path
    to = "/" if where == "root" else "a folder that was removed"
    assert f"changed the current directory to {to}: it is {tmp_path} again" in caplog.text
    assert name in caplog.text
    assert {p.name for p in (tmp_path / "out").iterdir()} == set(run.run["files"])
    assert len(read_results.load(tmp_path / "out").haptics["time"]) == 33


def test_runs_in_threads_leave_the_current_directory_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ends: list[object] = []

    def runs():
        for _ in range(6):
            ends.append(hl.run("pendulum", {"duration": 0.02}).run["end"]["reason"])

    threads = [threading.Thread(target=runs) for _ in range(3)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert Path.cwd() == tmp_path
    assert ends == ["duration"] * 18


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize(
    ("place", "act"),
    [("step", "upward"), ("step", "zero"), ("step", "flush"), ("get", "upward"), ("set", "zero"),
     ("enter", "upward"), ("make", "upward")],
)  # fmt: skip
def test_another_rounding_mode_is_restored_and_told(tmp_path, fmi, place, act, caplog):
    """The numbers of the other FMU are the same to the bit."""
    hostile_fmu(tmp_path, fmi)
    good = simulate(hostile_scene(tmp_path, "good_none_0"), tmp_path / "good").results.haptics
    assert "rounds" not in caplog.text
    scene = hostile_scene(tmp_path, name := f"{place}_{act}_3")
    bad = simulate(scene, tmp_path / "bad").results.haptics
    assert bad["source.slope"].tolist() == good["source.slope"].tolist()
    assert f"{name} changed how this process rounds numbers" in caplog.text
    assert 1.0 + 2.0**-53 == 1.0  # of this process, too
    assert 2.0**-1074 > 0.0


EARLY = {
    **{(fmi, act): 20 / 64 for fmi in "23" for act in ("finish", "beyond")},
    **{(fmi, act): 19 / 64 for fmi in "23" for act in ("middle", "never")},  # never: at NaN
    ("3", "early"): 19 / 64,
}
"""The end of a run (s) by version and act."""


@pytest.mark.parametrize(
    ("fmi", "isolate", "act"),
    [
        *((fmi, "", act) for fmi, act in EARLY),
        *((fmi, ISOLATED, act) for fmi in "23" for act in ("finish", "middle")),
    ],
)
def test_a_step_that_ends_early_ends_the_run_at_the_last_whole_step(
    tmp_path, fmi, isolate, act, monkeypatch
):
    """As it requests, which is no fault, or unasked, which is not allowed to it (FMI 3.0, section
    4.2.1); the rows of all FMUs end there."""
    log, name, end = tmp_path / "log", f"step_{act}_20", EARLY[fmi, act]
    monkeypatch.setenv(HOSTILE_LOG, str(log))
    hostile_fmu(tmp_path, fmi)
    coupling = "coupling=jacobi" if fmi == "3" else "coupling=gauss-seidel"
    ended = simulate(hostile_scene(tmp_path, name, isolate), tmp_path / "out", [coupling])
    outcome, rows = ended.outcome, ended.results.haptics
    assert outcome.end_time == end
    assert rows["source.y"].tolist() == (rows["time"] * 64).tolist() == [*range(int(end * 64) + 1)]
    if act == "early":
        assert outcome.reason == "fault"
        assert "fmi3DoStep returned early, at 0.304688 s, unasked" in str(outcome.fault)
        return
    assert (outcome.reason, outcome.fault) == ("terminated", None)
    assert ended.results.run["end"] == {"reason": "terminated", "time": end, "asked": outcome.asked}
    within = {"middle": f"{name} asks to end the simulation at 0.304688 s, within its step"}
    if act in ("finish", "middle"):
        assert outcome.asked == within.get(act, f"{name} has asked to end the simulation")
    assert sorted(log.read_text().split()) == ["free", "free", "terminate", "terminate"]


def test_what_a_python_fmu_changes_of_the_interpreter_is_restored(tmp_path):
    streams, limit, errors = (sys.stdout, sys.stderr), sys.getrecursionlimit(), np.geterr()
    hostile_fmu(tmp_path)
    file = hostile_slave(tmp_path, "2").stem
    for act in ("streams", "recursion", "seterr"):
        scene = hostile_scene(tmp_path, f"step_{act}_20", fmu=file)
        assert simulate(scene, tmp_path / "out").outcome.reason == "duration"
        assert (sys.stdout, sys.stderr) == streams
        assert (sys.getrecursionlimit(), np.geterr()) == (limit, errors)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_exit_of_c_is_no_success(tmp_path, fmi):
    hostile_fmu(tmp_path, fmi)
    out = tmp_path / "out"
    ended = process(hostile_scene(tmp_path, "step_exit_20"), out)
    assert ended.returncode == 1
    assert "the process of the run ended after t = 0.296875 s" in ended.stderr
    found = read_results.load(out)
    assert found.run["fault"]["kind"] == "Crash"
    assert found.haptics["time"].tolist() == [k / 64 for k in range(20)]


def test_a_crash_at_the_end_is_recorded_at_the_time_of_its_rows(tmp_path):
    """The tables are whole by then, and nothing is recovered."""
    hostile_fmu(tmp_path)
    out = tmp_path / "out"
    process(hostile_scene(tmp_path, "end_null_9"), out)
    waited_for(lambda: read_results.load(out).run["end"]["reason"] != "running")
    assert read_results.load(out).run["end"] == {"reason": "fault", "time": 0.5}
    assert read_results.load(out).haptics["time"][-1] == 0.5


def mapped(pid: int) -> list[str]:
    """What the processes that a process has started have in memory."""
    maps = []
    for child in children(pid):
        with suppress(ProcessLookupError, FileNotFoundError):  # it has ended meanwhile
            maps.append(Path(f"/proc/{child}/maps").read_text())
    return maps


def test_an_fmu_that_needs_a_tool_has_a_process_of_its_own(tmp_path):
    """A tool that never answers would hang the run; one signal ends it while it loads."""
    hostile_fmu(tmp_path, "2", needsExecutionTool="true")
    run = simulate(hostile_scene(tmp_path, "good_none_0"), tmp_path / "good").run
    assert set(run["isolated"]) == {"good_none_0", "source"}
    scene = hostile_scene(tmp_path, "make_sleep_0")
    command = [*RUN, str(scene), "--out", str(tmp_path / "o")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as tool:
        waited_for(lambda: any("hostile" in maps for maps in mapped(tool.pid)))
        time.sleep(0.2)  # it is at its instance by now
        assert tool.poll() is None
        tool.terminate()
        _, said = tool.communicate(timeout=20)
    assert tool.returncode == 1
    assert "interrupted" in said
