"""CSV files preserve every double exactly."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator.results.read_results import read_table
from hapticlink.orchestrator.results.run_results import TableRows
from hapticlink.orchestrator.results.write_files import (
    FileRecorder,
    text,
    write_atomically,
    write_over,
)


def recorder_of(path: Path, columns: list[str], view: Any) -> FileRecorder:
    """One whose file is in its place from the first row on."""
    rows = TableRows({name: i for i, name in enumerate(columns)}, view, end=9)
    made = FileRecorder(path, rows, lambda: made.publish())
    return made


@given(st.lists(st.floats(), min_size=3, max_size=3))
def test_every_float_reads_back_to_the_bit(tmp_path_factory, values):
    path = tmp_path_factory.getbasetemp() / "floats.csv"
    with recorder_of(path, ["a.x", "a.P[1,1]", "a.P[1,2]"], np.array(values)) as recorder:
        recorder.row(1 / 3)
    table = read_table(path)
    assert table["time"].tolist() == [1 / 3]
    found = (table["a.x"][0], *table["a.P"].ravel())
    assert [float(v).hex() for v in found] == [v.hex() for v in values]


def test_rows_are_on_disk_before_the_end_and_after_an_exception(tmp_path):
    path, view = tmp_path / "rows.csv", np.zeros(1)

    def record_and_break():
        with recorder_of(path, ["y"], view) as recorder:
            for k in range(5):
                view[0] = k
                recorder.row(k / 512)
                assert len(read_table(path)["y"]) == k + 1
            raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        record_and_break()
    assert read_table(path)["y"].tolist() == list(range(5))


@pytest.mark.parametrize(
    ("columns", "value"),
    [
        (["a.x[0]", "a.x[1]", "a.x[2]"], [0, 1, 2]),  # tools that count from 0
        (["a.x[10]", *(f"a.x[{i}]" for i in range(1, 10))], [*range(1, 10), 0]),
        (["a.x[1,1]", "a.x[2,1]", "a.x[1,2]", "a.x[2,2]"], [[0, 2], [1, 3]]),  # column by column
        (["a.x[3]", "a.x[1]"], [1, 0]),  # a gap
        (["a.x[1,1]", "a.x[2,2]"], [0, 1]),
        (["a.x", "a.x[1]"], 0),
        ([f"a.x[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)], [[0, 1, 2], [3, 4, 5]]),
    ],
)
def test_entries_stack_by_their_indices(tmp_path, columns, value):
    path = tmp_path / "x.csv"
    with recorder_of(path, columns, np.arange(float(len(columns)))) as recorder:
        recorder.row(0.0)
        recorder.row(1.0)
    found = read_table(path)["a.x"]
    assert found.shape[0] == 2
    assert found[1].tolist() == value
    with pytest.raises(KeyError, match=r"no signal 'a.y'"):
        read_table(path)["a.y"]


def test_arrays_of_records_have_their_own_names(tmp_path):
    path = tmp_path / "x.csv"
    with recorder_of(path, ["a.leg[1].x[1]", "a.leg[1].x[2]", "a.leg[2].y"], np.arange(3.0)) as r:
        r.row(0.0)
    table = read_table(path)
    assert table.signals == ("time", "a.leg[1].x", "a.leg[2].y")
    assert [table[name].tolist() for name in table.signals] == [[0], [[0, 1]], [2]]
    assert "a.leg" not in table


def test_the_end_of_a_run_is_written_over_what_is_there(tmp_path):
    """The first that fits, on no more bytes than there were; where none fits, all stays."""
    path = tmp_path / "run.json"
    write_atomically(path, text({"end": "running"}) + b" " * 100)
    size = path.stat().st_size
    for contents, found in (
        ([{"end": "x" * 200}, {"end": "fault"}], "fault"),
        ([{"end": "done", "more": "y" * 50}, {"end": "fault"}], "done"),
        ([{"end": "x" * 200}], "done"),
    ):
        write_over(path, *contents)
        assert path.stat().st_size == size
        assert json.loads(path.read_text())["end"] == found
