"""Blocks of closed-loop-ideal by FMUs that other tools make: docs/foreign-fmus.md has the table."""

import shutil
from pathlib import Path

import fmpy
import pytest
from fmpy.build import build_platform_binary
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration
from fmpy.model_description import CoSimulation, ModelVariable
from fmpy.util import create_zip_archive

import hapticlink as hl
from hapticlink.commands.options import SceneOptions
from hapticlink.orchestrator.base.errors import SceneFault
from tests.little_fmus import python_fmu_of
from tests.orchestrator.results.records import tables_of

NATIVE = {"duration": 0.2, "packaging": "native"}
BLOCKS = ("hand", "controller", "haptic_device", "virtual_mechanism", "virtual_environment")
PULL = """
import numpy
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability

class Pull(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.F = 0.0, numpy.array([-0.5, 0.0, -0.0025])
        self.register_variable(Float64("time", causality=Fmi3Causality.independent,
                                       variability=Fmi3Variability.continuous))
        self.register_variable(Float64("F", causality=Fmi3Causality.output,
                                       dimensions=[Dimension(start="3")]))

    def do_step(self, time, size):
        return True
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The FMU of each block, with its sources in C, and the tables of their run."""
    files = hl.build("closed-loop-ideal", NATIVE, out=tmp_path_factory.mktemp("native"))
    run = hl.run("closed-loop-ideal", NATIVE, out=tmp_path_factory.mktemp("run"), figures=False)
    return files, tables_of(run.folder)


def compiled(file, folder):
    """The FMU with a binary that FMPy makes of its sources; unoptimised, in half the time."""
    unpacked = Path(fmpy.extract(str(file)))
    shutil.rmtree(unpacked / "binaries")
    build_platform_binary(unpacked, configuration="Debug")
    create_zip_archive(str(folder / "compiled.fmu"), str(unpacked))
    return folder / "compiled.fmu"


def contained(file, folder):
    """FMPy's container FMU around the FMU. The value references of its variables are counted from
    the time, which has to come first."""
    whole, part = (fmpy.read_model_description(str(file)) for _ in range(2))
    step = 1 / 30 if file.stem == "virtual_environment" else 1 / 512
    whole.coSimulation = CoSimulation(fixedInternalStepSize=step)
    inner, unpacked = Component(part.modelName, file, part), folder / "unpacked"
    pairs = zip(whole.modelVariables, part.modelVariables, strict=True)
    mappings = {outside: [(inner, inside)] for outside, inside in pairs}
    time = ModelVariable("time", type="Real", causality="independent", variability="continuous")
    whole.modelVariables.insert(0, time)
    unpacked.mkdir()
    made = Configuration(False, whole, [inner], [], mappings)
    create_container_fmu(made, unpacked, folder / "container.fmu")
    return folder / "container.fmu"


def run_with(block, file, folder):
    swap = {"fmu.+": {"replaces": block, "path": str(file)}}
    return hl.run("closed-loop-ideal", NATIVE | swap, out=folder / "run", figures=False)


@pytest.mark.skipif(not shutil.which("cmake"), reason="FMPy needs CMake to compile")
@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("made_by", [compiled, contained])
def test_a_part_made_by_fmpy_changes_no_byte(tmp_path, own, made_by, block):
    run = run_with(block, made_by(own[0][block], tmp_path), tmp_path)
    assert run.run["replaced"] == {block: {"lost": [], "unfed": [], "mapped": {}}}
    assert tables_of(run.folder) == own[1]


def test_a_hand_of_pythonfmu3_changes_no_byte(tmp_path, own):
    pytest.importorskip("pythonfmu3")
    file = python_fmu_of(tmp_path, PULL, "pull", "3")
    assert tables_of(run_with("hand", file, tmp_path).folder) == own[1]


@pytest.mark.parametrize("block", BLOCKS[:3])
def test_mujoco_is_refused_where_it_has_no_such_block(block):
    said = rf"--swap {block}=mujoco: .*give `path`, an FMU with the ports of {block}"
    with pytest.raises(SceneFault, match=said):
        hl.scene("closed-loop-ideal", SceneOptions(swap=[f"{block}=mujoco"]).options)
