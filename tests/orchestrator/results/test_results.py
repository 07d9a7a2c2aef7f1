"""CSV files give back the very floats."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.results.files import Recorder, write_json, write_over
from hapticlink.orchestrator.results.tables import Table, load, read_table


def recorder_of(path: Path, columns: list[str], view: Any) -> Recorder:
    """One whose file is in its place from the first row on."""
    made = Recorder(path, columns, view, lambda: made.publish())
    return made


@given(st.lists(st.floats(allow_nan=False), min_size=3, max_size=3))
def test_every_float_reads_back_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, values: list[float]
) -> None:
    path = tmp_path_factory.getbasetemp() / "floats.csv"
    with recorder_of(path, ["a.x", "a.P[1,1]", "a.P[1,2]"], np.array(values)) as recorder:
        recorder.row(1 / 3)
    table = read_table(path)
    assert table["time"].tolist() == [1 / 3]
    assert [float(v).hex() for v in (table["a.x"][0], *table["a.P"].ravel())] == [
        v.hex() for v in values
    ]


def test_rows_are_on_disk_before_the_end_and_after_an_exception(tmp_path: Path) -> None:
    path, view = tmp_path / "rows.csv", np.zeros(1)

    def record_and_break() -> None:
        with recorder_of(path, ["y"], view) as recorder:
            for k in range(5):
                view[0] = k
                recorder.row(k / 512)
                assert len(read_table(path)["y"]) == k + 1
            raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        record_and_break()
    assert read_table(path)["y"].tolist() == list(range(5))


def test_vectors_and_matrices_stack(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    columns = [f"e.L[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)]
    with recorder_of(path, columns, np.arange(6.0)) as recorder:
        recorder.row(0.0)
    assert read_table(path)["e.L"].tolist() == [[[0, 1, 2], [3, 4, 5]]]
    with pytest.raises(KeyError, match=r"no signal 'e.K'"):
        read_table(path)["e.K"]


def test_entries_stack_by_their_indices() -> None:
    """Some tools count from 0, or write x[10] before x[2]; others put brackets in any name."""
    names = (
        "a[1]",
        "a[0]",
        "b[1]",
        "b[3]",
        "c[0,0]",
        "c[0,1]",
        "c[1,0]",
        "c[1,1]",
        "d[1].e",
        "d[x]",
    )
    found = Table(names, np.arange(20.0).reshape(2, 10))
    assert found["a"].tolist() == [[1.0, 0.0], [11.0, 10.0]]
    assert found["b"].tolist() == [[2.0, 3.0], [12.0, 13.0]]
    assert found["c"][1].tolist() == [[14.0, 15.0], [16.0, 17.0]]
    assert "d" not in found


def test_nan_is_written_as_such(tmp_path: Path) -> None:
    with recorder_of(tmp_path / "n.csv", ["y"], np.array([math.nan])) as recorder:
        recorder.row(0.0)
    assert math.isnan(read_table(tmp_path / "n.csv")["y"][0])


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFault, match="not the folder of a run"):
        load(tmp_path)


def test_the_end_of_a_run_is_written_over_what_is_there(tmp_path: Path) -> None:
    """The first that fits, on no more bytes than there were; where none fits, all stays."""
    path = tmp_path / "run.json"
    write_json(path, {"end": "running"}, room=100)
    size = path.stat().st_size
    for contents, found in (
        ([{"end": "x" * 200}, {"end": "fault"}], "fault"),
        ([{"end": "done", "more": "y" * 50}, {"end": "fault"}], "done"),
        ([{"end": "x" * 200}], "done"),
    ):
        write_over(path, *contents)
        assert path.stat().st_size == size
        assert json.loads(path.read_text())["end"] == found
