"""Sweeps from Python, compared with those of the command."""

import csv
import os
import signal
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.sweep import table
from hapticlink.analysis.sweep.grid import points
from hapticlink.api.sweeps import Sweep
from hapticlink.orchestrator.results.html_table import MOST
from hapticlink.visualization.figures import sweep_figure
from tests.shared_fixtures import status


def test_values_and_texts_give_the_same_runs(tmp_path: Path) -> None:
    wanted = [{"a.b": a, "hold": h} for a in ("1", "2.5") for h in ("zoh", "foh")]
    assert points({"a.b": [1, 2.5], "hold": "zoh,foh"}, ()) == wanted
    assert points(["a.b=1,2.5", "hold=zoh,foh"], ()) == wanted
    assert points((), [{"a.b": 1, "hold": "zoh"}, {"a.b": 1, "hold": "foh"}]) == wanted[:2]
    (tmp_path / "runs.csv").write_text("a.b,hold\n1,zoh\n1,foh\n")
    assert points((), tmp_path / "runs.csv") == wanted[:2]
    assert points({"a.b": range(10, 40, 10)}, ()) == [{"a.b": v} for v in ("10", "20", "30")]


def test_a_sweep_is_that_of_the_command(
    bar: Path, tmp_path: Path, emptied_temporary_folder: Path
) -> None:
    told: list[tuple[int, int]] = []
    vary = {"hold": ["zoh", "none"], "haptics.rate": np.array([100, 200])}
    options = {"linkage.start_velocity.slide": 0.25, "duration": 0.1}
    found = hl.sweep(hl.scene(bar), vary, options, progress=lambda *done: told.append(done), jobs=1)
    assert told[0] == (2, 4)  # those refused
    assert told[-1] == (4, 4)
    assert found.folder is None
    assert not list(emptied_temporary_folder.iterdir())
    arguments = ["--set", "linkage.start_velocity.slide=0.25", "--set", "duration=0.1"]
    arguments += ["--vary", "hold=zoh,none", "--vary", "haptics.rate=100,200"]
    assert status("sweep", bar, *arguments, "--out", tmp_path, "--jobs", 1) == 0
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(found.columns) == list(rows[0])
    for name in ("end", "end_time_s", "message"):
        assert [str(r.get(name, "")) for r in found.rows] == [r[name] for r in rows]
    assert found["haptics.rate"].tolist() == [100, 200, 100, 200]
    assert found["end"].tolist() == [r["end"] for r in rows]
    assert found["end_time_s"].dtype == float
    assert len(found.failed) == sum(r["end"] == "refused" for r in rows) == 2
    assert "4 runs over hold, haptics.rate, 2 failed" in repr(found)
    (row,) = (line for line in str(found).splitlines() if line.split()[:2] == ["zoh", "200"])
    assert row.split()[2:] == ["duration", "0.1"]
    figure = found.figure("end_time_s")
    assert figure is not None
    assert figure.axes[0].get_ylabel() == "end of the run (s)"
    with pytest.raises(KeyError, match="did you mean 'end_time_s'"):
        found["end_time"]


def test_the_figure_of_a_finished_sweep_is_drawn_again_only_where_it_differs(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vary, figure = {"haptics.rate": [100, 200], "duration": [0.05]}, tmp_path / "sweep.png"
    first = hl.sweep(bar, vary, out=tmp_path, jobs=1)
    assert first.files == ("table.csv", "sweep.png")
    drawn = figure.read_bytes()
    draw, asked = sweep_figure.draw, []
    monkeypatch.setattr(sweep_figure, "draw", lambda *of: asked.append(of) or draw(*of))
    assert hl.sweep(bar, vary, out=tmp_path, jobs=1).files == first.files
    assert not asked
    assert figure.read_bytes() == drawn
    hl.sweep(bar, vary, out=tmp_path, jobs=1, metric="end_time_s")
    hl.sweep(bar, {**vary, "haptics.rate": [100]}, out=tmp_path, jobs=1)
    assert len(asked) == 2
    hl.sweep(bar, vary, out=tmp_path, jobs=1)
    figure.write_bytes(drawn[:-20])  # killed while it was written
    hl.sweep(bar, vary, out=tmp_path, jobs=1)
    assert len(asked) == 4
    assert figure.read_bytes() == drawn


def test_of_many_runs_the_best_and_the_worst_are_shown() -> None:
    rows = [{"k": str(i), "end": "duration", "tracking_max_mm": float(-i % 40)} for i in range(40)]
    _, _, *shown = table.lines(rows, ("k",))
    assert [line.split()[0] for line in shown] == [
        "0", *(str(i) for i in range(39, 32, -1)), "...", *(str(i) for i in range(8, 0, -1)),
    ]  # fmt: skip


def test_a_frame_has_a_row_a_run(bar: Path) -> None:
    pandas = pytest.importorskip("pandas")
    frame = hl.sweep(bar, {"duration": [0.05, 0.1]}, jobs=1).frame()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["duration"].tolist() == [0.05, 0.1]
    assert frame["end"].tolist() == ["duration", "duration"]


def test_a_notebook_shows_the_rows_of_a_sweep() -> None:
    rows = [{"k": f"<{i}>", "end": "duration", "tracking_max_mm": i / 3} for i in range(MOST + 2)]
    made = Sweep(rows, ("k",), None)
    shown = ET.fromstring(made._repr_html_())
    assert len(made) == len(rows) == len(shown.findall(".//tbody/tr")) + 2
    assert shown.findtext("caption") == "2 further rows"
    assert [cell.text for cell in shown.findall(".//th")] == ["k", "end", "tracking_max_mm"]
    assert [cell.text for cell in shown.findall(".//tbody/tr[2]/td")] == [
        "<1>",
        "duration",
        "0.3333",
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_an_interrupted_sweep_in_memory_says_what_would_keep_it(bar: Path, tmp_path: Path) -> None:
    def interrupt(done: int, of: int) -> None:
        if done == 1:
            os.kill(os.getpid(), signal.SIGINT)

    vary = {"duration": [0.05, 0.1, 0.15]}
    with pytest.raises(hl.Fault, match="interrupted: 1 of 3 runs; with a folder `out`"):
        hl.sweep(bar, vary, jobs=1, progress=interrupt)
    with pytest.raises(hl.Fault, match="1 of 3 runs are in"):
        hl.sweep(bar, vary, jobs=1, progress=interrupt, out=tmp_path)
    found = hl.sweep(bar, vary, jobs=1, out=tmp_path)
    assert found["end"].tolist() == ["duration"] * 3
    assert found.files == ("table.csv", "sweep.png")
