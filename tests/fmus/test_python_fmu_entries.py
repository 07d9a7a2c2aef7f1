"""What a built FMU does, through FMPy."""

import ctypes
import gc
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException

from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.component import Block, Variable
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.fmus.build_fmu import build
from hapticlink.fmus.check import check_fmu, session
from tests.fmus import sample_components
from tests.fmus.named_fmu import Named
from tests.mechanisms import five_bar

OK, DISCARD, FATAL = 0, 2, 4


@pytest.mark.parametrize("name", [c.name for c in sample_components.EVERY])
def test_contract_on_plain_python(fmus, name, monkeypatch):
    made = fmus[name]
    monkeypatch.setenv("HAPTICLINK_PURE_PYTHON", "1")
    assert check_fmu(made) == []


def test_an_error_leaves_instance_and_process_whole(opened):
    """pythonfmu drops one reference too many after an exception; the slave makes up for it."""
    at = opened("spring")
    fmu = Named(at).start()
    for _ in range(20):
        for call in (
            lambda: fmu.slave.getReal([99]),
            lambda: fmu.slave.getReal([2**32 - 1]),  # -1 to pythonfmu, the last of an array
            lambda: fmu.slave.setReal([0, 2**31], [1.0, 1.0]),
            lambda: fmu.slave.getInteger([0]),
        ):
            with pytest.raises(FMICallException) as raised:
                call()
            assert raised.value.status == FATAL
    assert fmu.get("a") == [-4.0]
    at.free(fmu.slave)
    assert living_slaves() == []


def test_true_is_ok_and_false_is_discard(opened):
    """pythonfmu 0.7 maps a do_step's bool so; its Fmi2Status values it maps wrongly."""
    fmu = Named(opened("fragile")).start()
    arguments = (fmu.slave.component, 0.0, 0.1, 1)
    assert fmu.slave._functions["fmi2DoStep"](*arguments) == OK
    fmu.set(u=100.0)
    assert fmu.slave._functions["fmi2DoStep"](*arguments) == DISCARD


def test_an_exception_inside_a_step_is_a_discard(opened):
    at = opened("spring")
    fmu = Named(at).start()
    slave = living_slaves()[-1]
    slave._evaluate = [None]
    with pytest.raises(FMICallException) as raised:
        fmu.step(0.0, 0.1)
    assert raised.value.status == DISCARD
    assert "'NoneType' object is not callable" in " ".join(at.messages)


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
    assert importable == {"pythonfmu", module, f"{module}_slave"}
    assert module.startswith("hapticlink_")


def test_nothing_is_left_behind(fmus, monkeypatch, tmp_path):
    made = fmus["spring"]
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with session(made) as at:
        Named(at).start().step(0.0, 0.1)
        assert Path(at.folder).is_relative_to(tmp_path)
        assert living_slaves()
    assert check_fmu(made) == []
    assert list(tmp_path.iterdir()) == []
    assert living_slaves() == []


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_an_instance_leaves_less_than_2_kb(opened):
    """pythonfmu itself leaves a list. FMPy's own objects are left out: fmi2Instantiate directly."""
    at = opened("spring")
    kept = at.instance()
    guid, uri = at.description.guid.encode(), Path(at.folder, "resources").as_uri().encode()
    instantiate, free = kept.dll.fmi2Instantiate, kept.dll.fmi2FreeInstance
    instantiate.restype, free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]

    def lives(count: int) -> None:
        for _ in range(count):
            one = instantiate(b"one", 1, guid, uri, ctypes.byref(kept.callbacks), 0, 0)
            assert one
            free(one)
        gc.collect()

    def classes() -> int:
        own = type(living_slaves()[0])  # other FMUs of the process have classes of that name
        return sum(
            isinstance(o, type) and (o.__name__, o.__module__) == (own.__name__, own.__module__)
            for o in gc.get_objects()
        )

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    lives(100)
    before, objects = resident(), len(gc.get_objects())
    lives(1000)
    assert classes() == 1
    assert len(gc.get_objects()) - objects <= 1000 * 1.1
    assert resident() - before < 1000 * 2000


def living_slaves() -> list:
    gc.collect()
    return [o for o in gc.get_objects() if type(o).__name__ == "HapticlinkSlave"]


def test_a_damaged_fmu_is_found_out(fmus, tmp_path):
    """The contract's own check: a slave that forgets its state on restore is caught."""
    with session(fmus["spring"]) as at:
        folder = Path(at.folder) / "resources"
        module = (folder / "slavemodule.txt").read_text().strip()
        text = (folder / f"{module}_slave.py").read_text()
        kept = "part[:] = part if part is self._state else array.array"
        broken = text.replace("part[:] = array.array", kept)
        assert broken != text
        (folder / f"{module}_broken_slave.py").write_text(broken)
        entry = (folder / f"{module}.py").read_text().replace(module, f"{module}_broken")
        (folder / f"{module}_broken.py").write_text(entry)
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
