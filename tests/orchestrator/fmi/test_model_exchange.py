"""FMUs for model exchange, integrated by CVODE: against closed forms, and against FMPy."""

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi import event_mode
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.fmi.in_process import in_process
from hapticlink.programs.foreign import read_foreign
from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import equations_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, ran, run, scene, wire_table
from tests.shared_fixtures import status

ONE = fmu_table("one", "equations")
K = 2.0
PERIOD = np.log(2.0) / K
"""From `top` 1 to `level` 0.5 (s)."""


def started(**values: float) -> str:
    return "".join(f"start.{name} = {value}\n" for name, value in values.items())


def of_fmpy(
    path: Path, rate: int, duration: float, begin: float = 0.0, **start: float
) -> np.ndarray:
    return simulate_fmu(
        path, validate=False, fmi_type="ModelExchange", start_time=begin,
        stop_time=begin + duration, output_interval=1 / rate, start_values=start,
        record_events=False,
    )  # fmt: skip


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("completes", [False, True])
@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_state_events_are_located(tmp_path, fmi, completes, isolate):
    equations_fmu(tmp_path, fmi, completes)
    text = f"{ONE}{isolate}tolerance = 1e-8\n"
    found = ran(tmp_path, text, "duration=1.1").haptics
    t = found["time"]
    np.testing.assert_array_equal(found["one.falls"], falls := np.floor(t / PERIOD))
    np.testing.assert_allclose(found["one.x"], np.exp(-K * (t - falls * PERIOD)), rtol=0, atol=1e-6)
    assert found["one.entered"][-1] == falls[-1]
    assert (found["one.completed"][-1] >= len(t) - 1 + falls[-1]) == completes


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_it_has_the_bits_of_fmpy(tmp_path, fmi):
    """With an FMU that is not told of completed steps, at times that are exact in binary."""
    path = equations_fmu(tmp_path, fmi)
    start = {"k": 3.0, "every": 0.0}
    found = ran(tmp_path, ONE + started(**start), "duration=2.0").haptics
    theirs = of_fmpy(path, 64, 2.0, **start)
    assert found["one.falls"][-1] == 8
    for name in ("x", "falls", "entered"):
        np.testing.assert_array_equal(found[f"one.{name}"], theirs[name])


@pytest.mark.parametrize("k", [1.0, 1e6])
def test_stiff_equations_and_inputs_that_change(tmp_path, k):
    """u is constant over each step, so that x is known in closed form."""
    equations_fmu(tmp_path)
    python_fmu(tmp_path, "Gives", "self.y = (self.steps % 7) / 4")
    text = ONE + "tolerance = 1e-9\n" + started(k=k, level=-9.0) + fmu_table("gives", "Gives")
    found = ran(tmp_path, text + wire_table("gives.y", "one.u"), "coupling=jacobi").haptics
    x, u = [1.0], found["gives.y"]
    for held in u[:-1]:
        x.append(held + (x[-1] - held) * np.exp(-k / 64))
    np.testing.assert_allclose(found["one.x"], x, rtol=0, atol=1e-7)
    assert np.ptp(u) > 1
    assert found["one.entered"][-1] == np.count_nonzero(np.diff(u[:-1])) + 1  # a jump is an event


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_time_events_are_at_their_times_and_nothing_is_evaluated_beyond(tmp_path, fmi):
    """0.1 added up ten times is less than 1: that event belongs to the communication point 1."""
    equations_fmu(tmp_path, fmi)
    found = ran(tmp_path, ONE + started(every=0.1, level=-9.0), "duration=1.0", "haptics.rate=10")
    table = found.haptics
    np.testing.assert_array_equal(table["one.alarms"], np.arange(11))
    assert table["one.entered"][-1] == 10
    assert table["one.beyond"].max() == 0
    inside = ran(tmp_path, ONE + started(every=0.07), "duration=1.0", "haptics.rate=10").haptics
    np.testing.assert_array_equal(inside["one.alarms"], np.floor(inside["time"] / 0.07 + 1e-9))


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("begin", [2.0, 2.25])
def test_events_before_the_start_are_made_up_for_as_by_fmpy(tmp_path, fmi, begin):
    """It tells its next event, 0.5 s, at the start; FMPy's first row is before that event."""
    path = equations_fmu(tmp_path, fmi)
    start = {"every": 0.5, "level": -9.0}
    at = f"start_time={begin}", "duration=1.0"
    found = ran(tmp_path, ONE + started(**start), *at).haptics
    np.testing.assert_array_equal(found["one.alarms"], np.floor(found["time"] / 0.5))
    np.testing.assert_allclose(found["one.x"], np.exp(-K * (found["time"] - begin)), atol=1e-4)
    theirs = of_fmpy(path, 64, 1.0, begin, **start)
    for name in ("alarms", "x"):
        regular = np.isin(theirs["time"], found["time"])  # it has rows in the past, too
        last = {t: v for t, v in zip(theirs["time"][regular], theirs[name][regular], strict=True)}
        np.testing.assert_allclose(found[f"one.{name}"][1:], [*last.values()][1:], atol=1e-4)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_discrete_inputs_and_parameters_are_set_in_event_mode(tmp_path, fmi):
    """The FMU returns an error for them in continuous-time mode."""
    equations_fmu(tmp_path, fmi)
    python_fmu(tmp_path, "Counts", "self.y = self.steps // 8")
    text = ONE + started(level=-9.0) + "tolerance = 1e-9\n" + fmu_table("counts", "Counts")
    text += wire_table("counts.y", "one.w")
    text += '[[at]]\ntime = 0.25\nset = { "one.k" = 8.0 }\n'
    found = ran(tmp_path, text, "coupling=jacobi").haptics
    given = np.floor((np.arange(len(found["time"])) - 1) / 8)
    np.testing.assert_array_equal(found["one.seen"][2:], given[2:])
    t = found["time"]
    expected = np.exp(-2 * np.minimum(t, 0.25) - 8 * np.maximum(t - 0.25, 0))
    np.testing.assert_allclose(found["one.x"], expected, rtol=0, atol=1e-7)


def test_step_events_and_a_request_to_end(tmp_path):
    equations_fmu(tmp_path, completes=True)
    found = ran(tmp_path, ONE + started(mode=5.0, level=-9.0)).haptics
    np.testing.assert_array_equal(found["one.entered"], found["time"] > 0.1)
    experiment, _ = run(tmp_path, ONE + started(mode=4.0))
    outcome = experiment.outcome
    assert (outcome.fault, outcome.reason) == (None, "terminated")
    assert outcome.end_time == pytest.approx(0.1, abs=1 / 64)


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        (1.0, r"CVODE cannot integrate it: .* \(the derivative of x is nan\); another `tolerance`"),
        (2.0, r"CVODE cannot .* \(fmi2GetDerivatives discards the states that it tries\)"),
        (3.0, "one: fmi2GetDerivatives returned error"),
    ],
)
def test_what_cannot_be_integrated_is_a_fault_with_all_rows_before_it(tmp_path, mode, message):
    equations_fmu(tmp_path)
    experiment, results = run(tmp_path, ONE + started(mode=mode, level=-9.0))
    found = str(experiment.outcome.fault)
    assert re.search(message, found), found
    assert "at t = 0.09375 s" in found
    assert results.haptics["time"][-1] == 0.09375


def test_one_that_chatters_is_a_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(event_mode, "MOST_PARTS", 50)
    equations_fmu(tmp_path)
    experiment, _ = run(tmp_path, ONE + started(top=0.5 + 1e-6), "duration=1.0")
    found = str(experiment.outcome.fault)
    assert "one: it has 50 events within one step: it switches on and off all the time" in found


def test_a_restored_state_goes_on_as_before(tmp_path):
    description = describe(equations_fmu(tmp_path))
    outputs = np.zeros(len(description.outputs))
    with in_process(description)("one", description, outputs) as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.exit_initialization()
        instance.step(0.0, 0.25, 0.25)
        instance.save()
        reached = []
        for _ in range(2):
            instance.rollback()
            for k in range(2, 5):
                instance.step((k - 1) / 4, k / 4, 1 / 4)
            instance.get()
            reached.append(outputs[0])
    assert reached[0] == reached[1] == pytest.approx(np.exp(-K * (1 - 2 * PERIOD)), abs=1e-3)


def test_run_json_counts_what_the_solver_did(tmp_path):
    equations_fmu(tmp_path)
    experiment, _ = run(tmp_path, ONE, "duration=1.0")
    calls = experiment.outcome.details.calls["one"]
    assert calls["events"] == 2
    assert 0 < calls["solver_steps"] < calls["evaluations"]


def test_two_with_a_solver_each_beside_one_for_co_simulation_in_both_kinds_of_coupling(tmp_path):
    """a' = -2 (a - b), b' = -2 (b - a): the difference falls with 4/s, the sum stays."""
    equations_fmu(tmp_path)
    python_fmu(tmp_path, "Counts", "self.y = time + size")
    text = "".join(
        fmu_table(n, "equations", "tolerance = 1e-9\n" + started(level=-9.0, x=x))
        for n, x in (("a", 1.0), ("b", 0.0))
    )
    text += fmu_table("counts", "Counts") + wire_table("a.x", "b.u") + wire_table("b.x", "a.u")
    apart = {}
    for coupling, rate in (("jacobi", 64), ("iterated", 64), ("iterated", 128)):
        options = f"coupling={coupling}", f"haptics.rate={rate}"
        found = ran(tmp_path, text, *options).haptics
        difference = found["a.x"] - found["b.x"]
        apart[coupling, rate] = np.abs(difference - np.exp(-4 * found["time"])).max()
    assert apart["iterated", 64] < apart["jacobi", 64] < 0.1
    assert apart["iterated", 128] < 0.6 * apart["iterated", 64]


def test_one_takes_the_place_of_a_block(tmp_path):
    path = equations_fmu(tmp_path)
    names = {"F_motor": ["x", "falls", "alarms"]}
    swap = {"replaces": "controller", "path": str(path), "map": names, "start": {"level": -9.0}}
    found = hl.run(
        "closed-loop-ideal", {"duration": 0.1, "graphics.rate": 40, "fmu": [swap]}, figures=False
    )
    np.testing.assert_allclose(
        found["controller.F_motor[1]"],
        np.exp(-K * (found.haptics["time"] + 1 / 512)),
        rtol=0,
        atol=1e-4,
    )
    assert "CVODE" in found.run["solvers"]["controller"]


def test_an_ssp_says_the_interface(tmp_path):
    equations_fmu(tmp_path)
    path = scene(tmp_path, ONE)
    bundle = hl.export(path, out=tmp_path / "whole.ssp")
    with zipfile.ZipFile(bundle) as archive:
        assert b'implementation="ModelExchange"' in archive.read("SystemStructure.ssd")
    again, before = hl.run(bundle, figures=False), ran(tmp_path, ONE)
    np.testing.assert_array_equal(again["one.x"], before.haptics["one.x"])


def test_info_names_the_solver_and_another_interface_is_refused(tmp_path, capsys):
    path = equations_fmu(tmp_path)
    assert status("info", str(scene(tmp_path, ONE))) == 0
    told = "integrated by CVODE, relative tolerance 1e-05, states: 1, event indicators: 1"
    assert told in " ".join(capsys.readouterr().out.split())
    with pytest.raises(InputFault, match="model-exchange only, not for co-simulation: leave"):
        describe(path, interface="co-simulation")
    with pytest.raises(InputFault, match="by model exchange, and a program has no solver"):
        read_foreign(describe(path))
