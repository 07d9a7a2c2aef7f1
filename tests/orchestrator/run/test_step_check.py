"""The estimate of the steps' error, against the stability function of the integrator."""

from __future__ import annotations

from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.orchestrator.run import step_check
from hapticlink.orchestrator.run.compiled.library import CHOICE

SLIDER = """
title = "A slider in oil"
duration = 2.0
haptics.rate = 512

[linkage]
operational_point = {{ body = "slider", at = [0.0, 0.0] }}
start_velocity = {{ rail = 1.0 }}

[[linkage.body]]
name = "slider"
mass = 0.5
inertia = 1e-3

[[linkage.joint]]
name = "rail"
type = "prismatic"
axis = 0.0
child = "slider"
damping = {damping}

[mechanism]
substeps = {substeps}
"""


def slider(folder: Path, z: float, substeps: int = 1) -> hl.Run:
    """v' = -(b/m) v, with z = -b h/m at the communication step size."""
    path = folder / "slider.toml"
    path.write_text(SLIDER.format(damping=-z * 0.5 * 512, substeps=substeps))
    return hl.run(path)


def rk4(z: float) -> float:
    return 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24


@pytest.mark.parametrize("z", [-0.5, -1.0, -2.0, -2.6])
def test_the_largest_error_is_that_of_the_stability_function(tmp_path: Path, z: float) -> None:
    """v decays, so that the first step that is checked errs most: |R(z) - R(z/2)^2| v_k / v_k+1."""
    found = slider(tmp_path, z).run["step_errors"]["virtual_mechanism"]
    assert found["largest"] == pytest.approx(abs(1 - rk4(z / 2) ** 2 / rk4(z)), rel=1e-12)
    assert found["time"] == (step_check.FIRST - 1) / 512
    assert found["checked"] == 1 + (1024 - step_check.FIRST) // step_check.EVERY


def test_a_step_that_is_too_long_is_told_with_its_remedy(tmp_path: Path) -> None:
    (line,) = slider(tmp_path, -2.0).run["warnings"]
    assert "steps of virtual_mechanism are too long" in line
    assert "mechanism.substeps" in line
    assert slider(tmp_path, -2.0, substeps=20).run["warnings"] == []
    assert slider(tmp_path, -0.1).run["warnings"] == []


def test_light_coupler_under_its_drive_is_told(tmp_path: Path) -> None:
    light = {"linkage.body.1.mass": 1e-3, "linkage.body.1.inertia": 1e-6}
    assert any("too long" in line for line in hl.run("four-bar", light).run["warnings"])
    finer = hl.run("four-bar", light | {"mechanism.substeps": 20})
    assert not any("too long" in line for line in finer.run["warnings"])


@pytest.mark.parametrize("scene", ["closed-loop", "obstacles", "trammel"])
def test_results_do_not_depend_on_the_check(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checked = hl.run(scene, {"duration": 0.5}, out=tmp_path / "checked")
    monkeypatch.setattr(step_check, "FIRST", step_check.EVERY)  # never due
    plain = hl.run(scene, {"duration": 0.5}, out=tmp_path / "plain")
    assert checked.run["step_errors"]
    assert not plain.run["step_errors"]
    for rate in plain.run["rates"]:
        found = [
            (tmp_path / folder / f"{rate}.csv").read_bytes() for folder in ("checked", "plain")
        ]
        assert found[0] == found[1]


@pytest.mark.parametrize("loop", ["python", "compiled"])
def test_what_is_found_does_not_depend_on_loop_and_room(
    loop: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = hl.run("obstacles", {"duration": 1.0}).run["step_errors"]
    monkeypatch.setenv(CHOICE, loop)
    monkeypatch.setattr(step_check, "ROOM", 1)  # as many checks as grow the arrays three times
    found = hl.run("obstacles", {"duration": 1.0})
    assert (found.run["in_python"] == {}) == (loop == "compiled")
    assert found.run["step_errors"] == expected
    assert expected["virtual_mechanism"]["checked"] > 4
