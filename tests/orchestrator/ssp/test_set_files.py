"""Parameter sets from files: as bindings of the root system of an SSP, and for FMUs of a scene."""

import json
from pathlib import Path

import pytest

from tests.little_fmus import python_fmu, with_units
from tests.orchestrator.foreign_scenes import fmu_table, scene, wire_table
from tests.orchestrator.ssp.parameter_sets import binding, bindings, parameters, unit, values
from tests.orchestrator.ssp.ssps import component, connectors, line, ssp, system
from tests.orchestrator.ssp.test_ssp_2 import MATRIX, SIZE
from tests.shared_fixtures import status

CENTIMETRES = unit("cm", 0.01)


def run(folder: Path, path: object, *more: str) -> dict[str, dict[str, object]]:
    """The start values in run.json, by FMU."""
    out = folder / "out"
    options = ("--no-figures", "--out", str(out), "--set", "haptics.rate=50", *more)
    assert status("run", str(path), *options) == 0
    tables = json.loads((out / "run.json").read_text())["scene"]
    return {fmu["name"]: fmu.get("start", {}) for fmu in tables["fmu"]}


def written(folder: Path, name: str, text: str) -> tuple[str, str]:
    (folder / name).write_text(text)
    return "--set-file", str(folder / name)


def test_a_file_goes_before_what_the_ssp_says_and_set_before_it(tmp_path, caplog):
    """By hierarchical names, and by connectors with transformations and units."""
    own = bindings(binding(values(("box.p.gain", "7"), ("lid", "1"))))
    inner = component("p", "Plain") + component("t", "Takes")
    box = system("box", connectors(u="input m"), inner, line("u", "t.u", "2 1"))
    root = system("top", connectors(lid="input m"), box, line("lid", "box.u"), own)
    path = ssp(tmp_path, root)
    given = (("box.p.gain", "8"), ("lid", "50 cm"), ("x", "1"))
    first = written(tmp_path, "a b.ssv", values(*given, units=CENTIMETRES))
    second = written(tmp_path, "second.ssv", values(("box.p.gain", "9")))
    found = run(tmp_path, path, *first)
    assert found == {"box_p": {"gain": 8.0}, "box_t": {"u": 2 * 0.5 + 1}}
    assert caplog.text.count("ignored: x\n") == 1
    assert run(tmp_path, path, *first, *second)["box_p"]["gain"] == 9.0
    by_hand = ("--set", "fmu.box_p.start.gain=10")
    assert run(tmp_path, path, *by_hand, *first)["box_p"]["gain"] == 10


def test_fmus_of_a_scene_take_values_in_units(tmp_path):
    with_units(python_fmu(tmp_path, "Gives", "self.y = self.gain"), gain="m")
    python_fmu(tmp_path, "Plain")
    text = fmu_table("gives", "Gives") + fmu_table("takes", "Plain")
    path = scene(tmp_path, text + wire_table("gives.y", "takes.u"))
    given = values(("gives.gain", "50 cm"), ("takes.u", "3"), units=CENTIMETRES)
    found = run(tmp_path, path, *written(tmp_path, "v.ssv", given))
    assert found["gives"]["gain"] == 0.5
    assert found["takes"]["u"] == 3.0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "No such file or directory; give an .ssv"),
        ("<a/>", "v.ssv is no SSP 1.0 or 2.0"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
        (parameters(MATRIX.replace(" 9", ""), SIZE), "8 values for 9 entries"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, capsys, content, message):
    path = ssp(tmp_path, system("top", "", component("p", "Plain"), line("p.y", "p.u")))
    if content:
        (tmp_path / "v.ssv").write_text(content)
    options = ("--set", "haptics.rate=50", "--set-file", str(tmp_path / "v.ssv"))
    assert status("run", path, *options) == 2
    assert message in capsys.readouterr().err
