"""A run that diverges with finite values is reported and does not end with status 0."""

import pytest

from hapticlink.orchestrator.base.errors import Diverged
from hapticlink.orchestrator.experiment import simulate
from tests.little_fmus import python_fmu, slave, with_units
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, ran, run, scene
from tests.shared_fixtures import status


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize(("start", "bound", "rows"), [(0.0, "1e+12", 3), (2e5, "2e+17", 5)])
def test_an_output_beyond_1e12_of_its_start(tmp_path, start, bound, rows, isolate):
    variables = ("output", {"y": start}), ("local", {"steps": 0})
    body = "values['steps'] += 1; values['y'] += 1e4 ** values['steps']"
    with_units(slave(tmp_path, "Grows", *variables, body=body), y="m")
    experiment, found = run(tmp_path, fmu_table("one", "Grows", isolate))
    assert isinstance(experiment.outcome.fault, Diverged)
    assert experiment.outcome.reason == found.run["end"]["reason"] == "diverged"
    assert f", beyond {bound}: the run has diverged" in str(experiment.outcome.fault)
    assert len(found.haptics["time"]) == rows


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_an_output_without_a_unit_that_grows_beyond_1e100(tmp_path, isolate):
    """Tenfold at each step: it is there with step 101, and larger with the next."""
    python_fmu(tmp_path, "Grows", "self.y = 10.0**self.steps")
    path = scene(tmp_path, fmu_table("one", "Grows", isolate), duration=4.0)
    experiment = simulate(str(path), tmp_path / "out")
    assert isinstance(experiment.outcome.fault, Diverged)
    assert "output y is 1e+102, beyond 1e+100" in str(experiment.outcome.fault)
    assert experiment.results.haptics["one.y"].max() == 1e101


@pytest.mark.parametrize("infinity", [1e300, -1.7976931348623157e308])
def test_a_number_that_stands_for_infinity_ends_no_run(tmp_path, infinity):
    python_fmu(tmp_path, "Waits", f"self.y = {infinity} if 2 < self.steps < 9 else time")
    assert ran(tmp_path, fmu_table("one", "Waits")).haptics["one.y"][8] == infinity


def test_a_held_output_is_bounded_too(tmp_path):
    body = "self.y = float('nan') if self.steps < 3 else 1e13"
    with_units(python_fmu(tmp_path, "Grows", body), y="m")
    experiment, found = run(tmp_path, fmu_table("one", "Grows"), "faults.nan=hold")
    assert isinstance(experiment.outcome.fault, Diverged)
    assert found.run["held_outputs"] == {"one": 2}


def test_a_whole_number_is_bounded_by_its_type(tmp_path):
    python_fmu(tmp_path, "Counts", "self.steps = 2_000_000_000")
    found = ran(tmp_path, fmu_table("one", "Counts"))
    assert found.haptics["one.steps"][-1] == 2e9


def test_closures_that_come_apart_by_a_link(tmp_path):
    """Its links are 40, 120 and 90 mm long, 83 mm in the mean."""
    options = ["haptics.rate=20", "mechanism.stabilization=none"]
    outcome = simulate("four-bar", tmp_path, options).outcome
    assert isinstance(outcome.fault, Diverged)
    assert "virtual_mechanism: output closure_error is " in str(outcome.fault)
    assert "beyond 0.0833: the run has diverged" in str(outcome.fault)


def test_energy_that_nobody_put_in(tmp_path, capsys):
    """A pendulum of 2.5 kg and 0.2 m gains with every step that is too long for its method."""
    fine, coarse = "haptics.rate=100", "haptics.rate=3"
    heun = "mechanism.integrator=heun"
    assert simulate("pendulum", tmp_path / "fine", [fine, heun]).outcome.fault is None
    options = ("--set", coarse, "--set", heun)
    assert status("run", "pendulum", "--no-figures", "--out", tmp_path / "coarse", *options) == 1
    told = capsys.readouterr()
    assert "J more than it had at the start and was given: the run has diverged" in told.err
    assert "pendulum: diverged at 10 s" in told.out


def test_what_wrenches_and_drives_put_in_is_no_divergence(tmp_path):
    for name in ("single-body", "four-bar", "two-hands", "obstacles"):
        assert simulate(name, tmp_path / name, ["duration=0.3"]).outcome.fault is None


def test_an_unstable_loop_that_leaves_the_workspace_is_told_as_such(tmp_path):
    """The report's gains are those of a mechanism at 512 Hz, not at 10; a hand that pushes the
    handle out does so in good order."""
    options = [
        "hold=foh-derivative", "graphics.rate=10",
        "controller.teleoperation.stiffness=[100.0, 100.0, 0.5]",
        "controller.teleoperation.damping=[70.0, 70.0, 0.375]",
    ]  # fmt: skip
    outcome = simulate("closed-loop-direct", tmp_path / "unstable", options).outcome
    assert outcome.reason == "diverged"
    assert outcome.end_time < 1.0
    said = "haptic_device: left its workspace, and sampling and holding generated "
    assert str(outcome.fault).startswith(said)
    assert "J were put in: the loop is unstable" in str(outcome.fault)
    options = ["controller.topology=false", "hand.wrench=[0, 1, 0]"]
    pushed = simulate("closed-loop-ideal", tmp_path / "pushed", options).outcome
    assert (pushed.reason, pushed.fault) == ("stop_when", None)


def test_holds_that_make_more_than_was_put_in_are_told(tmp_path, capsys):
    assert status("run", "sampled-spring", "--no-figures", "--out", tmp_path) == 0
    said = "neither hands nor mechanism put in any on the whole: the loop is not passive"
    assert said in capsys.readouterr().out
