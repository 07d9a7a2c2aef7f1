"""What a built FMU does, through FMPy."""

from __future__ import annotations

import gc
import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
import sample_components
from fmpy.fmi1 import FMICallException
from mechanisms import five_bar
from named_fmu import Named

from hapticlink.components.component import Block, Variable
from hapticlink.components.mechanism import virtual_mechanism
from hapticlink.components.specs import Mechanism
from hapticlink.fmus import build, check_fmu
from hapticlink.fmus.check import session

OK, DISCARD, FATAL = 0, 2, 4


@pytest.mark.parametrize("name", [c.name for c in sample_components.EVERY])
def test_contract(fmus, name):
    assert check_fmu(fmus[name]) == []


@pytest.mark.parametrize("name", [c.name for c in sample_components.EVERY])
def test_contract_on_plain_python(fmus, name, monkeypatch):
    monkeypatch.setenv("HAPTICLINK_PURE_PYTHON", "1")
    assert check_fmu(fmus[name]) == []


def test_continuous_block_follows_the_discrete_closed_form(opened):
    """Semi-implicit Euler of an oscillator: cos(theta) = 1 - (w h)^2 / 2 exactly.

    x_k = A cos(k theta) + B sin(k theta) with x_0 = 1 and x_1 = 1 - (w h)^2.
    """
    fmu, h, w = Named(opened("spring")).start(), 0.01, 2.0
    theta = math.acos(1 - (w * h) ** 2 / 2)
    b = (1 - (w * h) ** 2 - math.cos(theta)) / math.sin(theta)
    for k in range(1, 200):
        fmu.step((k - 1) * h, h)
        expected = math.cos(k * theta) + b * math.sin(k * theta)
        assert fmu.get("x[1]")[0] == pytest.approx(expected, abs=1e-12)
    assert fmu.get("time")[0] == pytest.approx(199 * h)


def test_substeps_divide_the_step(tmp_path, opened):
    whole = Named(opened("spring")).start()
    for k in range(4):
        whole.step(k * 0.25, 0.25)
    with session(build(sample_components.spring("divided", substeps=4), tmp_path)) as at:
        divided = Named(at).start()
        divided.step(0.0, 1.0)
        assert divided.get("x[1]", "x[2]") == whole.get("x[1]", "x[2]")


def test_initialisation_follows_inputs_and_parameters(opened):
    fmu = Named(opened("spring"))
    fmu.slave.setupExperiment(startTime=3.0)
    fmu.slave.enterInitializationMode()
    assert fmu.get("x[1]", "a", "time") == [1.0, -4.0, 3.0]
    fmu.set(F=4.0)
    assert fmu.get("x[1]", "a") == [1.5, -4.0]
    fmu.set(k=16.0, m=1.0)
    assert fmu.get("x[1]", "a") == [1.25, -16.0]
    fmu.slave.exitInitializationMode()
    fmu.set(F=0.0)  # no longer moves the start, but a direct feed-through shows
    assert fmu.get("x[1]", "a") == [1.25, -20.0]


def test_fixed_parameters_hold_after_initialisation_tunable_ones_do_not(opened):
    at = opened("spring")
    fmu = Named(at).start()
    fmu.set(k=4.0)
    assert fmu.get("a") == [-2.0]
    with pytest.raises(FMICallException) as raised:
        fmu.set(m=1.0)
    assert raised.value.status == FATAL  # pythonfmu has no other answer to an exception
    assert "parameter m is fixed" in " ".join(at.messages)
    assert fmu.get("m", "a") == [2.0, -2.0]


def test_outputs_cannot_be_set(opened):
    at = opened("spring")
    with pytest.raises(FMICallException):
        Named(at).start().set(a=1.0)
    assert "a is an output" in " ".join(at.messages)


def test_an_error_leaves_instance_and_process_whole(opened):
    """pythonfmu drops one reference too many after an exception; the slave makes up for it."""
    at = opened("spring")
    fmu = Named(at).start()
    for _ in range(20):
        for call in (lambda: fmu.slave.getReal([99]), lambda: fmu.slave.getInteger([0])):
            with pytest.raises(FMICallException) as raised:
                call()
            assert raised.value.status == FATAL
    assert fmu.get("a") == [-4.0]
    at.free(fmu.slave)
    assert living_slaves() == []


def test_sampled_block_holds_the_output_of_its_start(opened):
    fmu = Named(opened("controller"))
    fmu.set(**{"e[1]": 1.0, "e[2]": 10.0})
    fmu.start(time=5.0)
    at_start = [1 * 1 + 2 * 10 + 5.0, 3 * 1 + 4 * 10 + 5.0]  # G row by row
    assert fmu.get("y[1]", "y[2]") == at_start
    fmu.set(**{"e[1]": 7.0})
    assert fmu.get("y[1]", "y[2]") == at_start
    fmu.set(**{"e[1]": 2.0, "G[1,2]": 0.0})
    fmu.step(5.0, 0.5)  # y of t = 5 with the inputs of t = 5, before the sum moves
    assert fmu.get("y[1]", "y[2]", "total[1]") == [2.0 + 5.0, 46.0 + 5.0, 0.0]
    fmu.step(5.5, 0.5)
    assert fmu.get("y[1]", "total[1]", "total[2]") == [2.0 + 2.0 + 5.5, 2.0, 10.0]


def test_values_in_any_order(opened):
    fmu = Named(opened("controller"))
    fmu.set(**{"G[2,2]": 9.0, "e[2]": 5.0, "G[1,1]": 8.0})
    assert fmu.get("G[1,1]", "e[2]", "G[2,2]", "G[1,2]", "e[2]") == [8.0, 5.0, 9.0, 2.0, 5.0]


def test_true_is_ok_and_false_is_discard(opened):
    """pythonfmu 0.7 maps a do_step's bool so; its Fmi2Status values it maps wrongly."""
    fmu = Named(opened("fragile")).start()
    arguments = (fmu.slave.component, 0.0, 0.1, 1)
    assert fmu.slave._functions["fmi2DoStep"](*arguments) == OK
    fmu.set(u=100.0)
    assert fmu.slave._functions["fmi2DoStep"](*arguments) == DISCARD


def test_a_step_to_nan_keeps_the_last_good_state_and_names_it(opened):
    at = opened("fragile")
    fmu = Named(at).start()
    fmu.step(0.0, 0.1)
    before = fmu.get("count", "y[1]", "y[2]")
    fmu.set(u=100.0)
    with pytest.raises(FMICallException) as raised:
        fmu.step(0.1, 0.1)
    assert raised.value.status == DISCARD
    assert fmu.get("count", "y[1]", "y[2]") == before
    message = " ".join(at.messages)
    assert "r[2] became nan at t = 0.2" in message
    assert "smaller step" in message
    fmu.set(u=0.0)
    fmu.step(0.1, 0.1)  # and it goes on from there
    assert fmu.get("count", "y[2]") == [2.0, math.sqrt(before[2])]


def test_the_message_names_an_input_that_is_not_finite(opened):
    at = opened("spring")
    fmu = Named(at).start()
    fmu.set(F=math.inf)
    with pytest.raises(FMICallException):
        fmu.step(0.0, 0.1)
    assert "F = inf" in " ".join(at.messages)


def test_a_start_that_is_not_finite_ends_initialisation(opened):
    at = opened("spring")
    fmu = Named(at)
    fmu.set(F=math.nan)
    fmu.slave.setupExperiment()
    fmu.slave.enterInitializationMode()
    with pytest.raises(FMICallException):
        fmu.slave.exitInitializationMode()
    assert "state[1] became nan" in " ".join(at.messages)


def test_an_exception_inside_a_step_is_a_discard(opened):
    at = opened("spring")
    fmu = Named(at).start()
    slave = living_slaves()[-1]
    slave._evaluate_step = None
    with pytest.raises(FMICallException) as raised:
        fmu.step(0.0, 0.1)
    assert raised.value.status == DISCARD
    assert "'NoneType' object is not callable" in " ".join(at.messages)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.0, 5e-324])
def test_a_saved_state_holds_every_double(opened, value):
    fmu = Named(opened("controller")).start()
    fmu.set(**{"e[1]": value})
    state = fmu.slave.getFMUState()
    fmu.set(**{"e[1]": 1.0})
    saved = fmu.slave.serializeFMUstate(state)
    fmu.slave.freeFMUState(state)
    state = fmu.slave.deSerializeFMUstate(saved)
    fmu.slave.setFMUState(state)
    fmu.slave.freeFMUState(state)
    (back,) = fmu.get("e[1]")
    assert np.float64(back).tobytes() == np.float64(value).tobytes()


def test_a_state_saved_in_initialisation_mode_is_that_of_initialisation_mode(opened):
    fmu = Named(opened("spring"))
    fmu.slave.setupExperiment()
    fmu.slave.enterInitializationMode()
    state = fmu.slave.getFMUState()
    fmu.slave.exitInitializationMode()
    fmu.step(0.0, 0.1)
    fmu.slave.setFMUState(state)
    fmu.slave.freeFMUState(state)
    fmu.set(m=4.0, F=8.0)
    assert fmu.get("x[1]", "a") == [2.0, -2.0]


def test_a_state_of_another_fmu_is_refused(opened):
    spring, other = Named(opened("spring")).start(), Named(opened("controller")).start()
    state = spring.slave.getFMUState()
    saved = spring.slave.serializeFMUstate(state)
    spring.slave.freeFMUState(state)
    foreign = other.slave.deSerializeFMUstate(saved)
    with pytest.raises(FMICallException):
        other.slave.setFMUState(foreign)
    other.slave.freeFMUState(foreign)


def test_fmus_of_one_process_each_run_their_own_functions(tmp_path):
    """Same name, same shape, other equations: by another module, whose name says so."""
    first = build(sample_components.stateless("gain", 2.0), tmp_path / "a")
    second = build(sample_components.stateless("gain", 3.0), tmp_path / "b")
    with session(first) as one, session(second) as two:
        for at, factor in ((one, 2.0), (two, 3.0), (one, 2.0)):
            fmu = Named(at)
            fmu.set(u=5.0)
            fmu.start()
            fmu.step(0.0, 0.1)
            assert fmu.get("y") == [5.0 * factor]


def test_plain_python_gives_the_bits_of_casadi(fmus, monkeypatch):
    def simulate():
        return fmpy.simulate_fmu(str(fmus["spring"]), stop_time=0.5, output_interval=1 / 512)

    by_casadi = simulate()
    monkeypatch.setenv("HAPTICLINK_PURE_PYTHON", "1")
    assert simulate().tobytes() == by_casadi.tobytes()


def test_runs_without_casadi_and_without_this_package(fmus):
    """In a process where neither can be imported."""
    code = f"""
import sys
sys.modules["casadi"] = sys.modules["hapticlink"] = None
import fmpy
result = fmpy.simulate_fmu({str(fmus["spring"])!r}, stop_time=0.5, output_interval=0.01)
print(repr(float(result["x[1]"][-1])))
"""
    here = fmpy.simulate_fmu(str(fmus["spring"]), stop_time=0.5, output_interval=0.01)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout.split()[-1]) == here["x[1]"][-1]


def test_a_file_that_casadi_cannot_read_falls_back_and_says_so(tmp_path):
    """As a file of a newer CasADi in an older one."""
    component = sample_components.stateless("unread", 4.0)
    with session(build(component, tmp_path)) as at:
        (Path(at.folder) / "resources" / "functions.casadi.json").write_text('{"output": "x"}')
        fmu = Named(at)
        fmu.set(u=2.0)
        fmu.start()
        assert fmu.get("y") == [8.0]
        assert any("plain Python" in message for message in at.messages)


def test_only_pythonfmu_and_the_slave_can_be_imported_from_resources(opened):
    resources = Path(opened("spring").folder) / "resources"
    importable = {p.stem for p in resources.glob("*.py")} | {
        p.name for p in resources.iterdir() if p.is_dir()
    }
    module = (resources / "slavemodule.txt").read_text().strip()
    assert importable == {"pythonfmu", module}
    assert module.startswith("hapticlink_")


def test_nothing_is_left_behind(fmus, monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with session(fmus["spring"]) as at:
        Named(at).start().step(0.0, 0.1)
        assert Path(at.folder).is_relative_to(tmp_path)
        assert living_slaves()
    assert check_fmu(fmus["spring"]) == []
    assert list(tmp_path.iterdir()) == []
    assert living_slaves() == []


def living_slaves() -> list:
    gc.collect()
    return [o for o in gc.get_objects() if type(o).__name__ == "HapticlinkSlave"]


def test_a_damaged_fmu_is_found_out(fmus, tmp_path):
    """The contract's own check: a slave that forgets its state on restore is caught."""
    with session(fmus["spring"]) as at:
        folder = Path(at.folder) / "resources"
        module = (folder / "slavemodule.txt").read_text().strip()
        text = (folder / f"{module}.py").read_text()
        broken = text.replace("part[:] = array.array", "array.array")
        assert broken != text
        (folder / f"{module}.py").unlink()
        (folder / f"{module}_broken.py").write_text(broken)
        (folder / "slavemodule.txt").write_text(f"{module}_broken\n")
        archive = shutil.make_archive(str(tmp_path / "spring"), "zip", at.folder)
    findings = check_fmu(Path(archive).rename(tmp_path / "spring.fmu"))
    assert len(findings) == 1
    assert findings[0].startswith("save_and_restore: entry 0 of the run differs")


def test_an_fmu_without_sense_in_its_start_values_is_found_out(tmp_path):
    b = Block(inputs=[Variable("mass")], outputs=[Variable("ratio"), Variable("fine")])
    mass = b.u["mass"]
    component = b.component(
        "ratio", "", "sampled", initial={}, step={}, output={"ratio": 1 / mass, "fine": mass}
    )
    findings = check_fmu(build(component, tmp_path))
    assert findings == ["alone: not finite from its own start values: ratio"]


def test_process_ends_whole_after_a_simulation(tmp_path):
    """As a user types it, on the FMU whose teardown aborted the process."""
    mechanism = virtual_mechanism(five_bar(), Mechanism(), step_s=1 / 512)
    path, results = build(mechanism, tmp_path), tmp_path / "out.csv"
    command = [sys.executable, "-m", "fmpy.cli", "simulate", str(path), "--stop-time", "0.1"]
    done = subprocess.run(
        [*command, "--output-file", str(results)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert results.read_text().count("\n") > 50
