"""The blocks of the shipped experiment meet the contract; the same scene gives the same bytes."""

from __future__ import annotations

import fmpy
import pytest

from hapticlink.fmus.check import check_fmu
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system import fmu_files
from hapticlink.orchestrator.system.timeline import timeline

OPTIONS = ("sensing=encoders", "controller.bias=full", "mechanism.directions=true")
NAMES = ("hand", "controller", "haptic_device", "virtual_mechanism", "virtual_environment")


def built(folder):
    scene = open_scene.load("closed-loop", OPTIONS)
    folder.mkdir()
    return fmu_files.fmu_files(scene, blocks(scene), timeline(scene), folder)


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """The scene's FMUs, built twice without a cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HAPTICLINK_CACHE", "off")
        folder = tmp_path_factory.mktemp("fmus")
        yield built(folder / "a"), built(folder / "b")


@pytest.mark.parametrize("name", NAMES)
def test_contract(twice, name):
    assert check_fmu(twice[0][name]) == []


@pytest.mark.parametrize("name", NAMES)
def test_same_scene_same_bytes(twice, name):
    first, second = (files[name] for files in twice)
    assert first != second
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_plain_python_gives_the_bits_of_casadi(twice, name, monkeypatch):
    def simulate():
        return fmpy.simulate_fmu(str(twice[0][name]), stop_time=0.05, output_interval=1 / 512)

    by_casadi = simulate()
    monkeypatch.setenv("HAPTICLINK_PURE_PYTHON", "1")
    assert simulate().tobytes() == by_casadi.tobytes()
