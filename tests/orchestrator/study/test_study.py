"""The study: its cases are scenes, its errors are distances, its page says what the rows say."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.study import cases, errors, figures, page
from hapticlink.orchestrator.study.grids import COLUMNS, best, grid, short, stable_rates
from hapticlink.orchestrator.sweep.row import Row
from tests.orchestrator.conftest import status


def test_every_case_is_a_scene_and_every_hold_a_case(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cases, "RATES", ("30",))
    monkeypatch.setattr(cases, "SEEDS", (1,))
    monkeypatch.setattr(cases, "BIAS", ("full",))
    made = cases.jobs()
    assert [j.refusal for j in made if j.scene is None] == []
    assert len({j.key for j in made}) == len(made)  # no two cases are one run
    held = {j.point["hold"] for j in made if j.point["scene"] == "closed-loop-direct"}
    assert {h for h in held if "," not in h} == HOLDS.keys() - {"latest", "mean", "slope"}


def _row(path: Any, **point: str) -> Row:
    return {**point, "end": "duration", "end_time_s": 3.0, errors.PATH: path}


def test_errors_are_distances_up_to_the_first_end() -> None:
    rest = np.zeros((385, 2))  # 3 s at 128 Hz
    early, late = rest.copy(), rest.copy()
    early[64:] = 3e-3, 4e-3  # 5 mm from .5 s on
    late[129:] = 6e-3, 8e-3  # 10 mm, just after the first second
    parts = {"scene": "s", "gains": "printed", "hold": "zoh", "rate": "30", "seed": ""}
    rows = [
        _row(rest, **errors.continuous("printed", "none")),
        _row(rest, **errors.continuous("printed", "full")),
        _row(late, **parts, bias="none"),
        _row(early[:200], **parts, bias="full"),
    ]
    reference, _, none, full = errors.compared(rows)
    assert none["coupling_1s_mm"] == 0
    assert none["coupling_max_mm"] == pytest.approx(10)
    assert full["coupling_1s_mm"] == full["coupling_max_mm"] == pytest.approx(5)
    assert none["modelling_1s_mm"] == none["modelling_max_mm"] == pytest.approx(5)
    assert reference["modelling_max_mm"] == 0
    assert "coupling_max_mm" not in reference
    assert all(errors.PATH not in r for r in (reference, none, full))


def test_a_cell_lasts_where_all_its_seeds_do() -> None:
    rows: list[Row] = []
    for rate in COLUMNS:
        for hold, factor in (("zoh", 2.0), ("foh", 1.0)):
            for seed in (1, 2) if rate == cases.VARIABLE else ("",):
                lost = hold == "foh" and seed == 2
                end: Row = {"end": "stop_when", "end_time_s": 1.5} if lost else {"end": "duration"}
                value = factor * (seed or 1)
                point = {"hold": hold, "rate": rate, "bias": "full"}
                together = {"tracking_max_mm": 5.0, "theta_max_rad": 0.1}
                rows.append({**point, "m": value, **together, **end})
    found = grid(rows, "m", bias="full")
    assert found["zoh"]["10..60"].value == 4.0  # the worse seed
    assert (found["foh"]["10..60"].value, found["foh"]["10..60"].end) == (None, 0.0)
    assert (best(found, "30"), best(found, "10..60")) == ("foh", "zoh")
    assert stable_rates(found, "foh") == list(cases.RATES)
    assert grid(rows, "m", bias="none") == {}
    for what, limit in (("tracking_max_mm", 42.0), ("theta_max_rad", 1.0)):
        apart = [{**r, what: limit, "end_time_s": 3.0} for r in rows]
        cell = grid(apart, "m", bias="full")["zoh"]["30"]
        assert (cell.value, cell.end) == (None, 3.0)


def test_numbers_are_short() -> None:
    assert [short(v) for v in (1859.0, 0.0034, 104.9, 7.0, None, float("nan"))] == [
        "1900", "0.0034", "100", "7", "", "",
    ]  # fmt: skip


@pytest.fixture
def cells(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, list[str]]]:
    """What the cells of each map's first panel say, by file name and hold, a rate after another."""
    found: dict[str, dict[str, list[str]]] = {}
    save = figures.save

    def keep(figure: Any, folder: Path, name: str) -> str:
        texts = np.reshape([text.get_text() for text in figure.axes[0].texts], (-1, len(COLUMNS)))
        holds = [label.get_text() for label in figure.axes[0].get_yticklabels()]
        found[name] = {h: row.tolist() for h, row in zip(holds, texts, strict=True)}
        return save(figure, folder, name)

    monkeypatch.setattr(figures, "save", keep)
    return found


def test_the_page_names_the_hold_of_the_least_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cells: dict[str, dict[str, list[str]]]
) -> None:
    """Rows of every case, as if the mean were right and the second-order hold lost everywhere."""
    monkeypatch.setattr(cases, "job", lambda scene, options, point: point)
    rows: list[Row] = []
    for i, point in enumerate(cases.jobs()):
        hold = point.get("hold", "")  # type: ignore[attr-defined]
        lost = hold == "second-order" or point.get("model") == "held"  # type: ignore[attr-defined]
        error = 1.0 if hold == "foh, mean" else 5.0 + i / 1e4
        rows.append(
            {
                **point,  # type: ignore[dict-item]
                "end": "stop_when" if lost else "duration",
                "end_time_s": 1.25 if lost else 3.0,
                "tracking_max_mm": error,
                "theta_max_rad": 0.1,
                "coupling_1s_mm": error,
                "coupling_max_mm": error,
                "modelling_1s_mm": error,
                "held_energy_peak_J": -0.002,
            }
        )
    text = page.write(tmp_path, rows).read_text()
    for rate in COLUMNS:
        assert f"| {rate} | `foh, mean` | 1 | 5" in text
    assert "| `second-order` | none | | | |" in text
    assert "| of the last frame (B.15) | the pose | off | 64 of 64 |  |  |   |" in text
    best = {"direct_tracking": "1", "direct_energy": "-2", "printed_gains": "1"}
    for name, value in (best | {"loop_coupling": "1"}).items():
        assert f"({name}.png)" in text
        assert (tmp_path / f"{name}.png").is_file()
        assert cells[f"{name}.png"]["foh, mean"] == [value] * len(COLUMNS)
        assert cells[f"{name}.png"]["second-order"] == ["1.2 s"] * len(COLUMNS)  # when it was lost


def test_a_folder_that_cannot_be_is_told_before_any_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hapticlink.orchestrator.study.sweep", lambda *_, **__: pytest.fail("runs"))
    (tmp_path / "file").write_text("")
    assert status("study", "--out", tmp_path / "file") == 2
