"""Scenes with faults are refused with all of them, by their place in the file."""

import pytest

from hapticlink.components.specs.hand import SpringHand
from hapticlink.components.specs.paths import PoseSine
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.scene import device_files, find_scene, read_and_check
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.scene.toml_keys import read_document

GOOD = """title = "A bar"
duration = 1.0
[haptics]
rate = 512
[graphics]
rate = 30
[linkage]
operational_point = { body = "bar", at = [0.1, 0.0] }
start.pivot = 0.5

[[linkage.body]]
name = "bar"
mass = 1.0
inertia = 0.01

[[linkage.joint]]
name = "pivot"
child = "bar"

[device]
[controller]
[hand]
wrench = [
  1.0, # N
  0.0,
  0.0,
]
"""


SPRING = "[[linkage.spring]]\nbodies = ['bra', 'ground']\nat = [[0.0, 0.0], [0.0, 0.0]]\n"


def findings(text: str, *options: str) -> dict[str, tuple[int | None, str]]:
    with pytest.raises(SceneFault) as refused:
        read_and_check.read_scene(text, options)
    assert refused.value.exit_status == 2
    return {f.key: (f.line, f.message) for f in refused.value.findings}


def test_a_good_scene_is_read():
    scene = read_and_check.read_scene(GOOD)
    assert scene.hand.type == "constant"
    assert scene.ends_when == "haptic_device.workspace_margin < 0"


def test_a_path_is_rows_or_a_sine_which_replaces_them_in_a_scene_that_extends(tmp_path):
    hand = '[hand]\ntype = "spring"\nstiffness = [1.0, 1.0, 1.0]\n'
    rows = hand + "target = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.1, 0.0, 0.0]]\n"
    (tmp_path / "base.toml").write_text(GOOD[: GOOD.index("[hand]")] + rows)
    sine = "target = { amplitude = [0.1, 0.0, 0.0], frequency = [2.0, 1.0, 0.0] }\n"
    text = 'title = "t"\nextends = "base.toml"\n[hand]\n'
    scene = read_and_check.read_scene(text + sine, folder=tmp_path)
    assert isinstance(scene.hand, SpringHand)
    assert scene.hand.target == PoseSine(amplitude=(0.1, 0.0, 0.0), frequency=(2.0, 1.0, 0.0))
    scene = read_and_check.read_scene(text + 'interpolation = "spline"\n', folder=tmp_path)
    assert scene.hand.interpolation == "spline"
    found = findings(GOOD[: GOOD.index("[hand]")] + hand + sine.replace("2.0", "-2.0"))
    assert "give a number >= 0 (Hz)" in found["hand.target.frequency[0]"][1]


def test_all_faults_at_once_with_line_and_remedy():
    text = GOOD.replace("mass = 1.0", "mas = 1.0").replace('child = "bar"', 'child = "bra"')
    text = text.replace("rate = 30", "rate = -3").replace("duration = 1.0", 'duration = "1"')
    text = text.replace("  0.0,\n  0.0,\n", "  0.0,\n")
    found = findings(text + "[holds]\nx = 'zog'\n" + SPRING)
    assert found["duration"] == (2, "'1' should be a valid number")
    assert found["linkage.body[0] (bar).mass"] == (11, "is missing")
    assert found["linkage.body[0] (bar).mas"] == (13, "unknown key; did you mean 'mass'?")
    assert found["linkage.joint[0] (pivot).child"] == (18, "no body 'bra'; did you mean 'bar'?")
    message = "-3 is out of range: give a number > 0 and <= 1000000 (Hz)"
    assert found["graphics.rate"] == (6, message)
    assert found["hand.wrench[2]"][1] == "is missing"
    assert found["holds.x"] == (28, "no hold 'zog'; did you mean 'zoh'?")
    assert found["linkage.spring[0].bodies[0]"] == (30, "no body 'bra'; did you mean 'bar'?")


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("[device]\n", "", "controller", "add [device]"),
        ("[graphics]\nrate = 30\n", "", "directions_from", "add [graphics]"),
        ("[graphics]\nrate = 30\n", "[[graphics]]\n", "graphics", ""),
        ("[hand]", "[hand]\ntype = 'arm'", "hand.wrench", "belongs to type 'constant', not 'arm'"),
    ],
)  # fmt: skip
def test_one_fault(old, new, key, message):
    assert old in GOOD
    found = findings(GOOD.replace(old, new))
    assert message in found[key][1]


def test_options_change_the_scene():
    options = [
        "controller.topology=false",
        "graphics.rate={min=10, max=60, seed=4}",
        "linkage.body.bar.mass=2.5",
        "title=two words",
    ]
    scene = read_and_check.read_scene(GOOD, options)
    assert scene.controller.topology is False
    assert scene.graphics.rate == VariableRate(min=10, max=60, seed=4)
    assert scene.linkage.body[0].mass == 2.5
    assert scene.title == "two words"


def test_sensing_reaches_the_device():
    built = {
        b.name: b.settings
        for b in blocks(read_and_check.read_scene(GOOD, ["sensing=encoders"])).built
    }
    assert built["haptic_device"]["encoders"]


def test_not_toml():
    with pytest.raises(SceneFault, match="line 1, column"):
        read_and_check.read_scene("title = =")


def test_lines_of_keys_after_texts_and_arrays_over_several_lines():
    text = 'a = """\n[x]\nb = 1\n"""\nc.d = [\n  1, # ]\n  2]\n'
    text += '[t]\ne = {f = 1}\n[[s]]\n[[s]]\n"g.h"=1\n'
    tables, lines = read_document(text)
    tables.clear()  # its reader's own
    assert read_document(text)[0]["t"] == {"e": {"f": 1}}
    assert lines == {
        ("a",): 1, ("c",): 5, ("c", "d"): 5, ("t",): 8, ("t", "e"): 9,
        ("s",): 10, ("s", 0): 10, ("s", 1): 11, ("s", 1, "g.h"): 12,
    }  # fmt: skip


def test_a_scene_lies_over_the_one_that_it_extends(tmp_path):
    base, top = tmp_path / "base.toml", tmp_path / "top.toml"
    base.write_text(find_scene.find_scene("closed-loop-ideal")[1])
    top.write_text(f'extends = "{base}"\nduration = 1.0\n[hand]\nwrench = [1.0, 0.0, 0.0]\n')
    scene = open_scene.load(str(top))
    assert scene.duration == 1.0
    assert scene.hand.wrench == (1.0, 0.0, 0.0)
    assert scene.linkage == open_scene.load("closed-loop-ideal").linkage


def test_scenes_of_the_same_numbers_share_mechanism_and_device(monkeypatch) -> None:
    """Numbers of the same bits alone; a device file is parsed once."""
    parsed = []
    read = device_files.read_document

    def read_document(text: str) -> object:
        parsed.append(text)
        return read(text)

    monkeypatch.setattr(device_files, "read_document", read_document)
    device_files._parse.cache_clear()
    options = ["hand.wrench=[0.1, 0, 0]", "device.motor.damping=0.0", "device.motor.damping=-0.0"]
    one, other, negative = (open_scene.load("closed-loop-ideal", [option]) for option in options)
    again = open_scene.load("closed-loop-ideal", ["hand.wrench=[0.2, 0, 0]", "title=other"])
    assert again.linkage is one.linkage is other.linkage
    assert again.device is one.device is not other.device
    assert repr(other.device) != repr(negative.device)
    assert len(parsed) == 1
