"""What may become of a run's folder while the run writes to it, and what a killed one leaves."""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.orchestrator.results import read_results


def of_first_step(act: Callable[[Path], object], out: Path) -> hl.Run:
    """A run whose progress does something to its folder after the first row."""
    acts = [act]
    return hl.run(
        "pendulum", {"duration": 30}, out=out, figures=False,
        progress=lambda time: acts.pop()(out) if acts and time > 0.0 else None,
    )  # fmt: skip


def no_file(out: Path) -> None:
    (out / "run.json").unlink()
    (out / "run.json").mkdir()


@pytest.mark.parametrize(("act", "file"), [(shutil.rmtree, "haptics.rows"), (no_file, "run.json")])
def test_a_record_that_cannot_be_written_at_the_end_is_a_fault_by_its_file(tmp_path, act, file):
    """It is no bad input, as what another run has left."""
    out = tmp_path / "out"
    with pytest.raises(hl.Fault, match=f"^{out}/{file}: (No such file|Is a directory)") as told:
        of_first_step(act, out)
    assert told.value.exit_status == 1


def test_no_memory_is_a_fault_of_the_run(tmp_path):
    def full(out: Path) -> None:
        raise MemoryError("Unable to allocate 21 GiB")

    made = of_first_step(full, tmp_path / "out")
    assert "there is not enough memory (Unable to allocate 21 GiB): " in str(made.fault)
    assert read_results.load(tmp_path / "out").haptics["time"][-1] > 0.0


def test_what_a_killed_run_was_writing_goes_with_the_next_one(tmp_path):
    """As with SIGALRM of an FMU while the CSV is made; nothing of a user's own."""
    with subprocess.Popen(["true"]) as ended:
        pass
    theirs = [f".haptics.{ended.pid}.{'0' * 32}.csv", f".haptics.rows.{ended.pid}"]
    mine = [".hidden", f".notes.{ended.pid}", f".a.{os.getpid()}.{'0' * 32}.csv"]
    for name in (*theirs, *mine):
        (tmp_path / name).touch()
    hl.run("pendulum", {"duration": 0.1}, out=tmp_path, figures=False)
    assert {path.name for path in tmp_path.glob(".*")} == {*mine}
