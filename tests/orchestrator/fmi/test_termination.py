"""An FMU that requests the end of the simulation: a regular end with the last row."""

import numpy as np
import pytest

from hapticlink.orchestrator.results import tables
from tests.orchestrator.foreign_fmus import ISOLATED, fmu_table, python_fmu, run, scene, stair_fmu
from tests.shared_fixtures import sets, status

STAIR = fmu_table("stair", "stair", "rate = {}\n")
LONG = ("duration=20", "haptics.rate=10")


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
def test_the_stair_ends_at_its_top(tmp_path, coupling, isolate):
    """As Reference-FMUs' Stair at 5 Hz: its last row is (9.0, 10); the others' is of that time."""
    stair_fmu(tmp_path)
    python_fmu(tmp_path, "Beside")
    text = isolate + STAIR.format(5) + fmu_table("beside", "Beside")
    experiment, found = run(tmp_path, text, f"coupling={coupling}", *LONG)
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason, outcome.end_time) == (None, "terminated", 9.0)
    rows = found.tables["5hz"]
    np.testing.assert_array_equal(rows["time"], np.arange(46) / 5)
    np.testing.assert_array_equal(rows["stair.counter"], 1 + np.floor(np.arange(46) / 5))
    assert (rows["time"][-1], rows["stair.counter"][-1]) == (9.0, 10)
    assert found.haptics["time"][-1] == found.haptics["beside.y"][-1] == 9.0
    asked = "stair has asked to end the simulation"
    assert found.run["end"] == {"reason": "terminated", "time": 9.0, "asked": asked}


def test_the_end_within_a_step_leaves_the_row_before_it(tmp_path):
    stair_fmu(tmp_path)
    experiment, found = run(tmp_path, STAIR.format(0.4), *LONG)
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason) == (None, "terminated")
    assert found.tables["0.4hz"]["time"][-1] == 7.5
    assert outcome.asked == "stair asks to end the simulation at 9 s, within its step"


def test_a_retried_step_that_ends_is_no_discard(tmp_path, capsys):
    """The command says who asked."""
    stair_fmu(tmp_path, canGetAndSetFMUstate="true", canHandleVariableCommunicationStepSize="true")
    path, out = scene(tmp_path, STAIR.format(5), 10, 20), tmp_path / "out"
    assert status("run", path, "--no-figures", "--out", out, *sets(["faults.discard=retry"])) == 0
    told = capsys.readouterr()
    assert "scene: ended: stair has asked to end the simulation, at 9 s" in told.out
    assert not told.err
    assert tables.load(out).tables["5hz"]["stair.counter"][-1] == 10
