"""Ctrl-C and SIGTERM: held while FMUs load and run; a second one ends at once, whatever hangs."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import Interrupted
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.results.rows_file import RowsFile
from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import hostile_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, RUN, fmu_table, scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")


@pytest.fixture(autouse=True)
def crash_monitor_of_runs():
    """Runs start their watchdog."""


PATIENT = "[faults]\ntimeout = 1000.0\n"


def waited_for(come: Callable[[], object], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not come() and time.monotonic() < until:
        time.sleep(0.01)
    assert come()


@pytest.fixture(autouse=True)
def _nothing_left_behind(own_temporary_folder):
    handlers = [signal.getsignal(s) for s in interrupt.SIGNALS]
    yield
    assert not [*Path(tempfile.gettempdir()).glob("hapticlink-*")]
    assert [signal.getsignal(s) for s in interrupt.SIGNALS] == handlers


INTERRUPTED = """
import os, signal, hapticlink.orchestrator.open_scene as s
load = s.load
def interrupted(*a, **k):
    s.load = load
    os.kill(os.getpid(), signal.SIGINT)
    return load(*a, **k)
s.load = interrupted
from hapticlink.__main__ import main
main()
"""


def test_a_signal_before_the_run_says_so(bar, tmp_path):
    """While the scene is read; it is held, so that no import loses it."""
    command = [sys.executable, "-c", INTERRUPTED, "run", str(bar), "--out", str(tmp_path / "out")]
    ended = subprocess.run(command, capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (1, b"hapticlink: interrupted before the run\n")
    assert not (tmp_path / "out").exists()


def test_a_signal_during_a_build_speaks_of_no_run(bar, tmp_path):
    command = [sys.executable, "-c", INTERRUPTED, "build", str(bar), "--out", str(tmp_path / "out")]
    environment = os.environ | {"HAPTICLINK_CACHE": "off"}
    ended = subprocess.run(command, capture_output=True, check=False, env=environment)
    said = b"hapticlink: interrupted (out: building its FMUs)"
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (1, said)


def children(pid: int) -> list[str]:
    """The processes that a process has started, where there is /proc."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    found = []
    for task in tasks:
        with suppress(FileNotFoundError, ProcessLookupError):  # the thread has ended meanwhile
            found += task.read_text().split()
    return found


def workers(pid: int) -> list[bytes]:
    """Command lines of the worker processes that a process has."""
    found = []
    for child in children(pid):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            found.append(Path(f"/proc/{child}/cmdline").read_bytes())
    return [line for line in found if b"orchestrator.fmi.worker" in line]


@pytest.mark.skipif(sys.platform != "linux", reason="finds the processes of a process in /proc")
def test_a_signal_while_isolated_fmus_load_is_no_fault_of_theirs(tmp_path):
    """As in a terminal, the signal goes to the whole group, and the worker is at its imports."""
    python_fmu(tmp_path, "Slow", "__import__('time').sleep(0.01)")
    path = scene(tmp_path, fmu_table("one", "Slow", ISOLATED), duration=100)
    command = [*RUN, path, "--out", tmp_path / "out"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, start_new_session=True) as running:
        waited_for(lambda: workers(running.pid))
        time.sleep(0.1)  # the caller waits for it by now
        os.killpg(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=60)
    assert (running.returncode, said.count(b"\n")) == (1, 1)
    assert said.startswith(b"hapticlink: interrupted ")
    assert read_results.load(tmp_path / "out").run["end"]["reason"] == "interrupted"


def rows_of(folder: Path) -> int:
    """The number of rows of a run that goes on."""
    table = folder / "haptics.rows"
    return len(RowsFile(table)) if table.exists() else 0


@pytest.mark.parametrize(
    ("name", "fmu", "more", "number"),
    [
        ("one", "Hangs", ISOLATED, signal.SIGTERM),
        ("one", "Hangs", "", signal.SIGINT),
        ("step_loop_4", "hostile", "", signal.SIGTERM),
    ],
)
def test_a_second_signal_ends_an_fmu_that_hangs(tmp_path, name, fmu, more, number):
    hostile_fmu(tmp_path)
    python_fmu(tmp_path, "Hangs", "while self.steps == 4: pass")
    out, text = tmp_path / "out", fmu_table(name, fmu, more) + PATIENT
    path = scene(tmp_path, text, duration=100)
    with subprocess.Popen([*RUN, path, "--out", out], stderr=subprocess.PIPE) as running:
        waited_for(lambda: rows_of(out) == 4)
        for _ in range(2):
            time.sleep(0.2)  # the first is taken, the FMU hangs
            assert running.poll() is None
            running.send_signal(number)
        _, said = running.communicate(timeout=60)
    assert (running.returncode, said) == (1, b"hapticlink: interrupted twice: ended at once\n")
    found = read_results.load(out)
    assert found.run["end"] == {"reason": "interrupted", "time": 3 / 64}
    assert found.run["fault"]["message"] == "interrupted at t = 0.046875 s"
    assert found.haptics["time"][-1] == 3 / 64
    assert {p.name for p in out.iterdir()} == {"run.json", "haptics.rows"}


def test_python_gets_the_second_signal_when_processes_have_ended(tmp_path):
    """What a run in Python makes of Ctrl-C is its own; the FMU that hangs does not keep it."""
    python_fmu(tmp_path, "Hangs", "if self.steps == 4: __import__('time').sleep(1000)")
    path = scene(tmp_path, fmu_table("one", "Hangs", ISOLATED) + PATIENT)

    def signals():
        waited_for(lambda: rows_of(tmp_path / "out") == 4)
        for _ in range(2):
            time.sleep(0.2)
            os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=signals)
    thread.start()
    outcome = simulate(str(path), tmp_path / "out").outcome
    thread.join()
    assert isinstance(outcome.fault, Interrupted)
    assert (outcome.reason, outcome.end_time) == ("interrupted", 3 / 64)


def test_signals_are_held_once_and_given_back(tmp_path):
    done: list[str] = []
    interrupt.add(lambda: done.append("kept"))
    gone = lambda: done.append("removed")  # noqa: E731
    interrupt.add(gone)
    interrupt.remove(gone)
    with interrupt.defer_signals(), interrupt.defer_signals():
        interrupt.raise_if_interrupted()
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Interrupted, match=r"interrupted at t = 0.5 s"):
            interrupt.raise_if_interrupted(0.5)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert done == ["kept"]
    interrupt.raise_if_interrupted()
    interrupt._actions.clear()


CHILD = """
        if self.steps == 2:
            import subprocess
            with open({pid!r}, "w") as file:
                print(subprocess.Popen(["sleep", "1000"]).pid, file=file)
        if self.steps == 4: {then}"""


@pytest.mark.parametrize(
    "then", ["pass", "__import__('os')._exit(3)", "__import__('time').sleep(1000)"]
)
def test_processes_that_an_isolated_fmu_has_started_end_with_it(tmp_path, then):
    file = tmp_path / "pid"
    python_fmu(tmp_path, "Starts", CHILD.format(pid=str(file), then=then))
    path = scene(tmp_path, fmu_table("one", "Starts", ISOLATED) + "[faults]\ntimeout = 2.0\n")
    outcome = simulate(str(path), tmp_path / "out").outcome
    assert (outcome.fault is None) == (then == "pass")
    pid = int(file.read_text())
    waited_for(lambda: not alive(pid))


def alive(pid: int) -> bool:
    """Not gone, and not a zombie that nobody has waited for."""
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:1]
    except OSError:
        return False


def test_a_second_signal_leaves_no_unfinished_file(tmp_path):
    text = f"""
import signal
from pathlib import Path
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base import interrupt
with interrupt.defer_signals(interrupt.end_process):
    with atomic_file(Path({str(tmp_path)!r}) / "whole.txt") as unfinished:
        unfinished.write_text("half")
        assert unfinished.exists()
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)
"""
    ended = subprocess.run([sys.executable, "-c", text], capture_output=True, check=False)
    assert ended.stderr == b"hapticlink: interrupted twice: ended at once\n"
    assert not [*tmp_path.iterdir()]
