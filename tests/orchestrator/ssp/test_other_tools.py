"""An exported SSP in other masters, compared with the project's own run."""

import ctypes
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description

import hapticlink as hl

STEPS = 128
OPTIONS = {"coupling": "jacobi", "duration": STEPS / 512}
SCENES = (
    "closed-loop-ideal",
    "closed-loop-direct",
    "two-users",
    "two-hands",
    "enclosure",
    "closed-loop-bricard",
)
SAMPLED = ("controller", "hand")
AT_ONCE = ("qdd", "lambda", "F_env")
"""Outputs that depend on inputs at once: hapticlink reads them before it sets these, Ecos after."""


def exported(scene: str, folder: Path, options: Mapping[str, object]) -> Path:
    return hl.export(scene, options, out=folder / f"{scene}.ssp")


def row_after(step: int, fmu: str) -> int:
    """The row of a run with what another master gives after a step, the first one being 0: of
    plants after it, of sampled blocks at its begin."""
    return step if fmu.partition("_left")[0] in SAMPLED else step + 1


@pytest.mark.parametrize("scene", SCENES)
def test_libcosim_runs_two_rates_to_the_bytes_of_our_jacobi(scene, tmp_path):
    """libcosim's fixed-step algorithm is Jacobi with inputs that stand between samples: all
    outputs at the haptic rate."""
    pytest.importorskip("libcosimpy")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    options = {**OPTIONS, "graphics.rate": 32}
    with zipfile.ZipFile(exported(scene, tmp_path, options)) as archive:
        archive.extractall(tmp_path / "ssp")
    ours = hl.run(scene, options, figures=False).haptics
    execution = CosimExecution.from_ssp_file(ssp_path=str(tmp_path / "ssp"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    outputs = {}
    for name in {column.partition(".")[0] for column in ours.columns if "." in column}:
        index = execution.slave_index_from_instance_name(name)
        variables = execution.slave_variables(index)
        known = {f"{name}.{v.name.decode()}": v.reference for v in variables}
        outputs[name] = index, {k: r for k, r in known.items() if k in ours.columns}
    assert sum(len(found) for _, found in outputs.values()) > 30
    for step in range(STEPS):
        assert execution.step()
        for name, (index, found) in outputs.items():
            theirs = observer.last_real_values(index, list(found.values()))
            row = row_after(step, name)
            assert theirs == [ours[column][row] for column in found], (name, step)


@pytest.fixture
def ecos():
    """Its library asks for TBB's, which pip puts where no loader looks."""
    for library in sorted(Path(sys.prefix, "lib").glob("libtbb.so.12")):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    try:
        import ecospy
    except (ImportError, OSError) as error:
        pytest.skip(f"Ecos is not here: {error}")
    return ecospy


@pytest.mark.parametrize(
    ("scene", "parameters"),
    [("closed-loop-ideal", None), *((s, "start") for s in SCENES if s != "closed-loop-direct")],
)
def test_ecos_runs_one_rate_to_the_bytes_of_our_jacobi(scene, parameters, tmp_path, ecos):
    """All outputs but those AT_ONCE, with and without the set of parameters, which Ecos applies
    where it is asked to."""
    options = {**OPTIONS, "graphics.rate": 512} if hl.scene(scene).graphics else OPTIONS
    path = exported(scene, tmp_path, options)
    ours = hl.run(scene, options, figures=False).haptics
    columns = [
        c
        for c in ours.columns
        if "." in c and c.partition("[")[0].rpartition(".")[2] not in AT_ONCE
    ]
    assert len(columns) > 25
    names = [c.replace(".", "::", 1) for c in columns]
    with ecos.EcosSimulation(step_size=1 / 512, ssp_path=str(path)) as simulation:
        simulation.init(parameter_set=parameters)
        for step in range(STEPS):
            simulation.step(1)
            theirs = [simulation.get_real(name) for name in names]
            rows = (row_after(step, c.partition(".")[0]) for c in columns)
            assert theirs == [ours[c][row] for c, row in zip(columns, rows, strict=True)], step


def test_built_fmus_start_where_the_scene_does(tmp_path):
    """The handle is where the mechanism's operational point is, in a tool that knows no scene."""
    files = hl.build("closed-loop-ideal", {"linkage.start.shoulder1": 0.9}, out=tmp_path)
    device = read_model_description(str(files["haptic_device"]))
    starts = [float(v.start) for v in device.modelVariables if v.name.startswith("x_start[")]
    run = hl.run("closed-loop-ideal", {"linkage.start.shoulder1": 0.9, "duration": 0.01})
    np.testing.assert_array_equal(starts, run.haptics["virtual_mechanism.x"][0])
    assert np.abs(starts).min() > 0.01
