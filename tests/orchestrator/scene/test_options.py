"""Options as Python values, of scenes by name and of Scene objects alike."""

import pickle
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.find_scene import list_shipped
from tests.shared_fixtures import BAR

SCALARS = (
    st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=("Cs",)))
)
VALUES = st.recursive(
    SCALARS, lambda v: st.lists(v) | st.dictionaries(st.text("abc. \"'=", min_size=1), v)
)


@given(VALUES)
def test_a_value_comes_back_from_its_text(value):
    (option,) = overrides.write_options({"a.b": value})
    assert overrides.parse(option) == (("a", "b"), value)


def test_words_numbers_and_arrays_are_written_as_on_the_command_line():
    given = {
        "hold": "foh", "graphics.rate": 10, "controller.topology": False, "title": "1",
        "hand.wrench": np.array([0.1, 0, 2]), "controller.damping": (1, np.float64(2), 3.5),
        "phases": {"hand": Path("a")},
    }  # fmt: skip
    assert overrides.write_options(given) == (
        "hold=foh", "graphics.rate=10", "controller.topology=false", 'title="1"',
        "hand.wrench=[0.1, 0.0, 2.0]", "controller.damping=[1, 2.0, 3.5]",
        'phases={ "hand" = "a" }',
    )  # fmt: skip


NO_VALUE = r"graphics\.rate: .* is no value of a scene"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        *(({"graphics.rate": v}, NO_VALUE) for v in (None, object(), b"10", {1, 2}, [None])),
        ([("graphics.rate", 10)], r"option \('graphics.rate', 10\): write key=value, or"),
        ("graphics.rate=10", "give a mapping, or a list"),
    ],
)
def test_what_is_no_option_is_refused(given, message):
    with pytest.raises(InputFault, match=message):
        open_scene.load("closed-loop-ideal", given)


def test_a_scene_object_takes_options_as_its_name_does(tmp_path):
    (tmp_path / "bar.toml").write_text(BAR)
    more = {"haptics.rate": 100, "linkage.body.bar.mass": 2.0}
    wanted = open_scene.load(tmp_path / "bar.toml", {"duration": 0.1, **more})
    read = open_scene.load(tmp_path / "bar.toml", {"duration": 0.1})
    found = open_scene.load(read, more)
    assert found == wanted
    assert found.source == wanted.source
    assert read.haptics.rate == 512
    assert open_scene.load(read) is read
    # A family is written out again, which the records alone could not do.
    chain = open_scene.load(open_scene.load("n-four-bar"), {"linkage.n": 2})
    assert chain.linkage == open_scene.load("n-four-bar", ["linkage.n=2"]).linkage


def test_faults_of_a_scene_object_name_option_and_line(tmp_path):
    (tmp_path / "bar.toml").write_text(BAR.replace("0.25", "0.25\nhold = 'foh'"))
    read = open_scene.load(tmp_path / "bar.toml")
    with pytest.raises(SceneFault) as refused:
        open_scene.load(read, {"linkage.body.bar.mass": "heavy"})
    assert "--set linkage.body.bar.mass=heavy: linkage.body[0] (bar).mass" in str(refused.value)
    longer = open_scene.load(read, {"duration": 1.0})
    for one in (longer, pickle.loads(pickle.dumps(longer))):  # in another process too
        assert str(one.place(("hold",), "wrong")) == "line 3: hold: wrong"
        assert str(one.place(("duration",), "long")) == "--set duration=1.0: duration: long"


@pytest.mark.parametrize("name", sorted(list_shipped()))
def test_a_scene_is_read_again_from_its_records(name):
    read = open_scene.load(name)
    made = replace(read, title="made in Python")
    assert made.source is None
    again = open_scene.load(made, {"title": read.title})
    assert again == read


def test_a_scene_made_in_python_is_checked():
    made = replace(open_scene.load("five-bar"), hold="zho")
    with pytest.raises(SceneFault, match="no hold 'zho'; did you mean 'zoh'"):
        open_scene.load(made)


@given(st.text(st.characters(exclude_categories=("Cs",))), st.text("ab. []{}\"'$`*=,", max_size=20))
def test_what_is_printed_can_be_pasted_into_a_shell(key, value):
    """The shell gives back the words of which the text was made."""
    option = f"{key}={value}"
    assert shlex.split(overrides.as_command_line(option)) == ["--set", option]
    (swap,) = overrides.write_options({"fmu.+": {"replaces": "hand", "path": value}})
    assert shlex.split(overrides.as_command_line(swap)) == ["--swap", f"hand={value}"]
