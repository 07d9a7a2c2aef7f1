"""The page that needs no server, opened from the disk in Chromium."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.commands import main
from tests.visualization.live.chromium import AT, Page, chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("standalone") / "demo.html"
    with pytest.raises(SystemExit) as ended:
        main(["view", "closed-loop", "--standalone", str(path)])
    assert ended.value.code == 0
    return path


def dragged(page: Page, folder: Path) -> tuple[list[str], np.ndarray]:
    """What the page saves of a run of a second with a drag: the names and the rows."""
    page.page.click("#pause")
    page.page.click("#record")
    page.until("view.state.recording && view.frame.t === 0 && view.stage.limits")
    page.pull(0.02, -0.02)
    page.page.keyboard.press("Space")
    page.until("view.frame.t > 0.4")
    x, y, scale = page.page.evaluate(AT)
    page.page.mouse.move(x + 0.03 * scale, y - 0.01 * scale, steps=5)
    page.until("view.frame.t > 1.1")
    page.page.mouse.up()
    with page.page.expect_download() as download:
        page.page.click("#record")
    path = folder / "saved.csv"
    download.value.save_as(path)
    with path.open() as text:
        names, *rows = csv.reader(text)
    return names, np.array(rows, float)


def test_a_drag_gives_the_numbers_of_a_run_with_the_same_forces(
    file: Path, browser: Any, tmp_path: Path
) -> None:
    """The run's hand is the force that was recorded, at each tick."""
    page = Page(browser, f"file://{file}")
    names, rows = dragged(page, tmp_path)
    assert page.faults == []
    page.page.close()
    rows = rows[: 1 + 512]
    force = [names.index(f"hand.F[{i}]") for i in (1, 2, 3)]
    assert np.abs(rows[:, force]).max() > 1
    hand = {"type": "profile", "table": rows[:, [0, *force]].tolist()}
    changes = {"hand": hand, "duration": 1.0, "stop_when": "", "record": {"signals": "all"}}
    table = hl.run("closed-loop", changes, out=tmp_path / "run")["haptics"]
    assert np.array_equal(rows[:, 0], table["time"])
    columns = [name for name in table.columns[1:] if not name.startswith("hand.")]
    assert len(columns) > 40
    for name in columns:
        assert rows[:, names.index(name)] == pytest.approx(table[name], rel=1e-9, abs=1e-9), name
