"""Keys of a scene in every notation of TOML, and the line at which their faults are reported."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene import overrides, read_and_check
from hapticlink.orchestrator.ssp import names
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import scene as foreign_scene
from tests.orchestrator.scene.test_scene import GOOD
from tests.shared_fixtures import status

CLOSED = 'title = "t"\nextends = "closed-loop-ideal"\n'


def told(text: str, *options: str, folder: Path | None = None) -> str:
    with pytest.raises(SceneFault) as refused:
        read_and_check.read_scene(text, options, "scene", folder)
    return str(refused.value)


# --- spellings of a key -----------------------------------------------------------------------


@pytest.mark.parametrize("key", ["e.P_c", '"e.P_c"', "'e.P_c'", ' "e.P_c" '])
@pytest.mark.parametrize(
    "text", ["", '[holds]\n"e.P_c" = "foh"\n', 'holds.e.P_c = "foh"\n', '[holds.e]\nP_c = "foh"\n']
)
def test_a_name_with_dots_is_one_name_in_every_spelling(key, text):
    whole = text + GOOD if text.startswith("holds") else GOOD + text
    scene = read_and_check.read_scene(whole, [f"holds.{key}=lead"])
    assert scene.holds == {"e.P_c": "lead"}


@pytest.mark.parametrize("option", ['delays."e.P_c".loss=0.5', "delays.e.P_c.loss=0.5"])
def test_a_part_of_a_delay_is_set_beside_its_others(option):
    late = read_and_check.read_scene(
        GOOD + '[delays]\n"e.P_c" = { min = 0.1, seed = 3 }\n', [option]
    )
    found = late.delays["e.P_c"]
    assert (found.min, found.loss, found.seed) == (0.1, 0.5, 3)


@given(
    st.lists(st.text(st.characters(exclude_categories=("Cs",)), min_size=1), min_size=1, max_size=4)
)
def test_any_names_in_quotes_come_back(names):
    escaped = ("".join(rf"\U{ord(c):08X}" for c in name) for name in names)
    quoted = ".".join(f'"{name}"' for name in escaped)
    assert overrides.parse(f"{quoted} = 1") == (tuple(names), 1)


def test_names_that_are_no_key_of_toml_go_by_their_dots():
    assert overrides.parse("fmu.plant.start.x[1]=a=b") == (("fmu", "plant", "start", "x[1]"), "a=b")
    slow = "a" * 60 + " b=3"  # no time that grows with 2^60
    assert overrides.parse(slow) == (("a" * 60 + " b",), 3)


def test_nan_as_a_start_value(tmp_path):
    text = '[[fmu]]\nname = "p"\npath = "p.fmu"\nstart.mass = nan\n'
    assert "line 4: fmu[0] (p).start.mass: nan is out of range: give a finite number" in told(text)


def test_shape_faults_and_others_are_told_together(tmp_path):
    text = CLOSED + 'hold = "zog"\nduration = "1"\n[graphics]\nrate = "fast"\n[[connection]]\n'
    text += 'from = "handle.F"\n[hand]\ntype = "sprin"\n[holds]\n"controller.x_D" = "zog"\n'
    found = told(text)
    for message in (
        "line 3: hold: no hold 'zog'",
        "line 4: duration: '1' should be a valid number",
        "line 6: graphics.rate: 'fast' should be a number (Hz), a fraction",
        "line 7: connection[0].to: is missing",
        "line 8: connection[0].from: no FMU 'handle'; did you mean 'hand'?",
        "line 10: hand.type: no type 'sprin'",
        "line 12: holds.controller.x_D: no hold 'zog'",
    ):
        assert message in found
    assert found.startswith("scene: 7 faults")


def test_an_unknown_type_of_a_joint_hides_nothing():
    found = told(GOOD.replace('name = "pivot"', 'name = "pivot"\ntype = "x"'), "haptics.rate=-1")
    assert "joint[0] (pivot).type: 'x' should be 'revolute'" in found
    assert "haptics.rate: -1 is out of range: give a number > 0" in found


def test_a_missing_name_makes_no_fault_where_it_is_spoken_of():
    assert told(GOOD.replace('name = "bar"\n', "")).startswith("scene: 1 fault\n")


# --- places -----------------------------------------------------------------------------------


def _file(folder: Path, text: str, name: str = "top.toml") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_extends_is_looked_up_from_the_file_that_says_it(tmp_path, monkeypatch):
    _file(tmp_path, GOOD, "a/base/crank.toml")
    _file(tmp_path, 'extends = "base/crank.toml"\nhold = "foh"\n', "a/middle.toml")
    top = _file(tmp_path, 'extends = "../a/middle.toml"\ntitle = "top"\n', "b/top.toml")
    scene = open_scene.load(str(top))
    assert (scene.title, scene.hold, scene.duration) == ("top", "foh", 1.0)
    monkeypatch.chdir(tmp_path / "a")  # where base/ is, but not for the file
    lost = _file(tmp_path, 'title = "x"\nextends = "base/crank.toml"\n', "b/lost.toml")
    with pytest.raises(InputFault, match=r"lost: 1 fault\n  line 2: extends: base/crank.toml: "):
        open_scene.load(str(lost))


def test_what_a_base_extends_in_vain_names_the_base(tmp_path):
    base = _file(tmp_path, 'title = "x"\nextends = "closed-lop"\n', "base.toml")
    top = _file(tmp_path, 'extends = "base.toml"\n')
    with pytest.raises(InputFault) as refused:
        open_scene.load(str(top))
    assert f"{base}, line 2: extends: closed-lop: neither a file" in str(refused.value)
    assert "did you mean 'closed-loop'?" in str(refused.value)


def test_scenes_in_two_folders_that_extend_each_other_are_a_circle(tmp_path):
    _file(tmp_path, 'extends = "../b/two.toml"\n', "a/one.toml")
    two = _file(tmp_path, 'extends = "../a/one.toml"\n', "b/two.toml")
    with pytest.raises(InputFault, match="circle"):
        open_scene.load(str(two))


def test_an_inherited_fault_names_the_base_and_its_line(tmp_path):
    text = GOOD.replace("mass = 1.0", "mass = -1.0").replace("rate = 30", "rate = -3")
    base = _file(tmp_path, text, "base.toml")
    top = _file(tmp_path, 'extends = "base.toml"\nhold = "zog"\n[graphics]\nphase = 0.01\n')
    found = told(top.read_text(), folder=tmp_path)
    assert f"{base}, line 6: graphics.rate: -3 is out of range: give a number > 0" in found
    assert f"{base}, line 13: linkage.body[0] (bar).mass: -1.0 is out of range" in found
    assert "\n  line 2: hold: no hold 'zog'" in found


def test_what_replaces_an_array_of_the_base_stands_in_the_file_itself(tmp_path):
    _file(tmp_path, GOOD, "base.toml")
    text = 'extends = "base.toml"\n[[linkage.body]]\nname = "bar"\ninertia = 0.1\n'
    found = told(text, folder=tmp_path)
    assert "\n  line 2: linkage.body[0] (bar).mass: is missing" in found


@pytest.mark.parametrize(
    ("trace", "message"),
    [
        (None, "cannot be read"),
        ("t\n0.1\n0.2\n0.1\n", "line 4: 0.1 s is not after 0.2 s"),
        ("time\n0.1\nsoon", "line 3: 'soon' is no time"),
        ("0.1", "1 time stamps"),
    ],
)
def test_a_bad_trace_is_told_beside_other_faults(tmp_path, trace, message):
    if trace:
        (tmp_path / "frames.csv").write_text(trace)
    text = GOOD.replace("rate = 30", 'rate = { trace = "frames.csv" }')
    found = told(text.replace("mass = 1.0", "mass = -1.0"), folder=tmp_path)
    assert "\n  line 6: graphics.rate: " in found
    assert message in found
    assert "line 13: linkage.body[0] (bar).mass" in found


def test_a_hold_that_a_connection_asks_for_is_told_there(tmp_path):
    python_fmu(tmp_path, "A")
    python_fmu(tmp_path, "B")
    text = '[[fmu]]\nname = "a"\npath = "A.fmu"\n[[fmu]]\nname = "b"\npath = "B.fmu"\nrate = 32\n'
    text += '[[connection]]\nfrom = "b.y"\nto = "a.u"\nhold = "HOLD"\n'
    for hold, table in (("pspm", "[[spring]]"), ("passive", "[[power]]")):
        path = foreign_scene(tmp_path, text.replace("HOLD", hold))
        with pytest.raises(SceneFault) as refused:
            simulate(str(path), tmp_path / "out")
        said = str(refused.value)
        assert f"line 14: connection[0].hold: {hold!r} does not fit b.y -> a.u: " in said
        assert said.count("b.y -> a.u") == 1
        assert f"write a {table}" in said
        assert "docs/passivity.md" in said


# --- what would do nothing --------------------------------------------------------------------


def test_an_ssp_whose_structure_is_to_change(tmp_path):
    assert status("export", "pendulum", "--out", tmp_path) == 0
    path = str(tmp_path / "pendulum.ssp")
    for key in ("controller.topology=false", "linkage.gravity=[0, 0]", "packaging=native"):
        with pytest.raises(SceneFault, match="FMUs of an SSP are built already: change its scene"):
            open_scene.load(path, [key])
    assert open_scene.load(path, ["haptics.rate=64", "duration=0.5"]).duration == 0.5
    assert names.is_fixed(("graphics", "sync"))
    assert not names.is_fixed(("graphics", "rate"))


def test_native_where_no_block_is_ours():
    text = 'title = "t"\nduration = 1\npackaging = "native"\n[[fmu]]\nname = "a"\npath = "a.fmu"\n'
    assert "packaging: 'native' compiles the scene's own blocks" in told(text)


@pytest.mark.parametrize(
    ("options", "place"), [([], (15, None)), (["hold=foh"], (None, "--set hold=foh"))]
)
def test_a_changed_copy_still_knows_where_it_was_written(tmp_path, options, place):
    """`closed-loop` sets no spring, so that `pspm` fits nowhere; its `hold` is on line 15."""
    changed = replace(open_scene.load("closed-loop-ideal", options), hold="pspm")
    with pytest.raises(SceneFault) as refused:
        simulate(changed, tmp_path)
    (found,) = refused.value.findings
    assert (found.key, found.line, found.option) == ("hold", *place)
    assert changed.tables()["hold"] == "pspm"
    assert "origin" not in changed.tables()


def test_a_dropped_key_of_the_base_is_not_inherited(tmp_path):
    base, top = tmp_path / "base.toml", tmp_path / "top.toml"
    base.write_text('extends = "five-bar"\nholds = { "a.b" = "foh" }\nmechanism.substeps = 3\n')
    top.write_text(
        'extends = "base.toml"\ndrop = ["mechanism", "linkage.start.elbow1", "holds.\\"a.b\\""]\n'
        "[linkage.start]\nelbow1 = -1.5\n"
    )
    found = hl.scene(top)
    assert found.holds == {}
    assert found.mechanism.substeps == 1
    assert found.linkage.start["elbow1"] == -1.5
    assert found.linkage.start["shoulder1"] == pytest.approx(np.pi / 4)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('extends = "five-bar"\ndrop = ["linkag"]', "did you mean 'linkage'"),
        ('extends = "five-bar"\ndrop = ["linkage.start.elbw1"]', "did you mean 'elbow1'"),
        ('extends = "five-bar"\ndrop = ["title.x"]', "title is no table in the base scene"),
        ('extends = "five-bar"\ndrop = ["a b"]', "'a b' is no dotted key"),
        ('extends = "five-bar"\ndrop = 5', "5: write a list of dotted keys"),
        ('title = "t"\ndrop = ["linkage"]', "there is no base scene"),
    ],
)
def test_what_cannot_be_dropped_is_refused_with_its_line(lines, message, tmp_path):
    path = tmp_path / "top.toml"
    path.write_text(lines + "\n")
    with pytest.raises(hl.InputFault, match=r"line 2: drop: .*" + re.escape(message)):
        hl.scene(path)
