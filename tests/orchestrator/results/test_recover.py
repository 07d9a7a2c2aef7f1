"""A run that is killed loses no row, and long runs keep nothing in memory."""

import json
import resource
import signal
import subprocess

import numpy as np
import pytest

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.results.recover import Recovered, recover
from hapticlink.orchestrator.results.rows_file import RowsBeingWritten, RowsFile, write_empty
from hapticlink.orchestrator.results.run_results import TableRows
from hapticlink.orchestrator.results.write_files import FileRecorder
from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import hostile_fmu
from tests.orchestrator.foreign_scenes import COMMAND, ISOLATED, RUN, fmu_table, scene
from tests.orchestrator.results.records import run_json

LAST = 3.5


def test_a_run_that_is_killed_keeps_every_row(tmp_path):
    """From outside, with all FMUs of others in processes of their own, where no watchdog is, and
    before the first block of rows was full. By an FMU: run/test_faults.py."""
    body = f"if time >= {LAST}: __import__('time').sleep(1000)"
    python_fmu(tmp_path, "Hangs", f"self.y = time + size\n        {body}")
    path, out = scene(tmp_path, fmu_table("one", "Hangs", ISOLATED), duration=5), tmp_path / "out"
    with subprocess.Popen([*RUN, path, "--out", out], stderr=subprocess.DEVNULL) as running:
        while not (table := out / "haptics.rows").exists() or (
            len(RowsFile(table)) < LAST * 64 + 1
        ):
            assert running.poll() is None
        with pytest.raises(InputFault, match=f"its run goes on, in process {running.pid}"):
            recover(out)
        running.send_signal(signal.SIGKILL)
    assert subprocess.run([*COMMAND, "recover", out], check=True, capture_output=True)
    run = json.loads((out / "run.json").read_text())
    assert run["recovered"] == {"haptics": {"rows": LAST * 64 + 1, "time": LAST}}
    assert run["end"] == {"reason": "fault", "time": LAST}
    assert run["fault"]["kind"] == "Killed"
    assert {p.name for p in out.iterdir()} == {"run.json", "haptics.csv"}
    table = read_results.load(out).haptics
    np.testing.assert_array_equal(table["time"], np.arange(LAST * 64 + 1) / 64)


def test_a_row_that_is_in_part_on_the_disk(tmp_path):
    """The process is killed while it writes a row, or the machine fails before all are written."""
    values = np.zeros(2)
    rows = TableRows({"a": 0, "b": 1}, values, end=9)
    recorder = FileRecorder(tmp_path / "haptics.csv", rows, lambda: None)
    recorder.publish()
    for k in range(5):
        values[:] = k, -k
        recorder.row(k / 8)
    recorder.rows[5, 0] = 5 / 8
    expected = [[k / 8, k, -k] for k in range(5)]
    assert RowsFile(recorder.target)[:].tolist() == expected
    recorder.__exit__()
    assert recorder.target.stat().st_size == 24 + 5 * 24
    with recorder.target.open("rb+") as file:
        file.truncate(24 + 2 * 24 + 7)
    assert RowsFile(recorder.target)[:].tolist() == expected[:2]
    run = run_json(rates=["haptics"], files=["haptics.csv"])
    (tmp_path / "run.json").write_text(json.dumps(run))
    assert recover(tmp_path) == {"haptics": Recovered(2, 1 / 8)}
    assert recover(tmp_path) == {}


def test_memory_does_not_grow_with_the_run(tmp_path):
    """Two more minutes at 4096 Hz are 12 MB of rows; the largest memory of the process grows by a
    fraction of that."""
    hostile_fmu(tmp_path)
    path, peaks = scene(tmp_path, fmu_table("one", "hostile"), rate=4096), []
    for seconds in (60, 180):
        ended = simulate(str(path), tmp_path / "out", [f"duration={seconds}"])
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)  # kB
        assert ended.outcome.fault is None
        assert ended.outcome.end_time == seconds
    assert peaks[1] - peaks[0] < 3e3


def test_a_file_of_more_rows_than_any_file_can_have(tmp_path):
    """As of a run of 30 years that its `stop_when` ends: it has room for as many as a file can
    have, and one that has no more room says so."""
    table = RowsBeingWritten(tmp_path / "haptics.rows", ("time", "y"), 10**15)
    assert len(table.rows) > 10**6
    table.rows[0], table.filled.value = (0.0, 1.0), 1
    table.close()
    assert RowsFile(tmp_path / "haptics.rows")[:].tolist() == [[0.0, 1.0]]
    full = RowsBeingWritten(tmp_path / "graphics.rows", ("time", "y"), 2)
    assert full.reserved == 2
    with pytest.raises(OSError, match="File too large"):
        full.reserve()
    full.close()


def test_a_table_without_a_row_is_recovered(tmp_path):
    """As on Windows, where a table has its name before its first row."""
    run = run_json(rates=["haptics"], files=["haptics.csv"])
    (tmp_path / "run.json").write_text(json.dumps(run))
    write_empty(tmp_path / "haptics.rows", ("time", "y"), as_csv=False)
    assert recover(tmp_path, ended=True) == {"haptics": Recovered(0, 0.0)}


@pytest.mark.parametrize(
    "content",
    [b"", b"\n", bytes(100), b"y,z\n" + bytes(100), b'"' + bytes(100), b"\xff\xfe\n" + bytes(100)],
    ids=["empty", "no name", "zeros", "no time", "no end", "no text"],
)
def test_rows_whose_header_is_damaged_are_refused_and_stay(tmp_path, content):
    (tmp_path / "haptics.rows").write_bytes(content)
    run = run_json(rates=["haptics"], files=["haptics.csv"])
    (tmp_path / "run.json").write_text(json.dumps(run))
    with pytest.raises(InputFault, match=r"haptics\.rows: its (header|first column)"):
        recover(tmp_path, ended=True)
    assert (tmp_path / "haptics.rows").read_bytes() == content


@pytest.mark.parametrize("lost", [0.0, np.nan, np.inf])
def test_rows_behind_a_damaged_one_stay_where_they_are(tmp_path, lost):
    """A block of the file that never came to the disk is one of zeros."""
    table = RowsBeingWritten(tmp_path / "haptics.rows", ("time", "y"), 20_000)
    table.rows[:, 0], table.filled.value = np.arange(len(table.rows)), 20_000
    table.rows[15_000:15_010, 0] = lost
    table.close()
    run = run_json(rates=["haptics"], files=["haptics.csv"])
    (tmp_path / "run.json").write_text(json.dumps(run))
    assert recover(tmp_path, ended=True) == {"haptics": Recovered(15_000, 14_999, 5_000)}
    assert len(RowsFile(tmp_path / "haptics.rows")) == 20_000
    assert read_results.load(tmp_path).haptics["time"][-1] == 14_999
