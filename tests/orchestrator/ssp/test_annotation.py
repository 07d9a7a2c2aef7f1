"""The annotation of an SSP has the shape that is written here, and names no files."""

import json
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from tests.little_fmus import edited, edited_entries, python_fmu
from tests.orchestrator.ssp.ssps import foreign

RUN = {"duration": 0.2, "haptics": {"rate": 50}}


def annotated(folder: Path, content: Any) -> str:
    text = content if isinstance(content, str) else json.dumps(content)
    annotation = (
        '<ssd:Annotations><ssc:Annotation type="hapticlink.run"><h:Scene '
        f'xmlns:h="urn:hapticlink:run">{escape(text)}</h:Scene></ssc:Annotation></ssd:Annotations>'
    )
    return foreign(folder, "</ssd:System>", f"</ssd:System>{annotation}")


def test_an_annotation_says_rates(tmp_path):
    path = annotated(tmp_path, {**RUN, "fmu": {"c": {"rate": 25}}})
    assert len(simulate(path, tmp_path / "out").results.tables["25hz"]["c.y"]) == 6


def test_hardware_goes_into_an_ssp_and_comes_back(tmp_path):
    read = open_scene.load(annotated(tmp_path, {**RUN, "fmu": {"c": {"hardware": True}}}))
    hl.export(read, out=tmp_path / "again.ssp")
    again = open_scene.load(str(tmp_path / "again.ssp"))
    for scene in (read, again):
        assert {f.name: f.hardware for f in scene.fmu} == {"a_b": False, "c": True}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[" * 100_000, "annotation hapticlink.run: "),
        ("9" * 5000, "annotation hapticlink.run: "),
        ("[]", "should be a table"),
        ("null", "should be a table"),
        ({"fmu": []}, "fmu: should be a table"),
        ({"fmu": {"c": 3}}, "fmu.c: should be a table"),
        ({"fmu": {"c": {"path": "/etc/passwd"}}}, "fmu.c.path: does not belong here"),
        ({"fmu": {"c": {"block": "hand"}}}, "fmu.c.block: does not belong here"),
        ({"fmu": {"c": {"rate": {"trace": "/etc/passwd"}}}}, "fmu.0.rate: a trace is a file"),
        ({"graphics": {"rate": {"trace": "/etc/passwd"}}}, "graphics.rate: a trace is a file"),
        ({"graphics": []}, "graphics: should be a table"),
        ({"connection": {}}, "connection: should be a list"),
        ({**RUN, "connection": [3]}, "connection"),
        ({"extends": "closed-loop-ideal"}, "extends: does not belong here"),
        ({"linkage": {}}, "linkage: does not belong here"),
        ({"": {}}, "does not belong here"),
        ({**RUN, "title": "\ud800"}, "is no Unicode text"),
        ({**RUN, "holds": {"x": 10**30}}, "more than 64 bits"),
        ({**RUN, "holds": [1]}, "holds: "),
    ],
)
def test_an_annotation_of_another_shape(tmp_path, content, message):
    with pytest.raises(InputFault, match=message) as refused:
        open_scene.load(annotated(tmp_path, content))
    assert "root:" not in str(refused.value)  # of no file that it names


def test_a_file_outside_is_named_by_the_user_alone(tmp_path):
    path = annotated(tmp_path, RUN)
    (tmp_path / "frames.csv").write_text("0\n0.1\n0.2\n")
    other = python_fmu(tmp_path, "Other", "self.y = 7.0")
    trace = f'fmu.a_b.rate={{ trace = "{tmp_path / "frames.csv"}" }}'
    ended = simulate(path, tmp_path / "out", [f"fmu.c.path={other}", trace])
    assert ended.results.haptics["c.y"][-1] == 7.0
    np.testing.assert_array_equal(ended.results.tables["times_of_a_b"]["time"], [0.0, 0.1, 0.2])


@pytest.mark.parametrize("step", ["0", "x", "NaN", "1e999", "-1", "1e-99999999", ""])
def test_a_step_size_that_is_none_is_asked_for(tmp_path, step):
    path = Path(foreign(tmp_path))
    element = f'<DefaultExperiment stepSize="{step}"/><ModelVariables>'
    fmu = edited(tmp_path / "Takes.fmu", lambda t: t.replace("<ModelVariables>", element))
    edited_entries(path, lambda entries: entries | {"resources/Takes.fmu": fmu.read_bytes()})
    with pytest.raises(InputFault, match=r"--set haptics\.rate=|haptics\.rate: .* should be"):
        open_scene.load(str(path), ["duration=0.1"])
    assert open_scene.load(str(path), ["duration=0.1", "haptics.rate=50"])


@pytest.mark.parametrize("name", ["martian", "idna", "shift_jis", "utf-7", "hex"])
def test_encodings_that_are_none(tmp_path, name):
    path = foreign(tmp_path, 'encoding="UTF-8"', f'encoding="{name}"')
    with pytest.raises(InputFault, match="is not well-formed XML"):
        open_scene.load(path)
