"""A scene as one FMU of FMI 3.0: the bits of the run, arrays, its life, and how it is rebuilt."""

from __future__ import annotations

import math
import re
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from lxml import etree

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from tests.programs.built import needs_compiler, program
from tests.programs.comparison import Outputs, differing, run

pytestmark = needs_compiler
SECOND = "duration=1"
DIRECT = (SECOND, "graphics.rate=30", "hold=passive")
CASES = [("closed-loop", (SECOND,)), ("closed-loop-direct", DIRECT), ("five-bar", (SECOND,))]
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


class Opened:
    """An FMU and its instances. sizes, references: of its variables, by name."""

    def __init__(self, path: Path) -> None:
        self.description = fmpy.read_model_description(str(path), validate=False)
        self.folder = fmpy.extract(str(path))
        self.messages: list[str] = []
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.references = {name: v.valueReference for name, v in self.variables.items()}
        self.sizes = {name: math.prod(v.shape or ()) for name, v in self.variables.items()}
        self.slaves: list[FMU3Slave] = []

    def instance(self, event_mode: bool = False, token: str | None = None) -> FMU3Slave:
        slave = FMU3Slave(
            guid=token or self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        slave.instantiate(
            eventModeUsed=event_mode,
            logMessage=lambda _, __, ___, message: self.messages.append(message.decode()),
        )
        self.slaves.append(slave)
        return slave

    def get(self, slave: FMU3Slave, names: list[str]) -> list[float]:
        """The entries of variables, row by row."""
        count = sum(self.sizes[name] for name in names)
        return slave.getFloat64([self.references[name] for name in names], count)

    def scalars(self, name: str) -> list[str]:
        """As FMI 2.0 calls them."""
        shape = self.variables[name].shape or ()
        at = (",".join(str(i + 1) for i in place) for place in np.ndindex(*shape))
        return [f"{name}[{where}]" for where in at] if shape else [name]

    def outputs(self) -> list[str]:
        return [name for name, v in self.variables.items() if v.causality == "output"]


@contextmanager
def opened(path: Path) -> Iterator[Opened]:
    found = Opened(path)
    try:
        yield found
    finally:
        for slave in found.slaves:
            slave.freeInstance()
        shutil.rmtree(found.folder)


def initialize(slave: FMU3Slave) -> FMU3Slave:
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    return slave


@pytest.mark.parametrize(("scene", "options"), CASES)
def test_it_has_the_bits_of_the_run(scene: str, options: tuple[str, ...], tmp_path: Path) -> None:
    experiment = run(scene, options, tmp_path)
    timeline = experiment.system.timeline
    step = 16 * timeline.clocks[0].longest
    with opened(program(scene, options, fmi=3)) as fmu:
        slave, names = initialize(fmu.instance()), fmu.outputs()
        ticks, values = [0], [fmu.get(slave, names)]
        while ticks[-1] + step <= timeline.end:
            slave.doStep(timeline.seconds(ticks[-1]), timeline.seconds(step))
            ticks.append(ticks[-1] + step)
            values.append(fmu.get(slave, names))
        assert fmu.get(slave, ["time"]) == [timeline.seconds(ticks[-1])]
        sampled = {name for name in names if fmu.variables[name].variability == "discrete"}
        discrete = {scalar for name in sampled for scalar in fmu.scalars(name)}
        scalars = [scalar for name in names for scalar in fmu.scalars(name)]
    found = Outputs(scalars, np.array(ticks), np.array(values), discrete, {})
    assert [*differing(found, experiment)] == []


def test_fmpy_simulates_it_as_that_of_fmi2() -> None:
    made = {fmi: program("closed-loop", (SECOND,), fmi=fmi) for fmi in (2, 3)}
    two, three = (
        simulate_fmu(str(path), stop_time=1.0, output_interval=1 / 512) for path in made.values()
    )
    assert len(three) == 513
    with opened(made[3]) as fmu:
        for name in fmu.outputs():
            expected = np.column_stack([two[scalar] for scalar in fmu.scalars(name)])
            np.testing.assert_array_equal(three[name].reshape(len(three), -1), expected)


def test_vectors_and_matrices_are_arrays() -> None:
    """Whole ones with one unit, or their units in the description; a part of one is scalars."""
    with opened(program("closed-loop", (SECOND,), "hand", fmi=3)) as fmu:
        inverse = fmu.variables["virtual_environment.Lambda_inv"]
        assert inverse.shape == (3, 3)
        assert inverse.unit is None
        assert "(1/kg, 1/kg, 1/(kg.m), " in inverse.description
        force = fmu.variables["hand.F"]
        assert (force.causality, force.start, force.shape) == ("input", "-0.5 0.0 -0.0025", (3,))
        motor, velocity = fmu.variables["haptic_device.x"], fmu.variables["haptic_device.v"]
        assert velocity.derivative is motor
        gain = fmu.variables["controller.k_j"]
        assert (gain.unit, gain.causality, gain.variability) == ("1/s2", "parameter", "tunable")
        assert fmu.variables["haptic_device.base_x"].variability == "fixed"
    options = (SECOND, 'record.signals=["virtual_mechanism.x[1]", "virtual_mechanism.v"]')
    with opened(program("closed-loop", options, fmi=3)) as fmu:
        assert fmu.outputs() == ["virtual_mechanism.x[1]", "virtual_mechanism.v"]


def test_a_state_is_saved_restored_and_restored_elsewhere() -> None:
    with opened(program("closed-loop", (SECOND,), "hand", fmi=3)) as fmu:
        one, other = initialize(fmu.instance()), initialize(fmu.instance())
        force, names = [fmu.references["hand.F"]], fmu.outputs()

        def driven(slave: FMU3Slave) -> list[float]:
            slave.setFloat64(force, [0.3, -0.2, 0.001])
            slave.doStep(0.2, 0.3)
            return fmu.get(slave, names)

        one.doStep(0.0, 0.2)
        state = one.getFMUState()
        kept = one.serializeFMUState(state)
        there = driven(one)
        one.setFMUState(state)
        assert driven(one) == there
        own = other.deserializeFMUState(kept)
        assert other.serializeFMUState(own) == kept
        other.setFMUState(own)
        assert driven(other) == there
        one.freeFMUState(state)
        other.freeFMUState(own)
        other.reset()
        initialize(other).doStep(0.0, 0.2)
        assert driven(other) == there


def test_wrong_calls_are_errors_that_name_block_and_signal() -> None:
    with opened(program("closed-loop", (SECOND,), "hand", fmi=3)) as fmu:
        slave, at = fmu.instance(), fmu.references
        nothing = (False, False, True, 0.0)

        def fails(call, *arguments) -> str:
            with pytest.raises(FMICallException):
                call(*arguments)
            return fmu.messages[-1]

        assert fails(slave.doStep, 0.0, 0.1).startswith(
            "fmi3DoStep may not be called: the FMU is i"
        )
        message = fails(slave.enterInitializationMode, None, 1.0)
        assert message == "a scene starts at 0 s, not at 1 s"
        initialize(slave)
        message = fails(slave.enterInitializationMode)
        assert message == "fmi3EnterInitializationMode may not be called: the FMU is initialised"
        force = at["hand.F"]
        for reference in (force + 1, 99999):
            assert fails(slave.getFloat64, [reference]) == f"unknown value reference {reference}"
        message = fails(slave.setFloat64, [force], [0.0, 0.0])
        assert message == "fmi3SetFloat64 got 2 values for variables of 3 entries"
        message = fails(slave.setFloat64, [force], [0.0, math.nan, 0.0])
        assert message == "hand.F[2] cannot be nan"
        message = fails(slave.setFloat64, [at["haptic_device.x"]], [0.0] * 3)
        assert message == "haptic_device.x[1] is no input or parameter"
        message = fails(slave.setFloat64, [at["haptic_device.base_x"]], [0.0])
        assert message.startswith("parameter haptic_device.base_x is fixed")
        assert fails(slave.getInt32, [force]).startswith("fmi3GetInt32: this FMU is for co-sim")
        assert fails(slave.enterEventMode).startswith("fmi3EnterEventMode: this FMU is for co-sim")
        assert slave.doStep(0.0, 0.1) == (*nothing[:2], False, 0.1)
        assert "the program stands at 0.1" in fails(slave.doStep, 0.0, 0.1)
        assert "has no end" in fails(slave.doStep, 0.1, math.inf)
        slave.setFloat64([force], [1e300, 0.0, 0.0])
        assert "the run has diverged" in fails(slave.doStep, 0.1, 0.4)
        for arguments in ({"event_mode": True}, {"token": "{other}"}):
            with pytest.raises(Exception, match="Failed to instantiate"):
                fmu.instance(**arguments)
        assert "the guid {other} is not that" in fmu.messages[-1]
        assert "without event mode" in fmu.messages[-2]


def test_a_condition_to_stop_asks_to_terminate(tmp_path: Path) -> None:
    options = ("duration=0.5", "stop_when=virtual_mechanism.v[1] < -0.3")
    experiment = run("pendulum", options, tmp_path)
    with opened(program("pendulum", options, fmi=3)) as fmu:
        slave = initialize(fmu.instance())
        reached = slave.doStep(0.0, 0.5)
        assert reached == (False, True, False, experiment.outcome.end_time)
        names = [column for column in experiment.results.haptics.columns[1:]]
        values = dict(
            zip(
                (scalar for name in fmu.outputs() for scalar in fmu.scalars(name)),
                fmu.get(slave, fmu.outputs()),
                strict=True,
            )
        )
        assert [values[n] for n in names] == experiment.results.haptics.rows[-1, 1:].tolist()


def test_hapticlink_runs_it(tmp_path: Path) -> None:
    """Beside the blocks of the same scene, with the force of their hand: the same rows, of sampled
    blocks one later."""
    path = program("closed-loop", (SECOND,), "hand", fmi=3)
    copy = f'fmu.+={{name="copy", path="{path}"}}'
    wire = 'connection.+={from="hand.F", to="copy.hand.F"}'
    rows = run("closed-loop", (SECOND, copy, wire), tmp_path).results.haptics
    columns = [c for c in rows.columns if f"copy.{c}" in rows.columns]
    assert {c.partition(".")[0] for c in columns} >= {"haptic_device", "virtual_mechanism"}
    for column in columns:
        late = int(column.startswith("controller."))
        rest = len(rows[column]) - late
        np.testing.assert_array_equal(rows[f"copy.{column}"][late:], rows[column][:rest])


def test_terminals_and_description_of_the_build_fit_the_standard() -> None:
    with zipfile.ZipFile(program("closed-loop", (SECOND,), "hand", fmi=3)) as archive:
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
    with pytest.raises(InputFault, match="--fmi 3 compiles: add --set packaging=native"):
        hl.build("pendulum", out=tmp_path, fmi=3)
    with pytest.raises(InputFault, match="--fmi: 4 is not 2 or 3"):
        hl.build("pendulum", out=tmp_path, as_one=True, fmi=4)
