"""SSPs: what is written is valid and comes back to the bit; anyone's is read."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.run.compiled import build
from tests.little_fmus import python_fmu, slave, with_units
from tests.orchestrator.c_fmus import c_fmu3, clock_fmu3
from tests.orchestrator.foreign_scenes import PAIR, fmu_table, scene, wire_table
from tests.orchestrator.results.records import tables_of
from tests.orchestrator.ssp.ssps import foreign
from tests.orchestrator.system.test_timeline import pair
from tests.shared_fixtures import sets, status


def export(source: str, folder: Path, *options: str) -> Path:
    assert status("export", source, "--out", folder, *sets(options)) == 0
    return folder / f"{Path(source).stem}.ssp"


def come_back(source: str, folder: Path, *options: str) -> Results:
    """The results of a scene from its SSP, which are those of the scene to the bit."""
    ours = simulate(source, folder / "a", options)
    theirs = simulate(str(export(source, folder / "ssp", *options)), folder / "b")
    assert ours.outcome.fault is theirs.outcome.fault is None
    assert tables_of(folder / "a") == tables_of(folder / "b")
    return theirs.results


TICKS = "graphics.align=tick"


@pytest.mark.parametrize(
    ("name", "options", "tables"),
    [
        ("closed-loop-ideal", (), 2),
        ("closed-loop-ideal", ("graphics.rate={ min = 20, max = 60, seed = 3 }", "hold=foh"), 2),
        ("closed-loop-ideal", ("coupling=jacobi", TICKS, "holds.virtual_environment.P_c=delayed"),
         2),
        ("closed-loop-ideal", ("graphics.phase=0.01", "phases.virtual_mechanism='1/1024'",
                         "phases.controller=0.0005"), 4),
        ("two-hands", (), 1),
        ("local-model", (), 2),
    ],
)  # fmt: skip
def test_a_shipped_scene_comes_back_to_the_bit(tmp_path, name, options, tables):
    assert len(come_back(name, tmp_path, "duration=0.2", *options).tables) == tables


def test_others_read_it_and_the_same_scene_gives_the_same_bytes(tmp_path):
    path = export("closed-loop-ideal", tmp_path)
    content = path.read_bytes()
    ssd = read_ssd(str(path), validate=True)
    names = [e.name for e in ssd.system.elements]
    assert "virtual_mechanism" in names
    wired = {(c.startElement, c.startConnector, c.endElement, c.endConnector)
             for c in ssd.system.connections}  # fmt: skip
    assert ("haptic_device", "x[3]", "controller", "x_D[3]") in wired
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert {f"resources/{n}.fmu" for n in names} < set(archive.namelist())
    assert export("closed-loop-ideal", tmp_path).read_bytes() == content


def test_starts_factors_units_and_own_rates_come_back(tmp_path):
    with_units(python_fmu(tmp_path, "Gives", "self.y = 1500.0 * self.gain + time"), y="mm")
    with_units(python_fmu(tmp_path, "Takes", "self.y = self.u if self.on else 0.0"), u="m")
    text = PAIR + "factor = -0.1\noffset = 0.3\nhold = 'foh'\n"
    text = text.replace('"Gives.fmu"\n', '"Gives.fmu"\nrate = "100/3"\nstart.gain = 0.1\n')
    text = text.replace('"Takes.fmu"\n', '"Takes.fmu"\nstart.on = true\ntiming = "sampled"\n')
    found = come_back(str(scene(tmp_path, text)), tmp_path)
    assert set(found.tables) == {"haptics", "100_3hz"}
    assert abs(found.haptics["takes.y"][-1]) > 0.1


def test_variable_rates_of_fmus_come_back(tmp_path):
    path = pair(tmp_path, "{ min = 8, max = 32, seed = 3 }", "[0.125, 0.3, 0.5]")
    found = come_back(str(path), tmp_path)
    assert set(found.tables) == {"haptics", "8to32hz_seed3", "times_of_takes"}


def test_a_gain_that_is_held_comes_back(tmp_path):
    python_fmu(tmp_path, "Gives", "self.y = 100.0 + 400.0 * (time + size)")
    python_fmu(tmp_path, "Takes", "self.y = self.gain")
    text = fmu_table("gives", "Gives", "rate = 16\n") + fmu_table("takes", "Takes")
    how = 'hold = "foh"\nfactor = 2.0\noffset = 1.0\n'
    text += wire_table("gives.y", "takes.gain", how)
    found = come_back(str(scene(tmp_path, text)), tmp_path)
    assert found.run["holds"] == {"gives.y -> takes.gain": "foh"}
    # The line through the samples of t - 1/16 and t, at the middle of each step of 1/64 s.
    last = found.haptics["time"][-1]
    assert found.haptics["takes.y"][-1] == pytest.approx(1 + 2 * (100 + 400 * (last - 0.5 / 64)))


@pytest.mark.parametrize("version", ["1.0", "1.0.1", "2.0", "2.0-rc.1"])
def test_a_foreign_ssp_runs_at_the_rate_that_is_asked_for(tmp_path, version):
    """Of any version, with the same namespaces."""
    path = foreign(tmp_path, 'version="1.0" name', f'version="{version}" name')
    options = ["haptics.rate=50", "duration=0.2", "fmu.c.rate=25"]
    ended = simulate(path, tmp_path / "out", options)
    assert ended.outcome.fault is None
    # gain .5 of 1000 mm is .5 m; times 2, plus 1
    np.testing.assert_allclose(ended.results.tables["25hz"]["c.y"][-1], 2.0, rtol=1e-15)
    assert len(ended.results.haptics["a_b.y"]) == 11


def test_a_foreign_ssp_without_rate_or_duration_says_what_to_give(tmp_path):
    with pytest.raises(SceneFault) as refused:
        open_scene.load(foreign(tmp_path))
    keys = {f.key for f in refused.value.findings}
    assert keys == {"duration", "haptics.rate"}
    assert "--set haptics.rate=100" in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('endConnector="u"', 'endConnector="w"', "names c.w, which does not exist"),
        ('startElement="a b"', 'startElement="ab"', "names ab.y, which does not exist"),
        ('kind="input"', 'kind="inward"', "is no SSP 1.0"),
        ("fmu\"><ssd", "fmu\" type=\"application/x-ssp-package\"><ssd", "holds no SystemStr"),
        ("fmu\"><ssd", "fmu\" type=\"text/csv\"><ssd", "is a Component of type text/csv"),
        ("resources/a.ssv", "resources/b.ssv", "holds no resources/b.ssv"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(tmp_path, old, new, message):
    with pytest.raises(InputFault, match=message):
        open_scene.load(foreign(tmp_path, old, new))


@pytest.mark.skipif(
    not (build.HERE / build.name()).exists(),
    reason="the event loop has changed since the install, and would be compiled into the cache",
)
def test_with_the_cache_off_no_folder_stays(tmp_path):
    path = foreign(tmp_path)
    (tmp_path / "temporary").mkdir()
    code = (
        "from hapticlink.commands import main; import sys; "
        f"main(['run', {path!r}, '--out', {str(tmp_path / 'out')!r}, "
        "'--set', 'haptics.rate=50', '--set', 'duration=0.1'])"
    )
    environment = {"HAPTICLINK_CACHE": "off", "TMPDIR": str(tmp_path / "temporary")}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)
    assert not list((tmp_path / "temporary").glob("hapticlink*"))


def test_whole_and_boolean_parameters_start_as_in_the_scene(tmp_path):
    """Rounded, and true from 0.5 on: -1.8 is -2, and 0.3 is false."""
    python_fmu(tmp_path, "Gives", "pass")
    variables = ("parameter", {"count": 0, "on": False}), ("output", {"y": 0.0})
    body = "values['y'] = values['count'] + 100.0 * values['on']"
    slave(tmp_path, "Takes", *variables, body=body)
    text = PAIR.replace("takes.u", "takes.count") + "offset = -1.8\n"
    text += wire_table("gives.y", "takes.on", "offset = 0.3\n")
    found = come_back(str(scene(tmp_path, text)), tmp_path)
    assert found.haptics["takes.y"][-1] == -2.0


STARTS = 'start = { size = 3, array = [[1, 2, 3], [4, 5, 6], [7, 8, 9]], blob = "00ff" }\n'
SIZES = fmu_table("a", "types", STARTS)


def test_sizes_of_arrays_and_binary_starts_come_back(tmp_path):
    c_fmu3(tmp_path)
    found = come_back(str(scene(tmp_path, SIZES)), tmp_path)
    assert found.haptics["a.sum"][-1] == sum(i * i for i in range(1, 10))
    assert found.run["scene"]["fmu"][0]["start"]["blob"] == "00ff"


def test_a_connection_of_clocks_comes_back(tmp_path):
    clock_fmu3(tmp_path)
    wire = wire_table("one.fired", "two.go")
    fmus = fmu_table("one", "clocks") + fmu_table("two", "clocks")
    found = come_back(str(scene(tmp_path, fmus + wire)), tmp_path)
    assert found.haptics["two.go_count"][-1] == 1
