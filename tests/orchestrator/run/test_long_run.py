"""A run of any length shows its first rows at once: nothing walks through it before."""

import pytest

from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays

LONG = "duration=1e5"  # the longest that a scene takes
SOON = "stop_when='virtual_mechanism.energy > 1e-5'"


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["graphics.align=tick", "graphics.rate=29.97"],
        ["graphics.phase=0.01", "phases.virtual_mechanism=0.0005"],
        ["delays.hand.F={ min = 0.001, max = 0.004, seed = 1 }"],
    ],
    ids=["exact", "aligned", "phases", "drawn latencies"],
)
def test_a_run_of_1e5_s_has_rows(tmp_path, options):
    experiment = simulate("closed-loop", tmp_path, [LONG, SOON, *options])
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason) == (None, "stop_when")
    assert 0 < outcome.end_time < 1
    assert experiment.results.run["delays"]["haptic_device.x -> controller.x_D"]["max"] == 0.0


def test_ages_of_a_run_are_those_of_its_plan(tmp_path):
    experiment = simulate("closed-loop-direct", tmp_path, ["duration=0.6"])
    assert experiment.outcome.details.delays == delays(Plan(experiment.system))
