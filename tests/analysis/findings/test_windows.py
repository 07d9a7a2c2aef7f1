"""What a long run shows, computed window by window, is what its whole tables show."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ClassVar
from weakref import WeakSet

import numpy as np
import pytest

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.episodes import episodes
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results import windows
from hapticlink.orchestrator.results.read_results import Results, load
from hapticlink.orchestrator.results.windows import Streamed
from hapticlink.visualization.figures import run_figures
from hapticlink.visualization.figures.curves import STRETCHES, curve, extremes

CASES = {
    "closed-loop-direct": ["graphics.rate=29.97", "graphics.align=tick"],
    "enclosure": ["coupling=jacobi"],
    "two-users": [],
    "push-disc": ["record.every=3"],
}


Ran = Callable[..., Results]


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ran:
    """(scene, *options, folder=tmp_path) -> a run that is read in windows."""
    monkeypatch.setattr(windows, "WINDOW_BYTES", 40_000)

    def ran(scene: str, *options: str, folder: Path = tmp_path) -> Results:
        simulate(scene, folder, options, keep_rows=True)
        found = windows.opened(folder)
        assert found.number > 3
        return found

    return ran


@pytest.mark.parametrize("scene", CASES)
def test_windows_give_what_the_whole_tables_give(tmp_path: Path, results: Ran, scene: str) -> None:
    found = results(scene, "duration=1", *CASES[scene])
    whole = load(tmp_path, binary=True)
    of, all_of = Measures(found), Measures(whole)
    for name in ("forces", "motors", "closure_m", "constrained", "folded", "port", "saturations"):
        assert getattr(of, name) == getattr(all_of, name), name
    for user, error in all_of.tracking.items():
        assert of.tracking[user] == pytest.approx(error, rel=1e-12)
    half = Measures(found, 0.5), Measures(whole, 0.5)
    assert half[0].forces == half[1].forces
    assert [*summary.lines(found)] == [*summary.lines(whole)]
    assert [*summary.numbers(found)] == [*summary.numbers(whole)]
    assert sorted(episodes(found)) == sorted(episodes(whole))
    port, all_of_it = user_port(found), user_port(whole)
    assert (port is None) == (all_of_it is None)
    if port and all_of_it:
        assert np.array_equal(port.generated_J, all_of_it.generated_J)


@pytest.mark.parametrize("late", ["virtual_mechanism.x", "virtual_mechanism.P_c"])
def test_samples_that_come_in_a_later_window(tmp_path: Path, results: Ran, late: str) -> None:
    delay = f"delays.{late}={{ min = 0.001, max = 0.09, loss = 0.1, seed = 3 }}"
    found = results("closed-loop-direct", "duration=1", delay)
    assert Measures(found).port == Measures(load(tmp_path, binary=True)).port


def test_no_window_grows_with_the_duration(tmp_path: Path, results: Ran) -> None:
    most = []
    for duration in (1, 4):
        folder = tmp_path / str(duration)
        found = results("closed-loop", f"duration={duration}", folder=folder)
        rows = [sum(t.rows.nbytes for t in w.tables.values()) for w in found.windows()]
        kept = [np.flatnonzero(np.diff(w.tables["haptics"]["time"])) for w in found.windows()]
        assert sum(map(len, kept)) >= duration * 512
        most.append(max(rows))
    assert most[1] < 1.2 * most[0]


class Kept(Streamed):
    """Counts the windows that are in memory at a time."""

    there: ClassVar[WeakSet[Results]] = WeakSet()
    most: ClassVar[int] = 0

    def windows(self) -> Iterator[Results]:
        for window in super().windows():
            Kept.there.add(window)
            Kept.most = max(Kept.most, len(Kept.there))
            yield window


def test_windows_that_were_read_do_not_stay_in_memory(
    results: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not until a collection of garbage either, which arrays do not count for."""
    monkeypatch.setattr(windows, "Streamed", Kept)
    found = results("closed-loop", "duration=1")
    gc.disable()
    try:
        assert [*summary.lines(found), *summary.numbers(found), *episodes(found)]
        assert [*run_figures.drawings(found)]
        run_figures.figures(found)
    finally:
        gc.enable()
    assert 0 < Kept.most <= 5 < found.number


def test_tables_of_a_long_run_are_read_when_they_are_asked_for(
    tmp_path: Path, results: Ran
) -> None:
    found = results("closed-loop", "duration=1")
    whole = load(tmp_path)
    for table in tmp_path.glob("*.rows"):
        table.unlink()
    assert [*found.tables] == [*whole.tables]
    for name, table in whole.tables.items():
        assert np.array_equal(found.tables[name].rows, table.rows)
    with pytest.raises(KeyError):
        found.tables["other"]


def test_a_curve_keeps_the_least_and_the_most_of_each_stretch() -> None:
    time = np.linspace(0.0, 1.0, 100_001)
    values = np.sin(40 * time) + 2.0 * (time == time[31_415]) - 3.0 * (time == time[77_777])
    kept = [*extremes(np.column_stack([time, values]), 500)]
    assert len(kept) <= 500 * 4 + 2
    assert values[kept].max() == values[31_415]
    assert values[kept].min() == values[77_777]
    for part in np.split(np.arange(100_000), 100):
        inside = [i for i in kept if part[0] <= i <= part[-1]]
        assert math.isclose(values[inside].max(), values[part].max(), rel_tol=0, abs_tol=1e-3)


def test_curves_of_a_short_run_have_all_samples(tmp_path: Path) -> None:
    simulate("closed-loop", tmp_path, ["duration=0.2"])
    whole = load(tmp_path)
    (time,) = curve(whole, lambda window: (window.tables["haptics"]["time"],))
    assert np.array_equal(time, whole.haptics["time"])
    assert len(time) < STRETCHES
