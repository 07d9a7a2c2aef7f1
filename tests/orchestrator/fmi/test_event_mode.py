"""Events of FMI 3.0 FMUs, of one that returns an error for a call in the wrong state."""

import numpy as np
import pytest

from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.in_process import in_process
from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import event_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, ran, run, wire_table

ONE = fmu_table("one", "events")
SLOPE, ALARM = 1.1, 0.3
"""1/s of x for u = 0.1, and s between time events: few of either fall on ends of steps."""


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_a_step_is_cut_at_events_and_goes_on_to_its_end(tmp_path, isolate):
    event_fmu3(tmp_path)
    found = ran(tmp_path, f"{ONE}{isolate}start.u = 0.1\n", "duration=4.0").haptics
    t = found["time"]
    np.testing.assert_array_equal(found["one.falls"], falls := np.floor(SLOPE * t))
    np.testing.assert_array_equal(found["one.alarms"], alarms := np.floor((t + 1e-9) / ALARM))
    np.testing.assert_allclose(found["one.x"], SLOPE * t - falls, rtol=0, atol=1e-11)
    at_ends = np.isclose(64 * ALARM * np.arange(1, alarms[-1] + 1) % 1, 0).sum()
    assert found["one.parts"][-1] == len(t) - 1 + falls[-1] + alarms[-1] - at_ends
    assert found["one.entered"][-1] == falls[-1] + alarms[-1]


def test_steps_of_one_size_have_their_events_at_their_ends(tmp_path):
    event_fmu3(tmp_path, varies=False)
    found = ran(tmp_path, f"{ONE}start.u = 0.1\n", "duration=4.0").haptics
    steps = np.arange(len(found["time"]))
    np.testing.assert_array_equal(found["one.parts"], steps)
    np.testing.assert_array_equal(found["one.falls"], np.floor(SLOPE * found["time"]))
    np.testing.assert_array_equal(found["one.alarms"], np.floor((steps / 64 + 1e-9) / ALARM))


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_discrete_inputs_change_in_event_mode_and_continuous_ones_in_step_mode(tmp_path, isolate):
    event_fmu3(tmp_path)
    python_fmu(tmp_path, "Gives", "self.y = 0.25 if time < 0.1 else 0.5")
    python_fmu(tmp_path, "Counts", "self.y = -(self.steps // 8)")
    wires = wire_table("gives.y", "one.u") + wire_table("counts.y", "one.level")
    others = fmu_table("gives", "Gives") + fmu_table("counts", "Counts")
    found = ran(tmp_path, ONE + isolate + others + wires, "coupling=jacobi").haptics
    level, rate = np.rint(found["counts.y"]), 1 + found["gives.y"]
    # An input acts from the communication point on at which it is set.
    expected = np.concatenate([[0.0], np.cumsum(rate[:-1] / 64)]) + np.roll(level, 1) * 1.0
    expected[0] = 0.0
    np.testing.assert_allclose(found["one.x"] + found["one.falls"], expected, rtol=0, atol=1e-11)
    changes = 1 + np.count_nonzero(np.diff(level[:-1]))  # the first time they are set as well
    assert found["one.entered"][-1] == found["one.falls"][-1] + found["one.alarms"][-1] + changes


def test_an_fmu_that_refuses_event_mode_handles_its_events_itself(tmp_path, caplog):
    event_fmu3(tmp_path, token="{refuses}")
    found = ran(tmp_path, f"{ONE}start.u = 0.1\n", "duration=4.0").haptics
    assert "one declares event mode (hasEventMode) and refuses it" in caplog.text
    np.testing.assert_array_equal(found["one.falls"], np.floor(SLOPE * found["time"]))
    assert found["one.entered"][-1] == 0


@pytest.mark.parametrize(
    ("mode", "varies", "message"),
    [
        (1, False, "one: fmi3DoStep returned early, at 0.015625 s, unasked at t = 0 s"),
        (2, True, "one: its discrete states need an update after 1000 of them at t = 0.3 s"),
        (4, True, "one: fmi3DoStep returned early 1000 times in a row at t = 0 s"),
    ],
)
def test_what_never_ends_or_was_not_asked_is_a_fault(tmp_path, mode, varies, message):
    event_fmu3(tmp_path, varies)
    assert message in fault(tmp_path, f"{ONE}start.mode = {mode}\n")


@pytest.mark.parametrize(("mode", "end"), [(3, 1.0), (5, 0.0)])
def test_a_request_to_end_in_event_mode(tmp_path, mode, end):
    event_fmu3(tmp_path)
    experiment, _ = run(tmp_path, f"{ONE}start.mode = {mode}\n", "duration=4.0")
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason, outcome.end_time) == (None, "terminated", end)


def test_a_restored_state_has_the_time_events_that_it_had(tmp_path):
    description = describe(event_fmu3(tmp_path))
    outputs = np.zeros(len(description.outputs))
    with in_process(description)("one", description, outputs) as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.exit_initialization()
        instance.save()
        reached = []
        for _ in range(2):
            for k in range(8):
                instance.step(k / 8, (k + 1) / 8, 1 / 8)
            instance.get()
            reached.append(outputs.tolist())
            instance.rollback()
    assert reached[0] == reached[1]
    assert reached[0][0] == pytest.approx(0.0, abs=1e-12)  # x has fallen at 1 s
