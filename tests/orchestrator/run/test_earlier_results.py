"""Results of an earlier run in the same folder go when the first rows of the next one are there."""

import json
import math
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import read_results
from tests.little_fmus import edited, edited_entries, slave
from tests.orchestrator.c_fmus import hostile_fmu
from tests.orchestrator.foreign_scenes import fmu_table, run, scene
from tests.shared_fixtures import status

ONE = fmu_table("one", "hostile")


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def flipped(folder: Path) -> None:
    """A byte in the middle of the binary, which no directory of the archive knows."""
    path = hostile_fmu(folder)
    content = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        entry = max(archive.infolist(), key=lambda e: e.file_size)
    content[entry.header_offset + entry.file_size // 2] ^= 1
    path.write_bytes(content)


def nan_at_the_start(folder: Path) -> None:
    slave(folder, "Never", ("output", {"y": math.nan})).replace(folder / "hostile.fmu")


def of_another_guid(folder: Path) -> None:
    edited(hostile_fmu(folder), lambda text: text.replace('guid="hostile"', 'guid="another"'))


def elsewhere(folder: Path) -> None:
    edited_entries(hostile_fmu(folder), lambda entries: {
        name.replace("binaries/", "binaries/other-"): each for name, each in entries.items()
    })  # fmt: skip


@pytest.mark.parametrize(
    ("make", "exit_status", "said"),
    [
        (flipped, 2, "has another checksum"),
        (elsewhere, 2, "no binary for this platform"),
        (of_another_guid, 1, "its guid may not be that"),
        (nan_at_the_start, 1, "output y is nan at t = 0 s"),
    ],
    ids=["damaged entry", "other platform", "other guid", "fault before the first row"],
)
def test_what_fails_before_its_first_row_takes_nothing(tmp_path, make, exit_status, said, capsys):
    hostile_fmu(tmp_path)
    path, out = scene(tmp_path, ONE), tmp_path / "out"
    assert status("run", path, "--no-figures", "--out", out) == 0
    before = files(out)
    make(tmp_path)
    assert status("run", path, "--no-figures", "--out", out) == exit_status
    assert said in capsys.readouterr().err
    assert files(out) == before


def test_without_an_earlier_row_the_fault_stands_in_run_json(tmp_path):
    nan_at_the_start(tmp_path)
    for _ in range(2):  # the second finds the first, which has no row
        experiment, _ = run(tmp_path, ONE)
        assert experiment.outcome.published
        found = read_results.load(tmp_path / "out")
        assert found.run["fault"]["message"] == "one: output y is nan at t = 0 s"
        assert found.haptics["one.y"].tolist() == []


def test_results_of_a_run_without_rows_are_not_those_of_another(tmp_path):
    hostile_fmu(tmp_path)
    run(tmp_path, ONE)
    nan_at_the_start(tmp_path)
    experiment, found = run(tmp_path, ONE)
    assert not experiment.outcome.published
    assert found.run["end"] == {"reason": "fault", "time": 0.0}
    assert found.haptics["one.y"].tolist() == []
    assert read_results.load(tmp_path / "out").run["end"]["reason"] == "duration"


def test_json_of_a_run_without_rows_tells_its_fault(tmp_path, capsys):
    """Its folder keeps those of the earlier run, and with them an earlier run.json."""
    hostile_fmu(tmp_path)
    path, out = scene(tmp_path, ONE), tmp_path / "out"
    assert status("run", path, "--no-figures", "--out", out, "--quiet") == 0
    nan_at_the_start(tmp_path)
    assert status("run", path, "--out", out, "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert told["fault"]["message"] == "one: output y is nan at t = 0 s"


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_a_disk_without_room_for_a_row_keeps_the_earlier_ones(tmp_path):
    """No file may grow beyond 16 kB: the FMU is unpacked, the first row is written, and run.json,
    which keeps room for its end, does not fit."""
    hostile_fmu(tmp_path)
    path, out = scene(tmp_path, ONE), tmp_path / "out"
    simulate(str(path), out)
    before = files(out)
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (2**14, 2**14))\n"
    code = limit + "import sys; from hapticlink.__main__ import main; main()"
    command = [sys.executable, "-c", code, "run", path, "--no-figures", "--out", out]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert f"{out / 'run.json'}: File too large\n" in ended.stderr
    assert files(out) == before


def test_links_are_replaced_not_followed(bar, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    out.mkdir()
    other.write_text("mine")
    files = ("haptics.csv", "run.json", "plan.txt", "mechanism.png")
    for name in (*files, f".haptics.csv.{os.getpid()}"):
        (out / name).symlink_to(other)
    assert status("run", bar, "--out", out) == 0
    assert other.read_text() == "mine"
    assert {p.name for p in out.iterdir() if not p.is_symlink()} == set(files)
    assert json.loads((out / "run.json").read_text())["end"]["reason"] == "duration"
