"""The estimate of the steps' error, against the stability function of the integrator."""

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.run import step_check
from hapticlink.orchestrator.run.compiled.operation_records import Machine
from tests.orchestrator.results.records import tables_of
from tests.shared_fixtures import run_once

DEAD_CENTRE = """
title = "A slider turns a light crank over its dead centre"
duration = 2.0
haptics.rate = 1000

[linkage]
operational_point = { body = "slider" }
start = { crank = 1.0, rod = -1.3, slide = 0.28 }
start_velocity = { crank = 2.0 }
body = [
  { name = "crank", mass = 0.0, inertia = 1e-5 },
  { name = "rod", mass = 1e-5, inertia = 1e-5 },
  { name = "slider", mass = 1.0, inertia = 0.0 },
]
joint = [
  { name = "crank", child = "crank" },
  { name = "rod", parent = "crank", child = "rod", at_parent = [0.1, 0.0] },
  { name = "slide", type = "prismatic", axis = 0.0, child = "slider" },
]
loop = [{ bodies = ["rod", "slider"], at = [[0.25, 0.0], [0.0, 0.0]] }]
"""


@pytest.fixture
def slider(bar):
    """v' = -(b/m) v - (k/m) x, with z = -b h/m and spring = h sqrt(k/m) at the communication step
    size."""

    def run(z, substeps=1, spring=0.0):
        options = {
            "duration": 2.0,
            "haptics.rate": 512,
            "linkage.start_velocity.slide": 1.0,
            "linkage.joint.slide.damping": -z * 512,
            "linkage.joint.slide.stiffness": (512 * spring) ** 2,
            "mechanism.substeps": substeps,
        }
        return hl.run(bar, options)

    return run


def too_long(run: hl.Run) -> bool:
    return any("too long" in line for line in run.run["warnings"])


def rk4(z: float) -> float:
    return 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24


@pytest.mark.parametrize("z", [-0.5, -1.0, -2.0, -2.6])
def test_errors_are_those_of_the_stability_function(slider, z):
    """v decays from 1: the first step errs most, and changes v most, so that the second is checked,
    too."""
    found = slider(z).run["step_errors"]["virtual_mechanism"]
    apart, first = abs(rk4(z) - rk4(z / 2) ** 2), step_check.FIRST - 1
    assert found["largest"] == pytest.approx(apart, rel=1e-12)
    assert found["time"] == 0
    assert found["checked"] == 3 + (1024 - step_check.FIRST) // step_check.EVERY
    regular = sum(rk4(z) ** k for k in range(first, 1024, step_check.EVERY))
    total = apart * (1 + rk4(z) + step_check.EVERY * regular)
    assert found["sum"] == pytest.approx(total, rel=1e-9)


def test_the_sum_is_what_errors_add_up_to(slider):
    """A slider on a spring: v = cos(w t); e_k is 2/pi of its amplitude in the mean."""
    run = slider(0.0, spring=0.4)
    v, t = run["haptics"]["virtual_mechanism.v"][:, 0], run["haptics"]["time"]
    error = np.abs(v - np.cos(0.4 * 512 * t)).max()
    found = run.run["step_errors"]["virtual_mechanism"]["sum"]
    assert found == pytest.approx(2 / np.pi * error, rel=0.1)


def test_a_short_episode_is_told(tmp_path):
    """A light crank passes its dead centre within three steps, and energy changes by a tenth."""
    path = tmp_path / "dead.toml"
    path.write_text(DEAD_CENTRE)
    coarse, fine = hl.run(path), hl.run(path, {"mechanism.substeps": 50})
    lost = [np.ptp(run["haptics"]["virtual_mechanism.energy"]) for run in (coarse, fine)]
    assert lost[0] > 0.1 * coarse["haptics"]["virtual_mechanism.energy"][0] > 1e4 * lost[1]
    assert [too_long(coarse), too_long(fine)] == [True, False]


def test_a_step_that_is_too_long_is_told_with_its_remedy(slider):
    (line,) = slider(-2.0).run["warnings"]
    assert "steps of virtual_mechanism are too long" in line
    assert "mechanism.substeps" in line
    assert slider(-2.0, substeps=20).run["warnings"] == []
    assert slider(-0.1).run["warnings"] == []


def test_light_coupler_under_its_drive_is_told(tmp_path):
    light = {"linkage.body.1.mass": 1e-3, "linkage.body.1.inertia": 1e-6}
    assert too_long(hl.run("four-bar", light))
    assert not too_long(hl.run("four-bar", light | {"mechanism.substeps": 20}))


@pytest.mark.parametrize("scene", ["closed-loop-ideal", "obstacles", "trammel"])
def test_results_do_not_depend_on_the_check(scene, tmp_path, monkeypatch):
    checked = hl.run(scene, {"duration": 0.5}, out=tmp_path / "checked", figures=False)
    monkeypatch.setattr(step_check.StepCheck, "possible", lambda description: False)
    plain = hl.run(scene, {"duration": 0.5}, out=tmp_path / "plain", figures=False)
    assert checked.run["step_errors"]
    assert not plain.run["step_errors"]
    assert tables_of(checked.folder) == tables_of(plain.folder)


def test_what_is_found_does_not_depend_on_room(monkeypatch):
    expected = run_once("obstacles", {"duration": 1.0}).run["step_errors"]
    monkeypatch.setattr(step_check, "ROOM", 1)  # as many checks as grow the arrays three times
    found = hl.run("obstacles", {"duration": 1.0})
    assert found.run["in_python"] == {}
    assert found.run["step_errors"] == expected
    assert expected["virtual_mechanism"]["checked"] > 4


def test_steps_that_are_left_to_python_are_checked_alike(monkeypatch):
    """Those of an FMU that the loop does not call itself, as one whose texts are connected."""
    expected = run_once("obstacles", {"duration": 1.0}).run
    monkeypatch.setattr(Machine, "_fmu", lambda self, name: None)
    found = hl.run("obstacles", {"duration": 1.0}).run
    assert "step virtual_mechanism" in found["in_python"]
    assert found["step_errors"] == expected["step_errors"]
    assert found["calls"] == expected["calls"]


CONTRADICTION = """
title = "Gears that contradict each other hold two sliders still"
duration = 0.2
haptics.rate = 512
[linkage]
operational_point = { body = "one" }
body = [{ name = "one", mass = 0.1, inertia = 1e-4 }, { name = "two", mass = 0.2, inertia = 1e-4 }]
joint = [
  { name = "one", type = "prismatic", axis = 0, child = "one", drive = { effort = 0.3 } },
  { name = "two", type = "prismatic", axis = 0, child = "two" },
]
gear = [{ joints = ["two", "one"], ratio = -1.5 }, { joints = ["two", "one"], ratio = 2.0 }]
"""


def test_of_rounding_that_moves_nothing_no_share_is_told(tmp_path):
    (tmp_path / "scene.toml").write_text(CONTRADICTION)
    found = hl.run(tmp_path / "scene.toml", out=tmp_path / "out")
    rates = found.haptics["virtual_mechanism.qd"]
    assert 0 < np.abs(rates).max() < 1e-12
    assert not too_long(found)
