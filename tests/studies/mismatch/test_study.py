"""The study: its draws are scenes, its comparisons are within draws, its page says what the rows
say."""

import csv
import re
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest

from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.row import Row
from hapticlink.orchestrator.experiment import simulate
from studies import mismatch as make_module
from studies.mismatch import (
    cases,
    design,
    expected,
    finding_figures,
    held_out_draws,
    measure,
    method_choice,
    page,
    robustness,
)
from studies.mismatch import study as make
from studies.mismatch.design import DIRECT, MOBILITY
from studies.mismatch.method_choice import choice, within
from studies.mismatch.methods import HOLDS, RATES, Method
from tests.shared_fixtures import status

ALL = [*cases.trained(), *cases.kept_apart()]


@pytest.mark.parametrize("arrangement", [DIRECT, MOBILITY, design.CONTINUOUS])
def test_every_case_is_a_scene(arrangement: str) -> None:
    rate = str(design.REFERENCE) if arrangement == design.CONTINUOUS else "24"
    made = [design.run(arrangement, c, Method("zoh", "stiff"), "full", rate) for c in ALL]
    assert [j.refusal for j in made if j.scene is None] == []
    assert len({j.key for j in made}) == len(ALL)  # no two cases are one run


def test_every_method_is_a_scene() -> None:
    made = [
        design.run(arrangement, ALL[0], m, "none", "30")
        for arrangement in (DIRECT, MOBILITY)
        for m in design.methods(arrangement, "none", "30")
    ]
    assert [j.refusal for j in made if j.scene is None] == []
    assert len({j.key for j in made}) == len(made)


def test_what_is_kept_apart_is_in_no_choice() -> None:
    known = {part for c in cases.trained() for part in (c.linkage, c.hand)}
    for case in cases.kept_apart():
        assert case.linkage not in known or case.hand not in known
    assert not {c.seed for c in cases.trained()} & {c.seed for c in cases.kept_apart()}


def test_a_case_has_several_draws() -> None:
    """No two of its draws have the same hand, and every draw has its own seed."""
    assert len({c.seed for c in ALL}) == len(ALL)
    for name in {c.name for c in ALL}:
        draws = [c.options for c in ALL if c.name == name]
        assert len(set(draws)) == len(draws) == cases.SEEDS > 1


def test_the_expected_time_counts_all_jobs() -> None:
    one = [cases.trained()[0]]
    made = design.runs(one)
    assert len(made) == design.count(1)
    assert len(design.runs(one, apart=True)) == design.count(1, apart=True)
    assert 0 < expected(2) == 2 * expected(4)


@pytest.mark.parametrize("linkage", cases.LINKAGES)
def test_arms_start_at_the_mechanism(linkage: str, tmp_path: Path) -> None:
    job = design.run(DIRECT, cases.at_rest(linkage), Method("zoh", "soft"), "none", "30")
    assert job.scene
    pose = simulate(job.scene, tmp_path, ["duration=0.01"]).results.graphics["virtual_mechanism.x"]
    assert pose[0] == pytest.approx(cases.LINKAGES[linkage], abs=5e-5)


def test_a_run_and_its_map_at_rest(tmp_path: Path) -> None:
    """The serial arm at 57 Hz with medium gains: stable, and the run after a kick decays."""
    scene = design.run(DIRECT, cases.at_rest("serial"), Method("zoh", "medium"), "none", "57").scene
    assert scene
    experiment = simulate(scene, tmp_path, ["duration=1.0"])
    row = measure.of_run(experiment)
    assert within(row)
    assert len(row[measure.PATH]) == measure.GRID + 1
    rest = measure.at_rest(experiment)
    assert (rest["verdict"], rest[measure.RUN]) == ("stable", "stable")
    assert 0.5 < rest[measure.MARGIN] < 20.0


@pytest.mark.parametrize(
    ("arrangement", "linkage", "hold", "growth"),
    [(MOBILITY, "serial", "zoh", 185.3), (DIRECT, "four-bar", "second-order", 24.14)],
)
def test_growth_that_ends_in_a_limit_cycle_is_unstable(
    arrangement: str, linkage: str, hold: str, growth: float, tmp_path: Path
) -> None:
    """With the report's gains, motors saturate within the first quarter of the run, whose speed
    then neither grows nor decays."""
    job = design.run(arrangement, cases.at_rest(linkage), Method(hold, "stiff"), "none", "57")
    assert job.scene
    rest = measure.at_rest(simulate(job.scene, tmp_path, ["duration=0.1"]))
    assert (rest["verdict"], rest[measure.RUN]) == ("unstable", "unstable")
    assert rest[measure.MARGIN] == pytest.approx(-growth, rel=1e-3)


def test_coupling_errors_are_distances_up_to_the_first_end() -> None:
    rest = np.zeros((65, 2))
    moved = rest.copy()
    moved[32:] = 3e-3, 4e-3
    base = {"case": "c", "seed": "1", "bias": "full", "end": "duration"}
    reference = {**base, "arrangement": design.CONTINUOUS, "rate": str(design.REFERENCE)}
    other = {**base, "arrangement": DIRECT, "rate": "30"}
    rows = [
        {**reference, measure.PATH: rest.tolist()},
        {**other, measure.PATH: moved.tolist()},
        {**other, measure.PATH: moved[:20].tolist()},
    ]
    first, whole, short = measure.compared(rows)
    assert measure.COUPLING not in first
    assert whole[measure.COUPLING] == pytest.approx(5.0)
    assert short[measure.COUPLING] == 0.0
    assert all(measure.PATH not in row for row in (first, whole, short))


def _row(error: float, peak: float = 0.0, end: str = "duration") -> Row:
    found: Row = {"tracking_max_mm": error, "theta_max_rad": 0.1, "port_peak_J": peak}
    return found | {"hand_work_J": 0.02, "coupling_1s_mm": error, "end": end, "end_time_s": 3.0}


def _of(errors: list[float]) -> dict[str, Row]:
    return {f"case {i}": _row(e) for i, e in enumerate(errors)}


CELL = (DIRECT, "none", "30")
ZOH, FOH, PSPM = Method("zoh", "soft"), Method("foh", "soft"), Method("pspm, passive", "soft")


def test_only_what_keeps_the_limits_everywhere_is_advised() -> None:
    good = _of([2.0] * 8)
    for bad in (_row(1.0, peak=5.1e-3), _row(43.0), _row(1.0, end="stop_when")):
        found = choice(CELL, {ZOH: good, FOH: {**_of([1.0] * 8), "case 3": bad}}, {})
        assert (found.method, found.ties) == (ZOH, ())
    enough = choice(CELL, {FOH: {**_of([1.0] * 8), "case 3": _row(1.0, peak=4.9e-3)}}, {})
    assert enough.method == FOH
    bad = {"case 1": _row(50.0), "case 2": _row(1.0, peak=5.1e-3)}
    none = choice(CELL, {ZOH: {**good, **bad}}, {})
    assert (none.method, none.best, none.most, none.of, none.lost) == (None, ZOH, 6, 8, 1)


def test_an_unstable_map_forbids_a_method() -> None:
    rows = {ZOH: _of([1.0] * 4), FOH: _of([2.0] * 4)}
    at = {
        (DIRECT, ZOH, "30"): {"serial": {measure.MARGIN: 1.0}, "four-bar": {measure.MARGIN: -0.1}}
    }
    assert choice(CELL, rows, at).method == FOH
    assert choice(CELL, rows, {}).method == ZOH


def test_a_winner_only_beyond_the_spread() -> None:
    """foh is better in 7 of 8 cases, then in 5: within the spread zoh is as good."""
    zoh = [2.0] * 8
    wins = choice(CELL, {ZOH: _of(zoh), FOH: _of([1.0] * 7 + [3.0])}, {})
    assert (wins.method, wins.ties) == (FOH, ())
    ties = choice(CELL, {ZOH: _of(zoh), FOH: _of([1.0] * 5 + [3.0] * 3)}, {})
    assert (ties.method, ties.ties) == (FOH, (ZOH,))


def test_where_nothing_is_advised_the_best_wins_only_beyond_the_spread() -> None:
    """One tail of a sign test: 5 draws of 5 are beyond the spread (1/32), 4 of 4 are not (1/16)."""
    foh = {**_of([1.0] * 8), "case 7": _row(50.0)}
    for lost, tied in ((4, True), (5, False)):
        zoh = {
            **_of([1.0] * 8),
            **{f"case {i}": _row(50.0) for i in range(lost)},
            "case 7": _row(50.0),
        }
        found = choice(CELL, {ZOH: zoh, FOH: foh}, {})
        assert (found.method, found.best, found.most, found.lost) == (None, FOH, 7, 1)
        assert found.ties == ((ZOH,) if tied else ())


def test_errors_are_compared_within_draws() -> None:
    """Draws that differ a hundredfold do not hide a tenth within each."""
    scale = np.geomspace(0.1, 10.0, 8)
    rows = {ZOH: _of((1.1 * scale).tolist()), FOH: _of(scale.tolist())}
    found = choice(CELL, rows, {})
    assert (found.best, found.ties) == (FOH, ())


def test_the_list_to_try_has_what_is_nearly_best_in_most_cases() -> None:
    """Of 8 cases zoh, the safe one, is the best in none; pspm is in six, foh in the other two, in
    which pspm leaves the limits; second-order is next to foh and adds nothing."""

    def rows(errors: list[float]) -> dict[str, Row]:
        return {f"case {i}, seed 1": _row(e) | {"case": f"case {i}"} for i, e in enumerate(errors)}

    other = Method("second-order", "soft")
    by_method = {
        ZOH: rows([2.0] * 8),
        FOH: rows([5.0] * 6 + [0.5] * 2),
        PSPM: rows([1.0] * 6 + [50.0] * 2),
        other: rows([4.9] * 6 + [0.52] * 2),
    }
    off = method_choice.relative(by_method, "tracking_max_mm")
    assert off[PSPM] == pytest.approx([1.0] * 6 + [np.inf] * 2)
    assert off[other] == pytest.approx([4.9] * 6 + [1.04] * 2)
    assert method_choice.to_try(CELL, by_method, ZOH) == (ZOH, PSPM, FOH, other)


def _found(cells: method_choice.Cells) -> page.Found:
    """What was found of cells alone."""
    advice = {cell: choice(cell, rows, {}) for cell, rows in cells.items()}
    return page.Found([], cells, {}, advice, {}, [], {})


def _drawn(errors: list[float], bad: set[int] = frozenset()) -> dict[str, Row]:
    """Rows of two draws a case, in turn; those of `bad` are unstable."""
    return {
        f"case {i // 2}, seed {i % 2}": _row(50.0 if i in bad else e)
        | {"case": f"case {i // 2}", "seed": i % 2}
        for i, e in enumerate(errors)
    }


def test_a_row_says_that_it_depends_on_the_draws_only_where_it_does() -> None:
    """foh is better in each first draw by a third, zoh in each second one by a fifth; then foh in
    all."""
    swapped = {ZOH: _drawn([1.5, 1.0] * 8), FOH: _drawn([1.0, 1.25] * 8)}
    found = _found({CELL: swapped})
    assert robustness.agreement(found, DIRECT) == (1, 0, 1, pytest.approx(1.5))
    assert "not robust" in " ".join(robustness.section(found))
    sure = {ZOH: _drawn([1.5, 1.5] * 8), FOH: _drawn([1.0, 1.25] * 8)}
    found = _found({CELL: sure})
    assert robustness.agreement(found, DIRECT) == (1, 1, 1, 1.0)
    assert "not robust" not in " ".join(robustness.section(found))


def test_draws_that_fail_together_are_told_from_independent_ones() -> None:
    """Of 20 draws two fail: those of one case, or one each of two cases."""
    for bad, share in (({4, 5}, 1.0), ({4, 7}, 0.0)):
        cells = {CELL: {ZOH: _drawn([1.0] * 20, bad)}}
        assert robustness.failures(_found(cells)) == (share, pytest.approx(1 / 19))


def test_methods_are_listed_by_gains_from_the_first_on() -> None:
    medium = Method("zoh", "medium")
    assert robustness.by_gains((FOH, medium, ZOH)) == "soft: `foh`, `zoh`; medium: `zoh`"


def _sweep(jobs: list[Job], *_: Any, measure: Any, **__: Any) -> list[Row]:
    """Rows as if `foh` were right, medium gains unstable at 10 Hz, and soft maps unstable never."""
    rows: list[Row] = []
    for job in jobs:
        point = dict(job.point)
        if point["hand"] == cases.AT_REST and point["contact"] == "false" and point["seed"] == "0":
            found: Row = {"end": "duration", "verdict": "stable", "run_verdict": "stable"}
            rows.append(
                {**point, **found, "margin_1_per_s": 2.0 - 3.0 * (point["gains"] != "soft")}
            )
            continue
        lost = point["rate"] == "10" and point["gains"] != "soft" and point["bias"] == "full"
        error = 1.0 if point["hold"] == "foh" else 5.0
        held = point["arrangement"] != design.CONTINUOUS
        path = [[1e-3 * error * held, 0.0]] * 65
        rows.append(
            {**point, **_row(error, end="stop_when" if lost else "duration"), "handle": path}
        )
    return rows


def test_the_page_gives_the_advice_of_the_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.mismatch.sweep", _sweep)
    monkeypatch.setattr(design, "job", lambda scene, options, point: Job(point, None))
    trained = [c for c in cases.trained() if c.hand == "constant"]
    of = 3 * cases.SEEDS
    path = make(tmp_path, tmp_path, 1, trained=trained, kept_apart=cases.kept_apart()[:2])
    text = path.read_text()
    assert text.index("| take any of these |") < text.index("## Why") < text.index("## Kept apart")
    for rate in RATES:
        assert f"| {rate} | soft: `foh` | {of} of {of} | 1 (1) |" in text
    assert "Coriolis compensation on: graphics rate" in text
    figures = ("gains", "tracking", "energy", "margins", "integrators", "mobility")
    for name in figures:
        assert f"({name}.png)" in text
        assert (tmp_path / f"{name}.png").is_file()
    with (tmp_path / "runs.csv").open() as file:
        assert sum(1 for _ in csv.DictReader(file)) == design.count(len(trained))
    with (tmp_path / "advice.csv").open() as file:
        rows = {(r["arrangement"], r["bias"], r["rate"]): r for r in csv.DictReader(file)}
    assert len(rows) == 4 * len(design.COLUMNS)
    assert rows[DIRECT, "none", "39"]["try"].startswith("`foh`, soft")
    design.run.cache_clear()


def test_a_folder_that_cannot_be_is_told_before_any_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.mismatch.sweep", lambda *_, **__: pytest.fail("runs"))
    (tmp_path / "file").write_text("")
    assert status("study", "--out", tmp_path / "file") == 2


def test_holds_and_gains_have_an_order() -> None:
    assert method_choice.order(Method("zoh", "stiff")) < method_choice.order(Method("zoh", "soft"))
    assert method_choice.order(Method("zoh", "soft")) < method_choice.order(Method("foh", "stiff"))
    assert next(iter(HOLDS)) == "zoh"


SHORT = ("10", "20", "30")
"""Graphics rates of the short study."""


@pytest.fixture
def short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a study of the serial arm in an arm of 100 N/m, with few holds, rates and maps
    and runs of 1 s; all else is as in the whole one."""
    arranged, whole = design.arranged, design.all_margins()
    for name, value in (
        ("COLUMNS", SHORT),
        ("FEW", SHORT),
        ("OF_MATRICES", ("zoh",)),
        ("OF_MOTION", ("zoh", "foh")),
        ("COMPARED", ("zoh",)),
        ("LIKELY", ("zoh", "foh")),
    ):
        parts = (
            make_module,
            held_out_draws,
            method_choice,
            design,
            page,
            finding_figures,
            robustness,
        )
        for part in parts:
            monkeypatch.setattr(part, name, value, raising=False)
    for hold in [h for h in HOLDS if h not in ("zoh", "foh")]:
        monkeypatch.delitem(HOLDS, hold)
    monkeypatch.setattr(design, "arranged", lambda a, c: (*arranged(a, c), "duration=1.0"))
    few = [w for w in whole if w[1].hold == "zoh" and w[2] == "30"]
    monkeypatch.setattr(design, "all_margins", lambda: few)
    trained = [c for c in cases.trained() if (c.linkage, c.hand) == ("serial", "arm 100")]
    tried = [c for c in cases.kept_apart() if c.linkage == "serial"][:1]
    design.run.cache_clear()
    make(tmp_path / "study", tmp_path / "rows", 1, trained=trained, kept_apart=tried)
    return tmp_path / "study"


def test_a_short_study_says_what_its_runs_give(short: Path, tmp_path: Path) -> None:
    """Its answer is computed again from its rows, and a row from a run of its scene."""
    with (short / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    text = (short / "README.md").read_text()
    tables = re.split(r"\| Coriolis compensation o..?: graphics rate", text)[1:]
    cells = product((DIRECT, MOBILITY), ("none", "full"))
    for (arrangement, bias), table in zip(cells, tables, strict=True):
        for rate in SHORT:
            of_cell = [
                r
                for r in rows
                if (r["arrangement"], r["bias"], r["rate"]) == (arrangement, bias, rate)
            ]
            errors: dict[str, list[float]] = {}
            kept: dict[str, int] = {}
            for r in of_cell:
                own = "" if r["integrator"] == "rk4" else f", {r['integrator']}"
                name = f"`{r['hold']}`, {r['gains']}{own}"
                error, turn = float(r["tracking_max_mm"]), float(r["theta_max_rad"])
                good = r["end"] == "duration" and error < 42 and turn < 1
                errors.setdefault(name, []).extend([error] * good)
                most = max(1e-3, 0.25 * float(r["hand_work_J"]))
                kept[name] = kept.get(name, 0) + (good and float(r["port_peak_J"]) <= most)
            found = re.search(
                rf"\n\| {rate} \| (nothing; nearest: )?(\w+): (`[^`]*`).*? \| (\d+) of (\d+).*? "
                r"\| (\S+)[ |]",
                table,
            )
            assert found
            nothing, gains, hold, count, of, middle = found.groups()
            name = f"{hold}, {gains}"
            assert (int(count), int(of)) == (kept[name], cases.SEEDS)
            assert (nothing is None) == (count == of)
            assert middle == "-" or float(middle) == float(f"{median(errors[name]):.2g}")
            assert (middle == "-") == (not errors[name])
            if rate != "30":  # where a map may forbid a method
                assert kept[name] == max(kept.values())
    case = cases.Case("serial", "arm 100", False, int(rows[0]["seed"]))
    job = design.run(MOBILITY, case, Method("zoh", "stiff"), "none", "30")
    assert job.scene
    table = simulate(job.scene, tmp_path / "run").results.haptics
    apart_m = np.linalg.norm(
        (table["virtual_mechanism.x"] - table["haptic_device.x_true"])[:, :2], axis=1
    )
    (row,) = (r for r in rows if job.point.items() <= r.items())
    assert float(row["tracking_max_mm"]) == pytest.approx(1e3 * apart_m.max(), rel=1e-3)
    design.run.cache_clear()
