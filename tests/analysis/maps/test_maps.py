"""Maps of stability: their boundary against closed forms, their checks, and their continuation."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.maps import run_checks, wall_closed_form
from hapticlink.analysis.stability import wall_limits
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.overrides import write_options
from tests.analysis.stability.own_hand import DAMPED as WALL

M, D, T = 0.3, 5.0, 1 / 512
STIFFNESS, DAMPING = "fmu.wall.start.stiffness", "fmu.wall.start.damping"
VARY = [f"{DAMPING}=1,20,40", f"{STIFFNESS}=2000,6000,10000", "hold=zoh,foh"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(scope="module")
def wall(folder: Path) -> hl.Map:
    return hl.stability_map("virtual-wall", VARY, WALL, out=folder, check=2, seed=2, jobs=1)


def test_the_boundary_is_that_of_the_closed_form(wall: hl.Map) -> None:
    edge = [row for row in wall.of("boundary") if row["hold"] == "zoh"]
    assert {row["along"] for row in edge} == {STIFFNESS, DAMPING}
    for row in edge:
        limit = wall_limits.stable(M, D, T, 0, float(row[DAMPING]))
        assert float(row[STIFFNESS]) == pytest.approx(limit, rel=1e-3)
    form = wall_closed_form.form(wall.scene, {"hold": "zoh"}, DAMPING, STIFFNESS)
    assert form is not None
    grid = [row for row in wall.of("grid") if row["hold"] == "zoh"]
    x, y = (np.array([float(row[key]) for row in grid]) for key in (DAMPING, STIFFNESS))
    radii = [row["spectral_radius"] for row in grid]
    assert form(x, y) == pytest.approx(radii, rel=1e-7)
    assert wall_closed_form.form(wall.scene, {"hold": "foh"}, DAMPING, STIFFNESS) is None


HELD = {"type": "spring", "stiffness": [300.0, 0.0, 0.0], "damping": [5.0, 0.0, 0.0]}
OTHERS: dict[str, dict[str, Any]] = {
    "jacobi": {"coupling": "jacobi"},
    "another integrator": {"mechanism.integrator": "semi-implicit-euler"},
    "sprung": {"linkage.joint.rail.stiffness": 500.0},
    "held": {"hand": HELD},
    "pulse": {"fmu.wall.settings.pulse": 0.3},
    "velocity measured": {
        "fmu.wall.settings.velocity": "measured",
        "connection.+": {"from": "virtual_mechanism.rail.velocity", "to": "wall.v"},
    },
}


def test_another_loop_has_no_closed_form() -> None:
    def has_one(options: dict[str, Any]) -> bool:
        scene = hl.scene("virtual-wall", WALL | options)
        return wall_closed_form.form(scene, {}, DAMPING, STIFFNESS) is not None

    assert has_one({})
    assert [name for name, other in OTHERS.items() if has_one(other)] == []


def test_runs_agree_with_the_map(wall: hl.Map) -> None:
    tried = wall.of("check")
    assert len(tried) == 2
    assert all(row["agree"] for row in tried)
    assert {row["verdict"] for row in tried} == {"stable", "unstable"}


@pytest.mark.parametrize("foretold", [5.0, -5.0])
def test_a_run_is_judged_alike_whatever_was_foretold(foretold: float) -> None:
    """A wall below its limit, whose slow decay two seconds would not show."""
    scene = open_scene.load(
        "virtual-wall", [*write_options(WALL), f"{STIFFNESS}=4900", f"{DAMPING}=0"]
    )
    (radius,) = wall_limits.radius(M, D, T, 0, np.array([4900.0]), np.zeros(1))
    growth, verdict = run_checks.of_run(scene, foretold)
    assert growth == pytest.approx(np.log(radius) / T, rel=1e-3)
    assert -0.5 < growth < 0.0
    assert verdict == "stable"


def test_a_mode_that_grows_below_a_decaying_one_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """exp(-1.3 t) + 1e-9 exp(1.7 t), as of a scene that starts near its rest: for 4.7 s the first
    term is all that is seen, and a map that is wrong as well foretells its decay."""
    t = np.linspace(0.0, run_checks.LONGEST, 15361)
    speed = np.exp(-1.3 * t) + 1e-9 * np.exp(1.7 * t)
    monkeypatch.setattr(run_checks, "_speeds", lambda scene: (speed, len(speed)))
    scene = open_scene.load("virtual-wall", [])
    for foretold in (1.7, -1.3):
        rate, verdict = run_checks.of_run(scene, foretold)
        assert rate < -1.0 / run_checks.SHORTEST or rate > 1.0
        assert verdict == "unstable"


def test_a_map_is_continued_and_not_computed_again(wall: hl.Map, folder: Path) -> None:
    """One line is lost, and those that are kept are believed."""
    (folder / "map.csv").unlink()
    kept = sorted((folder / "rows").iterdir())
    kept[0].unlink()
    before = {path: path.stat().st_mtime_ns for path in kept[1:]}
    again = hl.stability_map("virtual-wall", VARY, WALL, out=folder, check=2, seed=2, jobs=2)
    assert again.rows == wall.rows
    assert {path: path.stat().st_mtime_ns for path in kept[1:]} == before
    assert kept[0].exists()
    with (folder / "map.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(wall.rows)
    assert (folder / "map.png").exists()


def test_a_variant_that_diverges_at_its_start_is_refused_and_no_other_is_lost(
    tmp_path: Path,
) -> None:
    vary = [f"{STIFFNESS}=1000,1e9,2000", f"{DAMPING}=5,10"]
    found = hl.stability_map(
        "virtual-wall", vary, WALL | {"hand.wrench": [1.0, 0.0, 0.0]}, out=tmp_path
    )
    grid = found.of("grid")
    assert [row["verdict"] for row in grid].count("stable") == 4
    refused = [row for row in grid if row["verdict"] == "refused"]
    assert all(float(row[STIFFNESS]) == 1e9 for row in refused)
    assert all("diverged" in row["message"] for row in refused)
    assert len(refused) == 2


def test_a_map_needs_a_key_of_numbers(tmp_path: Path) -> None:
    with pytest.raises(hl.InputFault, match="no key has two numbers"):
        hl.stability_map("virtual-wall", ["hold=zoh,foh"], out=tmp_path)
