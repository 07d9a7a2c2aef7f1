"""Faults made to happen through real FMUs: what each policy does, that results are kept, and that
no process and no folder stays behind."""

import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import read_results
from tests.little_fmus import PLAIN, SLAVE, edited_entries, python_fmu, python_fmu_of, slave
from tests.orchestrator.c_fmus import HOSTILE_LOG, hostile_fmu
from tests.orchestrator.foreign_scenes import (
    COMMAND,
    ISOLATED,
    RUN,
    fault,
    fmu_table,
    process,
    ran,
    run,
    scene,
    wire_table,
)
from tests.orchestrator.run.test_interrupt import children, waited_for
from tests.plugins import hapticlink, server

resource = pytest.importorskip("resource")  # these are the signals and limits of POSIX

OTHER = fmu_table("other", "Other")


@pytest.fixture(autouse=True)
def crash_monitor_of_runs():
    """Runs start their watchdog."""


def folders() -> set[str]:
    return {p.name for p in Path(tempfile.gettempdir()).glob("hapticlink-*")}


@pytest.fixture(autouse=True)
def _nothing_left_behind(own_temporary_folder):
    server()  # stays for the next command
    before = folders(), {*children(os.getpid())}, os.getcwd()
    yield
    assert folders() <= before[0]
    # One that was killed is still to be reaped.
    waited_for(lambda: {*children(os.getpid())} <= before[1], 5.0)
    assert os.getcwd() == before[2]
    assert not [p for p in sys.path if "hapticlink-" in p]


@pytest.mark.parametrize(
    ("value", "isolate"), [("float('nan')", ""), ("float('inf')", ""), ("float('nan')", ISOLATED)]
)
def test_a_value_that_is_not_finite_stops_or_is_held(tmp_path, value, isolate):
    body = f"self.y = {value} if self.steps == 5 else float(self.steps)"
    python_fmu(tmp_path, "Lost", body)
    one = fmu_table("one", "Lost", isolate)
    experiment, found = run(tmp_path, one)
    assert f"output y is {value[7:10]} at t = 0.078125 s" in str(experiment.outcome.fault)
    assert found.haptics["one.y"].tolist() == [0, 1, 2, 3, 4]
    found = ran(tmp_path, one, "faults.nan=hold")
    assert found.haptics["one.y"][:8].tolist() == [0, 1, 2, 3, 4, 4, 6, 7]
    assert found.run["held_outputs"] == {"one": 1}


def test_not_finite_at_the_start_is_a_fault_even_where_held(tmp_path):
    slave(tmp_path, "Never", ("output", {"y": math.nan}))
    said = fault(tmp_path, fmu_table("one", "Never"), "faults.nan=hold")
    assert "one: output y is nan at t = 0 s" in said


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_an_exception_in_a_python_fmu(tmp_path, isolate):
    python_fmu(tmp_path, "Raises", "if time > 0.2: raise RuntimeError('broken gear')")
    python_fmu(tmp_path, "Other")
    experiment, found = run(tmp_path, fmu_table("one", "Raises", isolate) + OTHER)
    message = str(experiment.outcome.fault)
    assert message.startswith("one: fmi2DoStep returned fatal at t = 0.203125 s")
    assert "broken gear" in message
    assert found.haptics["other.y"][-1] == found.haptics["time"][-1] == 0.203125


@pytest.mark.parametrize(
    ("fmi", "isolate"),
    [("2", ""), ("3", ""), ("2", ISOLATED)],  # a worker is the same for every version of FMI
)
@pytest.mark.parametrize(
    ("act", "calls"),
    [
        ("warning", ["terminate", "free"]),
        ("discard", ["terminate", "free"]),
        ("error", ["free"]),
        ("fatal", []),
    ],
)
def test_every_status(tmp_path, fmi, act, calls, isolate, monkeypatch):
    """What is called after a fault: FMI 2.0.5 sections 2.1.3 and 4.2.4, FMI 3.0 section 2.3.1.
    After an error only freeing is allowed, after a fatal error nothing; a discarded step leaves the
    FMU as it was, and a warning is no fault."""
    log, name = tmp_path / "log", f"step_{act}_4"
    monkeypatch.setenv(HOSTILE_LOG, str(log))
    hostile_fmu(tmp_path, fmi)
    python_fmu(tmp_path, "Other")
    experiment, found = run(tmp_path, fmu_table(name, "hostile", isolate) + OTHER)
    assert (log.read_text().splitlines() if log.exists() else []) == calls
    if act == "warning":
        assert experiment.outcome.fault is None
        assert len(found.haptics["time"]) == 33
        return
    told = f"{name}: fmi{fmi}DoStep returned {act} at t = 0.046875 s"
    assert str(experiment.outcome.fault) == told
    assert found.haptics[f"{name}.y"].tolist() == [0, 1, 2, 3]
    assert found.run["fault"]["kind"] == "FmuFault"


@pytest.mark.parametrize(
    ("body", "how"),
    [
        ("if time > 0.2: __import__('os')._exit(3)", "its process ended with exit status 3"),
        ("if time > 0.2: __import__('ctypes').string_at(0)", "its process ended by SIGSEGV"),
        (
            "if time > 0.2: __import__('time').sleep(60)",
            "its process did not answer within 2 s and was",
        ),
        ("native", "its process did not answer within 2 s and was"),  # an endless loop
    ],
)
def test_a_process_that_dies_or_hangs_ends_the_run_in_good_order(tmp_path, body, how):
    native = body == "native"
    name, fmu = ("step_loop_4", "hostile") if native else ("one", "Dies")
    hostile_fmu(tmp_path)
    python_fmu(tmp_path, "Dies", body)
    ended = tmp_path / "ended"
    python_fmu(tmp_path, "Other", end=f"open({str(ended)!r}, 'w').close()")
    text = fmu_table(name, fmu, ISOLATED) + OTHER
    experiment, found = run(tmp_path, text, "faults.timeout=2")
    message = str(experiment.outcome.fault)
    assert message.startswith(f"{name}: {how}")
    steps = 3 if native else 13
    assert message.endswith(f"at t = {steps / 64} s")
    np.testing.assert_array_equal(found.haptics["time"], np.arange(steps + 1) / 64)
    assert found.run["end"]["reason"] == "fault"
    assert ended.exists()  # the other FMU was terminated


def test_two_fmus_with_modules_of_one_name_each_run_their_own(tmp_path):
    for name, value in (("first", 1.0), ("second", 2.0)):
        (tmp_path / name).mkdir()
        slave = SLAVE.format(
            name="Same", variables=PLAIN, body=f"self.y = {value}", initial="None", end=""
        )
        python_fmu_of(tmp_path / name, slave, "same")
    text = fmu_table("one", "first/Same") + fmu_table("two", "second/Same")
    found = ran(tmp_path, text)
    assert (found.haptics["one.y"][-1], found.haptics["two.y"][-1]) == (1.0, 2.0)
    assert "another module 'msame'" in found.run["isolated"]["two"]


# --- the commands from outside ------------------------------------------------------------


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_a_python_fmu_lets_go_of_its_interpreter_before_the_process_ends(tmp_path, isolate):
    """Of an FMU that holds one, as pythonfmu's library does."""
    with zipfile.ZipFile(hostile_fmu(tmp_path, "2", "-DPYTHON"), "a") as archive:
        archive.writestr("resources/slavemodule.txt", "one")
        archive.writestr("resources/one.py", "")
    path = scene(tmp_path, fmu_table("one", "hostile", isolate))
    log = tmp_path / "log"
    assert process(path, tmp_path / "out", **{HOSTILE_LOG: str(log)}).returncode == 0
    assert log.read_text().splitlines() == ["terminate", "free", "unloaded after its interpreter"]


@pytest.mark.parametrize("command", ["run", "run isolated", "sweep"])
def test_threads_that_an_fmu_leaves_running_keep_no_process(tmp_path, command):
    """Python waits for them before it ends."""
    wait = "__import__('threading').Thread(target=__import__('time').sleep, args=[600]).start()"
    python_fmu(tmp_path, "Bad", f"self.steps > 1 or {wait}")
    path = scene(tmp_path, fmu_table("one", "Bad", ISOLATED * ("isolated" in command)))
    arguments = [command.split()[0], str(path), "--out", str(tmp_path / "out")]
    arguments += ["--vary", "duration=0.1,0.2", "--jobs", "2"] if command == "sweep" else []
    command_line = [*COMMAND, *arguments]
    ended = subprocess.run(command_line, capture_output=True, timeout=60, text=True, check=False)
    begun = r"scene: sweep(, up to \d+ s before)?\n" if command == "sweep" else ""
    assert ended.returncode == 0
    assert re.fullmatch(begun, ended.stderr)
    assert ended.stdout.startswith("scene: ")


@pytest.mark.parametrize(
    ("body", "isolate"),
    [("raise RuntimeError('stuck brake')", ISOLATED), ("raise SystemExit(3)", "")],
)
def test_an_exception_in_terminate_is_told_after_the_last_row(tmp_path, body, isolate):
    """Two of them: after a fatal error an FMU is not even freed, and the next is terminated. In a
    process of its own, as it once ended by SIGSEGV, with nothing on stderr."""
    python_fmu(tmp_path, "Bad", end=body)
    one = fmu_table("one", "Bad", isolate)
    path, out = scene(tmp_path, one + one.replace("one", "two")), tmp_path / "out"
    (ended,) = hapticlink(tmp_path, f"hapticlink run {path} --no-figures --out {out}")
    assert ended.status == 1
    assert "hapticlink: two: fmi2Terminate returned fatal at t = 0.5 s" in ended.said
    assert body[6:18] in ended.said
    found = read_results.load(out)
    assert (found.run["end"]["reason"], found.haptics["time"][-1]) == ("fault", 0.5)


def test_a_process_that_dies_in_terminate_is_told(tmp_path):
    python_fmu(tmp_path, "Bad", end="__import__('os')._exit(3)")
    experiment, found = run(tmp_path, fmu_table("one", "Bad", ISOLATED))
    said = str(experiment.outcome.fault)
    assert said == "one: its process ended with exit status 3 at t = 0.5 s"
    assert found.haptics["time"][-1] == 0.5


@pytest.mark.parametrize(
    ("crash", "status"),
    [
        ("__import__('os')._exit(139)", 139),
        ("__import__('os')._exit(0)", 1),  # no good end
        ("__import__('os').abort()", -signal.SIGABRT),
        ("__import__('os').kill(__import__('os').getpid(), 9)", -signal.SIGKILL),
    ],
)
def test_a_crash_of_the_whole_run_loses_no_row_and_leaves_no_folder(tmp_path, crash, status):
    python_fmu(tmp_path, "Dies", f"self.y = time + size\n        if time >= 2.0: {crash}")
    path, out = scene(tmp_path, fmu_table("one", "Dies"), duration=5), tmp_path / "out"
    # Its end is that of the process beside it, which holds the same stream.
    ended = process(path, out)
    assert ended.returncode == status
    assert "isolate = true" in ended.stderr
    found = read_results.load(out)
    np.testing.assert_array_equal(found.haptics["time"], np.arange(2 * 64 + 1) / 64)
    np.testing.assert_array_equal(found.haptics["one.y"][1:], found.haptics["time"][1:])
    assert found.run["end"] == {"reason": "fault", "time": 2.0}
    assert found.run["fault"]["kind"] == "Crash"
    assert found.run["recovered"] == {"haptics": {"rows": 2 * 64 + 1, "time": 2.0}}
    assert {p.name for p in out.iterdir()} == {"run.json", "haptics.csv"}
    assert not folders()


FOLDERS = "import hapticlink.orchestrator.base.temporary_folders as folders"
RUNS_LATER = {
    "a command": [*COMMAND, "--version"],
    "a script": [
        *(sys.executable, "-c"),
        f"{FOLDERS}\nwith folders.temporary_folder(): pass",
    ],
}


@pytest.mark.parametrize("later", RUNS_LATER.values(), ids=RUNS_LATER)
def test_what_runs_later_removes_the_folders_of_dead_processes_and_no_others(later):
    own = Path(temporary_folders.make_folder())
    kill = "__import__('os').kill(__import__('os').getpid(), 9)"
    made = f"{FOLDERS}; print(folders.make_folder(), flush=True); {kill}"
    script = [sys.executable, "-c", made]
    dead = Path(subprocess.run(script, capture_output=True, text=True, check=False).stdout.strip())
    elsewhere = dead.with_name(f"hapticlink-elsewhere-{dead.name[20:]}")
    elsewhere.mkdir()
    assert dead.is_dir()
    subprocess.run(later, check=True, capture_output=True)
    assert not dead.exists()
    for other in (own, elsewhere):
        other.rmdir()


@pytest.mark.parametrize(("number", "isolate"), [(signal.SIGINT, ""), (signal.SIGTERM, ISOLATED)])
def test_a_signal_keeps_results_and_exits_with_1(tmp_path, number, isolate):
    started = tmp_path / "started"
    body = f"""__import__('time').sleep(0.01)
        if time > 0.3 and self.steps % 10 == 0:
            with open({str(started)!r} + 'ing', 'w') as file:
                print(__import__('os').getpid(), file=file)
            __import__('os').replace({str(started)!r} + 'ing', {str(started)!r})"""
    python_fmu(tmp_path, "Slow", body)
    path = scene(tmp_path, fmu_table("one", "Slow", isolate), duration=100)
    out = tmp_path / "out"
    with subprocess.Popen([*RUN, path, "--out", out], stderr=subprocess.PIPE) as running:
        waited_for(started.exists)
        running.send_signal(number)
        _, said = running.communicate(timeout=60)
    assert running.returncode == 1
    assert b"interrupted at t = " in said
    with pytest.raises(ProcessLookupError):  # the FMU's, when it has one of its own
        os.kill(int(started.read_text()), 0)
    found = read_results.load(out)
    assert found.run["end"]["reason"] == "interrupted"
    assert found.haptics["time"][-1] == found.run["end"]["time"] >= 0.3


def test_a_full_disk_keeps_whole_rows_and_exits_with_1(tmp_path):
    most = 40_000
    limit = f"__import__('resource').setrlimit({resource.RLIMIT_FSIZE}, ({most}, {most}))"
    python_fmu(tmp_path, "Fine", f"self.y = 1 / 3 + time; self.steps == 1 and {limit}")
    path = scene(tmp_path, fmu_table("one", "Fine"), duration=60)
    ended, out = process(path, tmp_path / "out"), tmp_path / "out"
    assert ended.returncode == 1
    assert "File too large" in ended.stderr
    assert "Traceback" not in ended.stderr
    found = read_results.load(out)
    assert found.run["end"]["time"] == found.haptics["time"][-1]
    rows = found.haptics["time"]
    np.testing.assert_array_equal(rows, np.arange(len(rows)) / 64)
    assert (out / "haptics.rows").stat().st_size > most - 100
    assert not list(out.glob(".*"))


FILLS = """
        if self.steps == {step}:
            import contextlib
            with contextlib.suppress(OSError), open({filler!r}, "wb", buffering=0) as file:
                while file.write(bytes(4096)):
                    pass"""


@pytest.mark.skipif(shutil.which("unshare") is None, reason="no disk of one's own")
@pytest.mark.parametrize("step", [50, 320])
def test_run_json_tells_how_a_run_ended_whose_disk_is_full(tmp_path, step):
    """A disk of 768 kB that fills up before any row is written, and with the last."""
    disk = tmp_path / "disk"
    disk.mkdir()
    body = "self.y = 1 / 3 + time" + FILLS.format(step=step, filler=str(disk / "filler"))
    python_fmu(tmp_path, "Fine", body)
    path = scene(tmp_path, fmu_table("one", "Fine"), duration=5)
    mount, told = f"mount -t tmpfs -o size=768k tmpfs {disk}", "No space left on device"
    if subprocess.run(["unshare", "-rm", "sh", "-c", mount], check=False).returncode:
        pytest.skip("no disk of one's own")
    out = disk / "out"
    command = f"{mount}; {' '.join(RUN)} {path} --out {out}; echo $?"
    command += f"; cp -r {out} {tmp_path}"
    shell = ["unshare", "-rm", "sh", "-c", command]
    ended = subprocess.run(shell, capture_output=True, check=False)
    assert ended.stdout.splitlines()[-1] == b"1", ended.stderr
    assert told.encode() in ended.stderr
    found = read_results.load(tmp_path / "out")
    assert found.run["end"]["reason"] == "fault"
    assert told in found.run["fault"]["message"]
    assert found.run["end"]["time"] == found.haptics["time"][-1]
    assert found.run["calls"]["one"]["step"] > 0


@pytest.mark.parametrize("gone", [".py", "slavemodule.txt"])
def test_a_python_fmu_without_its_module_is_told(tmp_path, gone):
    """The libraries of pythonfmu crash the process."""
    edited_entries(python_fmu(tmp_path, "Bare"), lambda entries: {
        name: each for name, each in entries.items()
        if not name.startswith("resources/") or not name.endswith(gone)
    })  # fmt: skip
    said = "could not be loaded: resources/slavemodule.txt names no module beside it; build"
    assert said in fault(tmp_path, fmu_table("one", "Bare"))


def test_a_connection_to_one_entry_of_a_fed_vector_is_refused(tmp_path):
    python_fmu(tmp_path, "Gives")
    text = 'extends = "closed-loop-ideal"\n' + fmu_table("one", "Gives")
    (tmp_path / "scene.toml").write_text(text + wire_table("one.y", "controller.x_D[1]"))
    with pytest.raises(InputFault, match=r"line 7: .*x_D lose their source, haptic_device.x"):
        simulate(str(tmp_path / "scene.toml"), tmp_path / "out")


CLOSES = "import os, time as clock; clock.sleep(0.3); os.closerange(3, 64)"


@pytest.mark.parametrize("lines", ["", 'record.format = "rows"\n'])
def test_an_fmu_that_closes_the_files_of_a_run_loses_no_row(tmp_path, lines):
    """Among them the pipe by which a process beside the run knows that the run has ended."""
    python_fmu(tmp_path, "Closes", f"{CLOSES}; self.y = time + size")
    path = scene(tmp_path, lines + fmu_table("one", "Closes"), rate=8, duration=1.0)
    ended = process(path, tmp_path / "out")
    assert (ended.returncode, "Traceback" in ended.stderr) == (0, False), ended.stderr
    assert "closed files of this process that it had not opened" in ended.stderr
    found = read_results.load(tmp_path / "out")
    assert found.haptics["one.y"].tolist() == (np.arange(9) / 8).tolist()


def test_rows_that_are_lost_are_told(tmp_path):
    """An FMU puts a table without rows in the place of the one that is being written."""
    body = f"""
        from pathlib import Path
        from hapticlink.orchestrator.results.rows_file import write_empty
        rows = Path({str(tmp_path / "out" / "haptics.rows")!r})
        rows.unlink()
        write_empty(rows, ("time", "one.y", "one.steps"), False)"""
    python_fmu(tmp_path, "Replaces", body.strip())
    said = fault(tmp_path, fmu_table("one", "Replaces"))
    assert "haptics.csv: 0 rows, where 33 were recorded: somebody else wrote there" in said
