"""A scene whose blocks are compiled gives the results of the one whose blocks are Python."""

import json
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError

import pytest

from hapticlink.fmus.native import compiler, host_platform
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.timeline import timeline
from tests.orchestrator.results.records import tables_of
from tests.shared_fixtures import sets, status

SHORT = ("duration=0.2", "graphics.rate=60")
NATIVE = (*SHORT, "packaging=native")


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """The folder of a native run of the report's experiment."""
    folder = tmp_path_factory.mktemp("native")
    assert simulate("closed-loop-ideal", folder, NATIVE).outcome.fault is None
    return folder


def test_a_run_gives_the_same_bytes_and_says_what_ran(native, tmp_path):
    assert simulate("closed-loop-ideal", tmp_path, SHORT).outcome.fault is None
    assert (native / "haptics.csv").read_text().count("\n") > 100
    assert tables_of(native) == tables_of(tmp_path)
    told = json.loads((native / "run.json").read_text())
    assert told["scene"]["packaging"] == "native"
    assert told["versions"]["ziglang"] == compiler.compiler_version()


WITHOUT_BUILDERS = """
import sys
from importlib import metadata

ABSENT, version = ("casadi", "cmake", "matplotlib", "pythonfmu", "scipy"), metadata.version

class Absent:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ABSENT:
            raise ModuleNotFoundError(name)

def of_present(name):
    if name in ABSENT:
        raise metadata.PackageNotFoundError(name)
    return version(name)

sys.meta_path.insert(0, Absent())
metadata.version = of_present
import hapticlink as hl

assert hl.run(sys.argv[1], out=sys.argv[2], figures=False).fault is None
"""


def test_an_exported_scene_runs_again_without_what_built_it(native, tmp_path):
    """The SSP holds the compiled FMUs, and says nothing of how they were made."""
    assert status("export", "closed-loop-ideal", *sets(NATIVE), "--out", tmp_path) == 0
    path = tmp_path / "closed-loop-ideal.ssp"
    with zipfile.ZipFile(path) as archive:
        assert b"packaging" not in archive.read("SystemStructure.ssd")
        archive.extract("resources/virtual_mechanism.fmu", tmp_path)
    with zipfile.ZipFile(tmp_path / "resources" / "virtual_mechanism.fmu") as archive:
        binaries = [n for n in archive.namelist() if n.startswith("binaries/")]
    assert [n.split("/")[1] for n in binaries] == [host_platform()]
    command = [sys.executable, "-c", WITHOUT_BUILDERS, path, tmp_path / "again"]
    assert subprocess.run(command, check=False).returncode == 0
    assert tables_of(native) == tables_of(tmp_path / "again")


@pytest.fixture
def asked(monkeypatch):
    """The platforms compiled for, by a stand-in: tests/fmus/test_native_fmu_entries.py compiles."""
    asked = []

    def compiled(source, name, folder, platforms):
        asked.extend(platforms)
        return {compiler.entry(p, name): p.encode() for p in platforms}

    monkeypatch.setattr("hapticlink.fmus.native.native_fmu_entries.binaries", compiled)
    return asked


def test_all_platforms_are_asked_for(tmp_path, monkeypatch, asked):
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    options = ("--set", "packaging=native", "--all-platforms", "--out", tmp_path)
    assert status("build", "five-bar", *options) == 0
    assert asked == ["linux64", "win64", "darwin64"] * 2  # of the hand and the mechanism
    with zipfile.ZipFile(tmp_path / "virtual_mechanism.fmu") as archive:
        assert archive.read("binaries/win64/virtual_mechanism.dll") == b"win64"
        assert archive.read("binaries/darwin64/virtual_mechanism.dylib") == b"darwin64"


@pytest.mark.parametrize("packaging", ["python", "native"])
def test_two_hands_are_two_fmus(tmp_path, monkeypatch, packaging):
    """Of the same component, with the wrench of each; nothing comes from a cache."""
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    option = f"packaging={packaging}"
    assert status("build", "two-hands", "--set", option, "--out", tmp_path) == 0
    built = sorted(p.name for p in tmp_path.iterdir())
    hands = sorted(open_scene.load("two-hands").hands)
    assert built == ["hand.fmu", *(f"hand_{n}.fmu" for n in hands), "virtual_mechanism.fmu"]
    assert len({(tmp_path / name).read_bytes() for name in built}) == len(built)


def test_a_cached_fmu_is_one_of_its_platforms_and_compiler(tmp_path, monkeypatch, asked):
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    scene = open_scene.load("pendulum", ("packaging=native",))

    def built(*platforms):
        files = fmu_files(scene, blocks(scene), timeline(scene), tmp_path, platforms)
        return files["virtual_mechanism"]

    assert built("linux64") == built("linux64")
    paths = {built("linux64"), built("win64"), built("linux64", "win64")}
    monkeypatch.setattr(compiler, "version", lambda name: "0.0")
    assert len(paths | {built("linux64")}) == 4


def test_without_ziglang_it_is_bad_input(tmp_path, monkeypatch, capsys):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(compiler, "version", missing)
    assert status("run", "five-bar", "--set", "packaging=native", "--out", tmp_path / "out") == 2
    assert install_command("native") in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
