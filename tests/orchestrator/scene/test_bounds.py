"""Untrusted scenes and options: refused with their place, in time proportional to their size."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress

import pytest

from hapticlink.analysis.sweep import grid
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.scene import overrides, read_and_check
from tests.orchestrator.scene.test_refused_scenes import refused
from tests.orchestrator.scene.test_scene import GOOD, findings


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * 300 + "]" * 300,
        "x = " + "{a = " * 300 + "1" + "}" * 300,
        "a." * 20_000 + "a = 1",
        "[holds]\n" + '"a".' * 300 + "a = 'zoh'",
        "[" + "a." * 300 + "a]\nx = 1",
        "[[" + "[" * 100_000,
        "x = " + "[" * 20 + "{" + "a." * 20 + "b = 1}" + "]" * 20,
    ],
)
def test_what_is_too_deep_is_told_before_it_is_parsed(text):
    with pytest.raises(SceneFault, match=r"more than 32 names or brackets deep \(at line [12]\)"):
        read_and_check.read_scene(text)


def test_dots_around_names_are_no_names():
    assert overrides.parse(' a . "b.c" = 1')[0] == ("a", "b.c")


def test_names_that_no_file_can_have():
    for name in ("a" * 300, "." * 300, "./" * 300, "a\0b"):
        assert "neither a file nor a shipped scene" in refused(name)
    text = GOOD + "[[fmu]]\nname = 'x'\npath = '" + "a" * 300 + "'"
    assert "there is no file" in findings(text)["fmu[0] (x).path"][1]


@pytest.mark.skipif(os.name != "posix", reason="has no such files")
def test_only_files_of_bounded_size_are_read(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "long.toml").write_text(GOOD + "#" * 2**23)
    assert "more than 8388608 bytes" in refused(tmp_path / "long.toml")
    assert "neither a file" in refused(tmp_path / "fifo")
    for trace in ("/dev/zero", "fifo", "a" * 300, "a\\u0000b"):
        (tmp_path / "scene.toml").write_text(
            GOOD.replace("rate = 30", f'rate = {{ trace = "{trace}" }}')
        )
        assert "not a regular file" in refused(tmp_path / "scene.toml")
    with pytest.raises(InputFault, match="not a regular file"):
        grid.listed(tmp_path / "fifo")


@pytest.mark.parametrize(
    "values",
    ["1e400..1e401", "1..1e99999999", "0..1e-400..1e-401", "1..2:" + "9" * 5000, "1..2..1e-300"],
)
def test_ranges_without_end(values):
    with pytest.raises(InputFault, match="--vary x="):
        grid.parse(f"x={values}")


def test_grids_without_end():
    with pytest.raises(InputFault, match="10000000000 runs"):
        grid.grid([grid.parse("x=1..100000"), grid.parse("y=1..100000")])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("runs.csv", "hold\n" + "x" * 200_000, "not CSV: field larger"),
        ("runs.csv", "hold\n" + "zoh\n" * 100_001, "100001 runs; at most 100000"),
        ("runs.toml", "[[run]]\nx = " + "[" * 40, "not TOML: more than 32"),
    ],
)
def test_lists_of_runs_without_end(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputFault, match=message):
        grid.listed(tmp_path / name)


def test_a_date_in_a_list_of_runs_is_told_of_by_its_run(tmp_path):
    (tmp_path / "runs.toml").write_text("[[run]]\nduration = 2020-01-01\n")
    (point,) = grid.listed(tmp_path / "runs.toml")
    assert "2020-01-01" in refused("four-bar", f"duration={point['duration']}")


def test_findings_are_shown_to_the_twentieth():
    with pytest.raises(SceneFault) as fault:
        read_and_check.read_scene(
            GOOD + "[holds]\n" + "".join(f"a{i}.b = 'zoo'\n" for i in range(70))
        )
    assert len(fault.value.findings) == 70
    lines = str(fault.value).splitlines()
    assert len(lines) == 22
    assert lines[-1] == "  and 50 more, left out here"


def test_scenes_extend_one_another_to_the_twentieth(tmp_path):
    for i in range(300):
        (tmp_path / f"{i}.toml").write_text(f"extends = '{i + 1}.toml'\n")
    assert "the last of 20 scenes" in refused(tmp_path / "0.toml")


def _chain(n: int) -> str:
    bodies = (f"[[linkage.body]]\nname = 'b{i}'\nmass = 1.0\ninertia = 1.0\n" for i in range(n))
    joints = (
        f"[[linkage.joint]]\nname = 'j{i}'\nchild = 'b{i}'\n"
        + (f"parent = 'b{i - 1}'\n" if i else "")
        for i in range(n)
    )
    head = "title = 'a'\nduration = 1.0\n[linkage]\noperational_point = { body = 'b0' }\n"
    return head + "".join(bodies) + "".join(joints)


def _lines(function: Callable[[], object]) -> int:
    """How many lines of this project run in a call."""
    count = 0

    def trace(frame: object, event: str, _: object) -> object:
        nonlocal count
        count += event == "line"
        return trace

    sys.settrace(trace)
    try:
        function()
    finally:
        sys.settrace(None)
    return count


@pytest.mark.parametrize(
    "text",
    [
        _chain,
        lambda n: _chain(n).replace("child = 'b", "child = 'c"),
        lambda n: _chain(1) + "".join(f"unknown{i} = 1\n" for i in range(n)),
        lambda n: "# remark\n" * n + _chain(1),
    ],
    ids=["bodies", "faults", "unknown keys", "remarks"],
)
def test_time_grows_with_the_size_of_a_file(text):
    def read(n):
        def reads():
            with suppress(SceneFault):
                read_and_check.read_scene(text(n))

        return reads

    read(3)()  # what is made once
    small, large = _lines(read(120)), _lines(read(240))  # of more names than are searched
    assert large < 2.2 * small


def test_bodies_that_hold_one_another_are_told_once():
    text = _chain(5).replace("parent = 'b0'", "parent = 'b4'")
    found = findings(text)
    assert [k for k, (_, m) in found.items() if "circle" in m] == ["linkage.body[1] (b1)"]
