"""Two runs into one folder: the second gets an error at once, and nothing of the first is lost."""

import json
import subprocess
import sys
import threading

import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import folder_lock, read_results
from tests.orchestrator.foreign_scenes import RUN as COMMAND
from tests.orchestrator.foreign_scenes import process
from tests.shared_fixtures import status


def test_a_second_run_is_refused_at_once(tmp_path):
    refusals: list[str] = []

    def second(time):
        if refusals:
            return
        refusals.append(process("pendulum", out).stderr)

    out = tmp_path / "out"
    first = hl.run("pendulum", {"duration": 20}, out=out, figures=False, progress=second)
    assert f"--out {out}: another run writes there, in process" in refusals[0]
    assert first.run["end"]["reason"] == "duration"
    assert read_results.load(out).haptics["time"][-1] == first.run["end"]["time"] == 20
    assert status("run", "pendulum", "--out", out, "--no-figures") == 0  # afterwards


def test_a_thread_of_this_process_is_refused_too(tmp_path):
    outcomes: list[object] = []

    def run():
        try:
            outcomes.append(simulate("pendulum", tmp_path / "out").outcome.reason)
        except InputFault as fault:
            outcomes.append(str(fault))

    with folder_lock.lock_folder(tmp_path / "out"):
        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
        assert "another run writes there" in str(outcomes[0])
        ours = simulate("pendulum", tmp_path / "out", locked=True)
        assert ours.outcome.reason == "duration"


def test_a_run_from_the_progress_of_another_is_refused_too(tmp_path):
    """Of the same thread: it would take the place of the tables that the first one writes."""
    out, refusals = tmp_path / "out", list[str]()

    def nested(time):
        if not refusals:
            with pytest.raises(InputFault, match="another run writes there") as refused:
                hl.run("pendulum", {"duration": 0.1}, out=out, figures=False)
            refusals.append(str(refused.value))

    made = hl.run("pendulum", {"duration": 20}, out=out, figures=False, progress=nested)
    assert refusals
    assert made.fault is None
    assert read_results.load(out).haptics["time"][-1] == 20


@pytest.mark.parametrize("wrong", [{"duration": -1}, {"stop_when": "no.such > 1"}])
def test_a_refused_run_leaves_no_folder(tmp_path, wrong):
    with pytest.raises(InputFault):
        hl.run("pendulum", wrong, out=tmp_path / "runs" / "out")
    assert not [*tmp_path.iterdir()]


def test_a_killed_run_leaves_no_lock(tmp_path):
    lines = (
        "from pathlib import Path; import os",
        "from hapticlink.orchestrator.results.folder_lock import lock_folder",
        f"lock_folder(Path({str(tmp_path)!r})).__enter__(); os.kill(os.getpid(), 9)",
    )
    killed = subprocess.run([sys.executable, "-c", "\n".join(lines)], check=False)
    assert killed.returncode == -9
    with folder_lock.lock_folder(tmp_path):
        assert not [*tmp_path.iterdir()]


def test_many_at_once_leave_one_whole_run(tmp_path):
    command = [*COMMAND, "pendulum", "--out", str(tmp_path / "o")]
    started = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    ends = [(process.communicate()[1], process.returncode) for process in started]
    assert all(code in (0, 2) for _, code in ends), ends
    assert all("another run writes there" in said for said, code in ends if code == 2)
    assert any(code == 0 for _, code in ends)
    story = json.loads((tmp_path / "o" / "run.json").read_text())
    assert {p.name for p in (tmp_path / "o").iterdir()} == set(story["files"])
    assert read_results.load(tmp_path / "o").haptics["time"][-1] == story["end"]["time"]
