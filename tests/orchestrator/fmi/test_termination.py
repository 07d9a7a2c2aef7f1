"""An FMU that requests the end of the simulation: a regular end with the last row."""

import numpy as np
import pytest

from tests.orchestrator.foreign_fmus import ISOLATED, fmu_table, python_fmu, run, scene, stair_fmu
from tests.shared_fixtures import status

STAIR = fmu_table("stair", "stair", "rate = {}\n")


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
def test_the_stair_ends_at_its_top(tmp_path, coupling, isolate):
    """As Reference-FMUs' Stair at 5 Hz: its last row is (9.0, 10); the others' is of that time."""
    stair_fmu(tmp_path)
    python_fmu(tmp_path, "Beside")
    text = isolate + STAIR.format(5) + fmu_table("beside", "Beside")
    options = (f"coupling={coupling}", "duration=20", "haptics.rate=10")
    experiment, found = run(tmp_path, text, *options)
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason, outcome.end_time) == (None, "terminated", 9.0)
    rows = found.tables["5hz"]
    np.testing.assert_array_equal(rows["time"], np.arange(46) / 5)
    np.testing.assert_array_equal(rows["stair.counter"], 1 + np.floor(np.arange(46) / 5))
    assert (rows["time"][-1], rows["stair.counter"][-1]) == (9.0, 10)
    assert found.haptics["time"][-1] == found.haptics["beside.y"][-1] == 9.0
    assert found.run["end"] == {
        "reason": "terminated", "time": 9.0,
        "asked": "stair has asked to end the simulation",
    }  # fmt: skip


def test_the_end_within_a_step_leaves_the_row_before_it(tmp_path):
    stair_fmu(tmp_path)
    experiment, found = run(tmp_path, STAIR.format(0.4), "duration=20", "haptics.rate=10")
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason) == (None, "terminated")
    assert found.tables["0.4hz"]["time"][-1] == 7.5
    assert outcome.asked == "stair asks to end the simulation at 9 s, within its step"


def test_a_retried_step_that_ends_is_no_discard(tmp_path):
    stair_fmu(tmp_path, canGetAndSetFMUstate="true", canHandleVariableCommunicationStepSize="true")
    options = ("duration=20", "haptics.rate=10", "faults.discard=retry")
    experiment, found = run(tmp_path, STAIR.format(5), *options)
    assert (experiment.outcome.fault, experiment.outcome.reason) == (None, "terminated")
    assert found.tables["5hz"]["stair.counter"][-1] == 10


def test_the_command_says_who_asked(tmp_path, capsys):
    stair_fmu(tmp_path)
    path = scene(tmp_path, STAIR.format(5), rate=10, duration=20)
    assert status("run", path, "--no-figures", "--out", tmp_path / "out") == 0
    told = capsys.readouterr()
    assert "scene: ended: stair has asked to end the simulation, at 9 s" in told.out
    assert not told.err
