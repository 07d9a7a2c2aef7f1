"""Clocks of FMI 3.0 FMUs, of one that returns an error for a clock that is not due, for what has
clocks where none of them is active, and for a step that passes one over."""

import numpy as np
import pytest

from hapticlink.orchestrator.base.errors import SceneFault
from tests.little_fmus import edited, python_fmu
from tests.orchestrator.c_fmus import clock_fmu3, event_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, ran, run, wire_table

ONE = fmu_table("one", "clocks")


def before(instants, t):
    """How many of the instants are before each of the times."""
    return np.searchsorted(np.array(instants) + 1e-9, t)


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_clocks_are_active_at_their_instants(tmp_path, isolate):
    """Within steps of 1/64 s too. At a communication point a clock is active in the step from it,
    whose inputs it takes."""
    clock_fmu3(tmp_path)
    python_fmu(tmp_path, "Gives")  # y = t
    wire = wire_table("gives.y", "one.w")
    scene = ONE + isolate + fmu_table("gives", "Gives") + wire
    found = ran(tmp_path, scene, "duration=1.5", "coupling=jacobi").haptics
    t = found["time"]
    sample = 0.05 + 0.1 * np.arange(20)
    expected = {
        "sample": sample,
        "told": 0.25 * np.arange(9),
        "fired": sample[2::3],
        "grows": 0.03 * np.array([1.0, 3.0, 7.0, 15.0, 31.0, 63.0]),
        "go": [],
        "later": [],
    }
    for name, instants in expected.items():
        np.testing.assert_array_equal(found[f"one.{name}_count"], before(instants, t), name)
    np.testing.assert_array_equal(found["one.fired"], found["one.fired_count"])
    np.testing.assert_allclose(found["one.plain"], t, rtol=0, atol=1e-12)
    newest = np.floor((sample + 1e-9) * 64) / 64  # the communication point before each
    held = np.concatenate([[0.0], newest])[before(sample, t)]
    np.testing.assert_array_equal(found["one.held"], held)


@pytest.mark.parametrize(("source", "target"), [(64, 64), (64, 16), (16, 64)])
def test_an_output_clock_triggers_an_input_clock(tmp_path, source, target):
    """At the next communication point of the target, which then takes what is connected; a default
    hold that makes values between samples leaves the counts of a clock as they are."""
    clock_fmu3(tmp_path)
    python_fmu(tmp_path, "Gives")
    two = fmu_table("two", "clocks", f"rate = {target}\n")
    fmus = fmu_table("one", "clocks", f"rate = {source}\n") + two + fmu_table("gives", "Gives")
    wires = wire_table("one.fired", "two.go") + wire_table("one.held", "two.v", 'hold = "zoh"\n')
    wires += wire_table("gives.y", "one.w") + wire_table("one.plain", "two.w")
    options = "duration=1.5", "coupling=jacobi", "hold=foh" if source < target else "hold=zoh"
    found = ran(tmp_path, fmus + wires, *options).tables["16hz" if target == 16 else "haptics"]
    t, sample = found["time"], 0.05 + 0.1 * np.arange(20)
    read = (np.floor(sample * source + 1e-9) + 1) / source  # the end of the step
    gone = np.ceil(read[2::3] * target - 1e-9) / target
    later = gone + 0.02
    np.testing.assert_array_equal(found["two.go_count"], before(gone, t))
    np.testing.assert_array_equal(found["two.later_count"], before(later, t))
    when = np.concatenate([[0.0], later])[before(later, t)]
    np.testing.assert_allclose(found["two.when"], when, rtol=0, atol=1e-12)
    held = np.floor(sample * source + 1e-9) / source  # the communication point before
    got = held[np.searchsorted(read, gone + 1e-9) - 1]
    np.testing.assert_array_equal(found["two.got"], np.concatenate([[0.0], got])[before(gone, t)])


def test_a_sampled_block_at_the_rate_of_its_clock_has_no_delay(tmp_path):
    """Its outputs of an instant are made of the inputs of that instant."""
    clock_fmu3(tmp_path, shift=0.0)
    python_fmu(tmp_path, "Gives")  # y = t
    one = fmu_table("one", "clocks", 'rate = 10\ntiming = "sampled"\n')
    gives = fmu_table("gives", "Gives", "rate = 10\n")
    found = ran(tmp_path, gives + one + wire_table("gives.y", "one.w"), "duration=2.0")
    table = found.tables["10hz"]
    np.testing.assert_array_equal(table["one.held"], table["gives.y"])
    np.testing.assert_array_equal(
        table["one.sample_count"][1:], np.arange(2, len(table["time"]) + 1)
    )


def test_a_clock_within_a_step_of_fixed_size_is_a_fault(tmp_path):
    clock_fmu3(tmp_path, hasEventMode="true")
    said = fault(tmp_path, ONE)
    assert said.startswith("one: clock grows is due at 0.03 s, within a step, and the FMU takes")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("hasEventMode", "hasNone", r"has clocks \(sample\) and no event mode"),
        ('intervalDecimal="0.1"', "", "clock sample is constant and states no interval"),
        ('intervalDecimal="0.1"', 'intervalDecimal="0"', "clock sample: its interval is 0 s"),
        ('"constant"', '"tunable"', None),
    ],
)
def test_clocks_that_no_run_can_activate(tmp_path, old, new, message):
    edited(clock_fmu3(tmp_path), lambda text: text.replace(old, new))
    if message is None:  # its interval is the declared one, which nobody sets
        assert ran(tmp_path, ONE).haptics["one.sample_count"][-1] == 5
        return
    with pytest.raises(SceneFault, match=message):
        run(tmp_path, ONE)


def test_an_interval_as_a_fraction(tmp_path):
    """1/10 s from 1/20 s on, as decimals say it above."""
    fraction = 'intervalCounter="2" shiftCounter="1" resolution="20" supportsFraction="true" '
    path = clock_fmu3(tmp_path)
    edited(path, lambda text: text.replace("intervalDecimal", fraction + "intervalDecimal"))
    found = ran(tmp_path, ONE, "duration=1.5").haptics
    instants = 0.05 + 0.1 * np.arange(20)
    np.testing.assert_array_equal(found["one.sample_count"], before(instants, found["time"]))


def test_a_clock_is_connected_to_a_clock(tmp_path):
    clock_fmu3(tmp_path)
    event_fmu3(tmp_path)
    scene = ONE + fmu_table("two", "events")
    with pytest.raises(SceneFault, match="fired is a clock, which is connected to a clock only"):
        run(tmp_path, scene + wire_table("one.fired", "two.level"))
    with pytest.raises(SceneFault, match="sample"):  # the FMU itself tells when it is due
        run(tmp_path, scene + wire_table("one.fired", "one.sample"))


def test_scheduled_execution_is_refused_with_the_reason(tmp_path):
    path = clock_fmu3(tmp_path)
    edited(path, lambda text: text.replace("<CoSimulation", "<ScheduledExecution"))
    with pytest.raises(SceneFault, match="it is for scheduled execution only"):
        run(tmp_path, ONE)
