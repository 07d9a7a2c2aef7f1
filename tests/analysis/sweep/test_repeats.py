"""Repetitions of a sweep's points: their seeds, and the median and quartiles of their numbers."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticlink as hl
from hapticlink.analysis.sweep import job, repeats
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.overrides import toml
from hapticlink.visualization.figures import sweep_figure

VARYING = {"graphics.rate": {"min": 20, "max": 40, "seed": 3}, "duration": 0.2}


def test_the_seeds_are_those_of_what_is_drawn() -> None:
    """Not of a constant rate, of a constant latency, and of what an event sets."""
    drawn = {
        "graphics.rate": {"min": 20, "max": 40, "seed": 3},
        "delays": {
            "virtual_environment.P_c": {"min": 0.01, "max": 0.02, "seed": 5},
            "virtual_environment.Lambda_inv": {"min": 0.01, "loss": 0.1},
            "controller.F_motor": {"min": 0.01, "max": 0.01, "seed": 9},
            "hand.F": 0.01,
        },
    }
    assert repeats.seeds(hl.scene("closed-loop-ideal", drawn)) == {
        "graphics.rate.seed": 3,
        'delays."virtual_environment.P_c".seed': 5,
        'delays."virtual_environment.Lambda_inv".seed': 0,
    }
    assert repeats.seeds(hl.scene("scenario")) == {"at.2.seed": 1}
    assert repeats.seeds(hl.scene("scenario", {"duration": 1.0})) == {}  # before the noise
    fixed = {"graphics.rate": {"min": 30, "max": 30.0}}
    assert repeats.seeds(hl.scene("closed-loop-ideal", fixed)) == {}
    assert repeats.seeds(hl.scene("closed-loop-ideal")) == {}


def test_what_draws_the_same_keeps_drawing_the_same() -> None:
    """Connections with one seed lose the same samples in each repetition; the first has the
    scene's own seeds, the others differ."""
    late = {"min": 0.01, "max": 0.02, "seed": 5}
    delays = {"virtual_environment.P_c": late, "virtual_environment.Lambda_inv": late}
    made = job.jobs("closed-loop-ideal", [f"delays={toml(delays, '')}"], [{}], repeat=5)
    found = [repeats.seeds(one.scene) for one in made if one.scene]
    assert set(found[0].values()) == {5}
    assert all(len(set(seeds.values())) == 1 for seeds in found)
    assert len({one.key for one in made}) == len(made) == 5
    assert made[0].key == job.jobs("closed-loop-ideal", [f"delays={toml(delays, '')}"], [{}])[0].key
    for one in made:  # the table has what the scene was run with
        assert one.scene
        seeds = {key: str(seed) for key, seed in repeats.seeds(one.scene).items()}
        assert seeds.items() <= one.point.items()


@given(st.integers(0, 2**63 - 1), st.integers(1, 1000))
def test_each_seed_is_one_that_a_scene_takes(own: int, repetition: int) -> None:
    assert repeats.seed(own, 0) == own
    assert 0 <= repeats.seed(own, repetition) < 2**32


@pytest.mark.parametrize(
    ("vary", "repeat", "message"),
    [
        ({"hold": ["zoh", "foh"]}, 2, "nothing in this scene is random"),
        ({"graphics.rate.seed": [1]}, 2, "take one of both"),
        ({"hold": ["zoh"]}, 0, "give 1 or more"),
        ({"hold": ["zoh"]}, 100_001, "at most 100000"),
    ],
)
def test_repetitions_that_cannot_be_made_are_refused(
    vary: dict[str, Any], repeat: int, message: str
) -> None:
    """Before anything runs."""
    options = {"graphics.rate": {"min": 20, "max": 40}} if "take one" in message else {}
    with pytest.raises(InputFault, match=message):
        hl.sweep("closed-loop-ideal", vary, options, repeat=repeat)


def test_a_point_of_which_nothing_is_drawn_is_run_once() -> None:
    points = [{"graphics.rate": rate} for rate in ("30", "{ min = 20, max = 40 }")]
    made = job.jobs("closed-loop-ideal", (), points, repeat=3)
    assert [one.point["repetition"] for one in made] == ["0", "0", "1", "2"]
    assert "graphics.rate.seed" not in made[0].point


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> hl.Sweep:
    out = tmp_path_factory.mktemp("repeated")
    return hl.sweep(
        "closed-loop-direct", {"hold": ["zoh", "foh"]}, VARYING, repeat=4, out=out, jobs=1
    )


def test_quartiles_are_those_of_single_runs(swept: hl.Sweep) -> None:
    """Each run made again by `hl.run` with the seed of its row, its error from its own samples."""
    errors: dict[str, list[float]] = {"zoh": [], "foh": []}
    for row in swept.rows:
        options = {"hold": row["hold"], "graphics.rate.seed": int(row["graphics.rate.seed"])}
        run = hl.run("closed-loop-direct", VARYING | options, figures=False)
        assert run.run["seeds"]["graphics.rate"] == options["graphics.rate.seed"]
        errors[row["hold"]].append(run.tracking().distance_mm.max())
    for point in swept.spread:
        found = [point[f"tracking_max_mm {q}"] for q in ("q25", "median", "q75")]
        expected = np.percentile(errors[point["hold"]], [25, 50, 75])
        assert found == pytest.approx(expected, rel=1e-12)
        assert found[0] < found[2]
        assert (point["runs"], point["whole_runs"]) == (4, 4)
    assert [point["hold"] for point in swept.spread] == ["zoh", "foh"]
    assert len(swept) == 8


def test_the_table_of_points_has_the_same_bytes_however_it_was_made(
    swept: hl.Sweep, tmp_path: Path
) -> None:
    """First with fewer repetitions, in another number of processes; the rows that are there are
    not made again."""
    assert swept.folder
    vary = {"hold": ["zoh", "foh"]}
    hl.sweep("closed-loop-direct", vary, VARYING, repeat=2, out=tmp_path, jobs=1)
    first = {path: path.stat().st_mtime_ns for path in (tmp_path / "rows").iterdir()}
    again = hl.sweep("closed-loop-direct", vary, VARYING, repeat=4, out=tmp_path, jobs=2)
    assert len(first) == 4
    assert all(path.stat().st_mtime_ns == time for path, time in first.items())
    assert again.files == swept.files == ("table.csv", "spread.csv", "sweep.png")
    spread = [(folder / "spread.csv").read_bytes() for folder in (tmp_path, swept.folder)]
    assert spread[0] == spread[1]
    with (tmp_path / "spread.csv").open(newline="") as file:
        assert [row["hold"] for row in csv.DictReader(file)] == ["zoh", "foh"]


def test_of_runs_that_did_not_last_there_is_only_the_number() -> None:
    """Quartiles of 0, 1, ..., 8 are 2, 4 and 6, whatever the numbers of those that failed."""
    rows = [
        {"k": "1", "repetition": str(i), "end": "duration", "tracking_max_mm": float(i)}
        for i in range(9)
    ]
    rows += [
        {"k": "1", "repetition": "9", "end": "diverged", "tracking_max_mm": 1e9},
        {"k": "1", "repetition": "10", "end": "stop_when", "tracking_max_mm": 1e9},
        {"k": "2", "repetition": "0", "end": "fault", "message": "m"},
        {"k": "2", "repetition": "1", "end": "died", "message": "m"},
    ]
    one, none = repeats.spread(rows, ("k",))
    quartiles = [one[f"tracking_max_mm {q}"] for q in ("q25", "median", "q75")]
    assert (one["runs"], one["whole_runs"], quartiles) == (11, 9, [2.0, 4.0, 6.0])
    assert none == {"k": "2", "runs": 2, "whole_runs": 0}
    head, _, first, second = repeats.lines(rows, ("k",))
    assert "13 runs of 2 points over k, 3 failed" in head
    assert "9 of 11" in first
    assert "4 (2 to 6)" in first
    assert "0 of 2" in second


@pytest.mark.parametrize("axis", ["number", "text"])
def test_the_figure_has_median_and_quartiles(axis: str) -> None:
    rows = [
        {"k": k if axis == "number" else f"k{k}", "repetition": str(i), "end": "duration",
         "port_peak_J": 1e-3 * int(k) * i}
        for k in ("1", "2") for i in range(5)
    ]  # fmt: skip
    figure = sweep_figure.draw(rows, ["k"])
    assert figure is not None
    axes = figure.axes[0]
    assert axes.get_title().startswith("Median of the largest energy generated")
    assert "down to 2\xa0mJ" in axes.get_title()
    if axis == "number":
        assert list(axes.lines[0].get_ydata()) == [2.0, 4.0]
        corners = {tuple(map(float, c)) for c in axes.collections[0].get_paths()[0].vertices}
        assert {(1.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.0, 6.0)} <= corners
    else:
        assert [bar.get_width() for bar in axes.patches] == [2.0, 4.0]
        ends = [segment[:, 0].tolist() for segment in axes.collections[0].get_segments()]
        assert ends == [[1.0, 3.0], [2.0, 6.0]]


def test_the_best_point_of_the_title_lost_no_run() -> None:
    """The runs that a point lost are its worst, so that its median is too good."""
    rows = [
        {"k": k, "repetition": str(i), "end": end, "tracking_max_mm": value}
        for k, value, ends in (("1", 1.0, ["duration", "diverged"]), ("2", 2.0, ["duration"] * 2))
        for i, end in enumerate(ends)
    ]
    figure = sweep_figure.draw(rows, ["k"])
    assert figure is not None
    title = " ".join(figure.axes[0].get_title().split())  # of spaces that do not break, too
    assert title.endswith("at k = 2; 1 of 4 runs ended early or failed")


def test_a_point_whose_runs_all_ended_is_marked() -> None:
    """One of two runs is a median of one."""
    rows = [
        {"k": k, "repetition": str(i), "end": end, "tracking_max_mm": 1.0}
        for k, ends in (
            ("k1", ["duration"] * 2),
            ("k2", ["diverged"] * 2),
            ("k3", ["duration", "died"]),
        )
        for i, end in enumerate(ends)
    ]
    figure = sweep_figure.draw(rows, ["k"])
    assert figure is not None
    said = [text.get_text().strip() for text in figure.axes[0].texts]
    assert said == ["none of 2 runs lasted"]


def test_a_notebook_shows_the_points(swept: hl.Sweep) -> None:
    html = swept._repr_html_()
    assert html.count("<tr>") == 3
    assert "<th>tracking_max_mm median</th>" in html
    assert "graphics.rate.seed" not in html
