"""What a long run shows, whose tables stay in their files, is what its tables in memory show."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.episodes import episodes
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.results.read_results import Results, load, without_rows
from hapticlink.orchestrator.results.rows_file import RowsFile
from hapticlink.visualization.figures import curves, run_figures
from hapticlink.visualization.figures.curves import curve, extremes

CASES = {
    "closed-loop-direct": ["graphics.rate=29.97", "graphics.align=tick"],
    "enclosure": ["coupling=jacobi"],
    "two-users": [],
    "push-disc": ["record.every=3"],
}


@pytest.fixture(autouse=True)
def _short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(read_results, "BLOCK", 100)


def both(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Results, Results]:
    """The results of a run whose rows are there, in its files and in memory."""
    monkeypatch.setattr(read_results, "IN_MEMORY", 0)
    found = load(folder, from_rows=True)
    assert all(isinstance(table.rows, RowsFile) for table in found.tables.values())
    monkeypatch.undo()
    monkeypatch.setattr(read_results, "BLOCK", 100)
    return found, load(folder, from_rows=True)


@pytest.mark.parametrize("scene", CASES)
def test_files_give_what_tables_in_memory_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: str
) -> None:
    simulate(scene, tmp_path, ["duration=1", *CASES[scene]], keep_rows=True)
    found, whole = both(tmp_path, monkeypatch)
    for until in (math.inf, 0.5):
        of, all_of = Measures(found, until), Measures(whole, until)
        for name in ("tracking", "forces", "motors", "closure_m", "constrained", "folded", "port"):
            assert getattr(of, name) == getattr(all_of, name), name
    assert [*summary.lines(found)] == [*summary.lines(whole)]
    assert [*summary.numbers(found)] == [*summary.numbers(whole)]
    assert episodes(found) == episodes(whole)
    port, all_of_it = user_port(found), user_port(whole)
    assert (port is None) == (all_of_it is None)
    if port and all_of_it:
        assert np.array_equal(port.generated_J, all_of_it.generated_J)
    assert [*run_figures.drawings(found)] == [*run_figures.drawings(whole)]


@pytest.mark.parametrize("late", ["virtual_mechanism.x", "virtual_mechanism.P_c"])
def test_samples_that_come_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, late: str) -> None:
    delay = f"delays.{late}={{ min = 0.001, max = 0.09, loss = 0.1, seed = 3 }}"
    simulate("closed-loop-direct", tmp_path, ["duration=1", delay], keep_rows=True)
    found, whole = both(tmp_path, monkeypatch)
    assert Measures(found).port == Measures(whole).port


def test_tables_of_a_long_run_are_read_when_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the rows a block at a time; when these are removed, of the CSVs."""
    simulate("closed-loop-ideal", tmp_path, ["duration=1"], keep_rows=True)
    found, whole = both(tmp_path, monkeypatch)
    for name, table in whole.tables.items():
        assert [len(block.rows) for block in found.tables[name].blocks(more=1)][:-1] in (
            [101] * ((len(table.rows) - 2) // 100),
            [],
        )
        assert np.array_equal(found.tables[name].rows, table.rows)
    left = without_rows(found)
    for rows in tmp_path.glob("*.rows"):
        rows.unlink()
    for name, table in whole.tables.items():
        assert np.array_equal(left[name].rows, table.rows)
    with pytest.raises(KeyError):
        left["other"]


def test_the_summary_reads_rows_few_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pass maps all of them anew: 35 of three for each wrench were most of its time."""
    simulate("closed-loop-ideal", tmp_path, ["duration=2"], keep_rows=True)
    found, _ = both(tmp_path, monkeypatch)
    rows, read, get = found.haptics.rows, list[int](), RowsFile.__getitem__

    def counting(self: RowsFile, span: slice) -> Any:
        got = get(self, span)
        read.append(len(got) if self is rows else 0)
        return got

    monkeypatch.setattr(RowsFile, "__getitem__", counting)
    summary.find(found)
    assert sum(read) < 17 * len(rows)


def test_a_long_run_leaves_its_csvs_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = hl.run("closed-loop-ideal", {"duration": 0.5}, out=tmp_path / "a", figures=False)
    monkeypatch.setattr(read_results, "IN_MEMORY", 0)
    run = hl.run("closed-loop-ideal", {"duration": 0.5}, out=tmp_path / "b", figures=False)
    assert {p.name for p in (tmp_path / "b").iterdir()} == {*run.run["files"]}
    assert run.has_rows_of(whole)
    assert hl.run("closed-loop-ideal", {"duration": 0.5}).has_rows_of(whole)


def test_a_curve_keeps_the_least_and_the_most_of_each_stretch() -> None:
    time = np.linspace(0.0, 1.0, 100_001)
    values = np.sin(40 * time) + 2.0 * (time == time[31_415]) - 3.0 * (time == time[77_777])
    kept = extremes([time, values], 500)
    assert len(kept) <= 500 * 4 + 2
    assert values[kept].max() == values[31_415]
    assert values[kept].min() == values[77_777]
    for part in np.split(np.arange(100_000), 100):
        inside = [i for i in kept if part[0] <= i <= part[-1]]
        assert math.isclose(values[inside].max(), values[part].max(), rel_tol=0, abs_tol=1e-3)


def test_curves_of_a_short_run_have_all_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.linspace(0.0, 1.0, 5000)
    both_columns = np.stack([time, -time], axis=1)
    assert curve(time, both_columns) == (time, both_columns)
    monkeypatch.setattr(curves, "LONG", 4999)
    thin, columns = curve(time, both_columns)
    assert len(thin) == len(columns) < 5000
    assert np.array_equal(columns, np.stack([thin, -thin], axis=1))
