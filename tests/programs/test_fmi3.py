"""A scene as one FMU of FMI 3.0: the bits of the run, arrays, its life, and how it is rebuilt."""

import math
import re
import shutil
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from lxml import etree

import hapticlink as hl
from hapticlink.fmus.check import check_fmu, initialize, session
from tests.fmus.named_fmu import Named
from tests.programs.built import needs_compiler, program
from tests.programs.comparison import differing, outputs, run

pytestmark = needs_compiler
SECOND = "duration=1"
DIRECT = (SECOND, "graphics.rate=30", "hold=passive")
CASES = [("closed-loop-ideal", (SECOND,)), ("closed-loop-direct", DIRECT), ("five-bar", (SECOND,))]
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


def variables(path: Path) -> dict[str, Any]:
    """By name, arrays whole."""
    described = fmpy.read_model_description(str(path), validate=False)
    return {v.name: v for v in described.modelVariables}


@pytest.mark.parametrize(("scene", "options"), CASES)
def test_it_has_the_bits_of_the_run(scene: str, options: tuple[str, ...], tmp_path: Path) -> None:
    experiment = run(scene, options, tmp_path)
    step = 16 * experiment.system.timeline.clocks[0].longest
    found = outputs(program(scene, options, fmi=3), experiment, step)
    assert [*differing(found, experiment)] == []


def test_fmpy_simulates_it_as_that_of_fmi2() -> None:
    made = {fmi: program("closed-loop-ideal", (SECOND,), fmi=fmi) for fmi in (2, 3)}
    two, three = (
        simulate_fmu(str(path), stop_time=1.0, output_interval=1 / 512) for path in made.values()
    )
    assert len(three) == 513
    for name, v in variables(made[3]).items():
        if v.causality == "output":
            at = (",".join(str(i + 1) for i in place) for place in np.ndindex(*v.shape or ()))
            scalars = [f"{name}[{where}]" for where in at] if v.shape else [name]
            expected = np.column_stack([two[scalar] for scalar in scalars])
            np.testing.assert_array_equal(three[name].reshape(len(three), -1), expected)


def test_vectors_and_matrices_are_arrays() -> None:
    """Whole ones with one unit, or their units in the description; a part of one is scalars."""
    found = variables(program("closed-loop-ideal", (SECOND,), "hand", fmi=3))
    inverse = found["virtual_environment.Lambda_inv"]
    assert inverse.shape == (3, 3)
    assert inverse.unit is None
    assert "(1/kg, 1/kg, 1/(kg.m), " in inverse.description
    force = found["hand.F"]
    assert (force.causality, force.start, force.shape) == ("input", "-0.5 0.0 -0.0025", (3,))
    assert found["haptic_device.v"].derivative is found["haptic_device.x"]
    gain = found["controller.k_j"]
    assert (gain.unit, gain.causality, gain.variability) == ("1/s2", "parameter", "tunable")
    assert found["haptic_device.crank.mass"].variability == "fixed"
    options = (SECOND, 'record.signals=["virtual_mechanism.x[1]", "virtual_mechanism.v"]')
    found = variables(program("closed-loop-ideal", options, fmi=3))
    recorded = [name for name, v in found.items() if v.causality == "output"]
    assert recorded == ["virtual_mechanism.x[1]", "virtual_mechanism.v"]


def test_it_lives_as_every_fmu_of_this_project() -> None:
    assert check_fmu(program("closed-loop-ideal", (SECOND,), "hand", fmi=3)) == []


def test_wrong_calls_are_errors_that_name_block_and_signal() -> None:
    with session(program("closed-loop-ideal", (SECOND,), "hand", fmi=3)) as fmu:
        slave = fmu.instance()
        at = {v.name: v.valueReference for v in fmu.description.modelVariables}
        nothing = (False, False, True, 0.0)

        def fails(call, *arguments) -> str:
            with pytest.raises(FMICallException):
                call(*arguments)
            return fmu.messages[-1]

        assert fails(slave.doStep, 0.0, 0.1).startswith(
            "fmi3DoStep may not be called: the FMU is i"
        )
        slave.setupExperiment(-1.0)
        message = fails(slave.enterInitializationMode)
        assert message == "a scene starts at 0 s or later, not at -1 s"
        initialize(slave)
        message = fails(slave.enterInitializationMode)
        assert message == "fmi3EnterInitializationMode may not be called: the FMU is initialised"
        force = at["hand.F[1]"]
        for reference in (force + 1, 99999):
            assert fails(slave.getFloat64, [reference]) == f"unknown value reference {reference}"
        message = fails(slave.setFloat64, [force], [0.0, 0.0])
        assert message == "fmi3SetFloat64 got 2 values for variables of 3 entries"
        message = fails(slave.setFloat64, [force], [0.0, math.nan, 0.0])
        assert message == "hand.F[2] cannot be nan"
        message = fails(slave.setFloat64, [at["haptic_device.x[1]"]], [0.0] * 3)
        assert message == "haptic_device.x[1] is no input or parameter"
        message = fails(slave.setFloat64, [at["haptic_device.crank.mass"]], [0.0])
        assert message.startswith("parameter haptic_device.crank.mass is fixed")
        assert fails(slave.getInt32, [force]).startswith("fmi3GetInt32: this FMU is for co-sim")
        assert fails(slave.enterEventMode).startswith("fmi3EnterEventMode: this FMU is for co-sim")
        assert slave.doStep(0.0, 0.1) == (*nothing[:2], False, 0.1)
        assert "the program stands at 0.1" in fails(slave.doStep, 0.0, 0.1)
        assert "has no end" in fails(slave.doStep, 0.1, math.inf)
        slave.setFloat64([force], [1e300, 0.0, 0.0])
        assert "the run has diverged" in fails(slave.doStep, 0.1, 0.4)
        for token, event_mode in ((fmu.description.guid, True), ("{other}", False)):
            refused = fmu.make(
                guid=token,
                unzipDirectory=fmu.folder,
                modelIdentifier=fmu.description.coSimulation.modelIdentifier,
                instanceName="one",
            )
            with pytest.raises(Exception, match="Failed to instantiate"):
                refused.instantiate(eventModeUsed=event_mode, logMessage=fmu._log)
        assert "the guid {other} is not that" in fmu.messages[-1]
        assert "without event mode" in fmu.messages[-2]


def test_a_condition_to_stop_asks_to_terminate(tmp_path: Path) -> None:
    options = ("duration=0.5", "stop_when=virtual_mechanism.v[1] < -0.3")
    experiment = run("pendulum", options, tmp_path)
    path = program("pendulum", options, fmi=3)
    with session(path) as opened:
        fmu = Named(opened).start()
        reached = fmu.slave.doStep(0.0, 0.5)
        assert reached == (False, True, False, experiment.outcome.end_time)
        time = variables(path)["time"].valueReference
        assert fmu.slave.getFloat64([time]) == [experiment.outcome.end_time]
        rows = experiment.results.haptics
        assert fmu.get(*rows.columns[1:]) == rows.rows[-1, 1:].tolist()


def test_hapticlink_runs_it(tmp_path: Path) -> None:
    """Beside the blocks of the same scene, with the force of their hand: the same rows, of sampled
    blocks one later."""
    path = program("closed-loop-ideal", (SECOND,), "hand", fmi=3)
    copy = f'fmu.+={{name="copy", path="{path}"}}'
    wire = 'connection.+={from="hand.F", to="copy.hand.F"}'
    rows = run("closed-loop-ideal", (SECOND, copy, wire), tmp_path).results.haptics
    columns = [c for c in rows.columns if f"copy.{c}" in rows.columns]
    assert {c.partition(".")[0] for c in columns} >= {"haptic_device", "virtual_mechanism"}
    for column in columns:
        late = int(column.startswith("controller."))
        rest = len(rows[column]) - late
        np.testing.assert_array_equal(rows[f"copy.{column}"][late:], rows[column][:rest])


def test_terminals_and_description_of_the_build_fit_the_standard() -> None:
    with zipfile.ZipFile(program("closed-loop-ideal", (SECOND,), "hand", fmi=3)) as archive:
        read = {
            name: etree.parse(BytesIO(archive.read(f"{folder}/{name}.xml")))
            for folder, name in (
                ("terminalsAndIcons", "terminalsAndIcons"),
                ("sources", "buildDescription"),
            )
        }
        files = {Path(name).name for name in archive.namelist() if name.endswith(".c")}
    for name, text in read.items():
        schema = etree.XMLSchema(file=str(SCHEMAS / f"fmi3{name[0].upper()}{name[1:]}.xsd"))
        assert schema.validate(text), schema.error_log
    assert {file.get("name") for file in read["buildDescription"].iter("SourceFile")} == files
    (set_of_files,) = read["buildDescription"].iter("SourceFileSet")
    assert set_of_files.get("compiler") == "clang"  # whose the options are
    members = {
        (terminal.get("name"), member.get("memberName"))
        for terminal in read["terminalsAndIcons"].iter("Terminal")
        for member in terminal
    }
    assert {("hand", "F"), ("haptic_device", "x"), ("controller", "F_motor")} <= members


@pytest.mark.skipif(
    not (shutil.which("cmake") and shutil.which("make")), reason="no cmake, or no make"
)
def test_fmpy_rebuilds_it(tmp_path: Path) -> None:
    """By buildDescription.xml; `built.program` is the one that cc *.c makes."""
    path = program("pendulum", (SECOND,), fmi=3)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "one")
    shutil.rmtree(tmp_path / "one" / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(tmp_path / "one", tmp_path / "build")
    other = Path(shutil.make_archive(str(tmp_path / "other"), "zip", tmp_path / "one"))
    made, expected = (
        simulate_fmu(str(fmu), stop_time=1.0, output_interval=1 / 64) for fmu in (other, path)
    )
    np.testing.assert_array_equal(made, expected)


def test_the_command_makes_it(tmp_path: Path) -> None:
    built = hl.build("pendulum", (SECOND,), out=tmp_path, as_one=True, fmi=3)
    assert fmpy.read_model_description(str(built["pendulum"])).fmiVersion == "3.0"
    found = simulate_fmu(str(built["pendulum"]), stop_time=0.5, output_interval=1 / 64)
    assert len(found) == 33
    with zipfile.ZipFile(built["pendulum"]) as archive:
        page = archive.read("documentation/index.html").decode()
        shown = re.findall(r'<img src="(.+?)" alt="(.+?)">', page)
        pictures = [archive.read(f"documentation/{image}") for image, _ in shown]
    assert [caption.split()[:2] for _, caption in shown] == [
        ["Blocks,", "with"],
        ["The", "mechanism"],
    ]
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
