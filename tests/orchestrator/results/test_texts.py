"""Strings and Binaries in tables: written, read back, after a kill, and from a state."""

import csv
import dataclasses
import re

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi import transfer
from hapticlink.orchestrator.results import rows_file, state_file
from tests.little_fmus import slave
from tests.orchestrator.c_fmus import c_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, process, scene, wire_table

BODY = """self.word = f'{self.mode}, step "{round(time * 64)}"' if end < 0.3 else "ä\\r\\nline"
        self.note, self.y = "1.5", self.y + 1.0"""
WORDS = ["none", *(f'go, step "{k}"' for k in range(19)), *["ä\r\nline"] * 13]
RECORD = 'record.signals = ["says"]\n'


SAVES = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}


def says(folder, more="", record=RECORD, body=BODY):
    variables = (
        ("input", {"mode": "go"}), ("output", {"y": 0.0, "word": "none", "note": "1.5"}),
    )  # fmt: skip
    slave(folder, "Says", *variables, body=body.replace("end", "(time + size)"), **SAVES)
    return scene(folder, record + fmu_table("says", "Says", more))


@pytest.mark.parametrize("kind", ["csv", "rows"])
def test_a_text_is_in_the_table_and_read_back(tmp_path, kind):
    path = says(tmp_path)
    run = hl.run(path, {"record.format": kind}, out=tmp_path / "out", figures=False)
    assert [*run["says.word"]] == WORDS
    assert [*run["says.note"]] == ["1.5"] * 33  # a text, whatever it looks like
    read, memory = hl.load(tmp_path / "out"), hl.run(path, figures=False)
    assert [*read["says.word"]] == WORDS
    assert read.has_rows_of(run)
    assert memory.has_rows_of(read)
    changed = dataclasses.replace(read.haptics, texts={2: dict.fromkeys(range(40), "x")})
    if kind == "csv":
        assert not memory.has_rows_of(dataclasses.replace(read, tables={"haptics": changed}))
        with (tmp_path / "out/haptics.csv").open(newline="") as file:
            rows = [*csv.reader(file)]
        assert [row[2] for row in rows[1:]] == WORDS
        assert not (tmp_path / "out/haptics.texts").exists()
    np.testing.assert_array_equal(read["says.y"], np.arange(33))


@pytest.mark.parametrize("cut", ["0.6,1.0\n", '0.6,1.0,"a\n', '0.6,x,"a","b"\n'])
def test_a_table_of_texts_with_a_line_that_is_none_is_refused(tmp_path, cut):
    hl.run(says(tmp_path), out=tmp_path / "out", figures=False)
    with (tmp_path / "out" / "haptics.csv").open("a") as table:
        table.write(cut)
    with pytest.raises(InputFault, match=r"haptics\.csv: .*: run the scene again"):
        hl.load(tmp_path / "out")


def test_another_run_leaves_no_texts_of_the_one_before(tmp_path):
    path = says(tmp_path)
    hl.run(path, {"record.format": "rows"}, out=tmp_path / "out", figures=False)
    assert (tmp_path / "out/haptics.texts").exists()
    hl.run(path, {"record.signals": ["says.y"]}, out=tmp_path / "out", figures=False)
    assert not (tmp_path / "out/haptics.texts").exists()


def test_a_killed_run_has_its_texts(tmp_path):
    kill = '__import__("os").kill(__import__("os").getpid(), 9) if end > 0.4 else None'
    path = says(tmp_path, body=f"{BODY}\n        {kill}")
    assert process(path, tmp_path / "out").returncode == -9
    found = hl.load(tmp_path / "out")
    assert [*found["says.word"]] == WORDS[: len(found["says.word"])]
    assert len(found["says.word"]) > 24
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"haptics.csv", "run.json"}
    assert not [*(tmp_path / "out").glob("*.texts")]


def test_a_line_that_was_cut_is_no_text(tmp_path):
    path = tmp_path / "haptics.texts"
    path.write_text('{"1": "String", "3": "Binary"}\n0 \n7 6162\n12 616')
    assert rows_file.read_texts(path) == {1: {0: "", 7: "ab"}, 3: {0: "", 7: "6162"}}


def test_a_run_with_texts_goes_on_from_its_state_to_the_same_bytes(tmp_path, monkeypatch):
    """Also in a process that has met none of them."""
    path = echoes(tmp_path)
    hl.run(path, out=tmp_path / "whole", figures=False, save=[0.28125])
    monkeypatch.setattr(transfer, "_TEXTS", {0: b""})
    state = tmp_path / "whole" / "at-0.28125.state"
    hl.run(state, out=tmp_path / "later", figures=False)
    for name in ("haptics.csv", "16hz.csv"):
        whole, later = ((tmp_path / d / name).read_bytes() for d in ("whole", "later"))
        head, _, rows = later.partition(b"\n")
        assert whole.startswith(head)
        assert whole.endswith(rows)
        assert rows
    branch = hl.run(state, {"fmu.says.start.mode": "stop"}, figures=False)
    assert branch["says.word"][1] == 'stop, step "18"'


def test_a_binary_is_in_hexadecimal_digits(tmp_path):
    c_fmu3(tmp_path)
    record = 'record.signals = ["one.echo"]\n'
    path = scene(tmp_path, record + fmu_table("one", "types", 'start.blob = "00ff0a"\n'))
    assert {*hl.run(path, figures=False)["one.echo"]} == {"00ff0a"}


def test_of_all_outputs_those_that_are_texts_are_recorded_where_a_list_names_them(tmp_path):
    path = says(tmp_path, record="")
    assert hl.run(path, figures=False).haptics.columns == ("time", "says.y")
    named = hl.run(path, {"record.signals": ["says.mode", "*.note"]}, figures=False)
    assert {*named.haptics.columns} == {"time", "says.mode", "says.note"}


def test_a_text_in_another_process_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(InputFault, match=r"is a text, .*: leave it out of .*record\.signals"):
        hl.run(says(tmp_path, ISOLATED), figures=False)


def test_two_texts_with_one_number_are_told_apart(monkeypatch):
    """Their hash is of 48 bits."""
    monkeypatch.setattr(transfer, "NUMBER", 0)
    numbers = [transfer.number_of(text) for text in (b"one", b"two", b"one")]
    assert len({*numbers}) == 2
    assert [transfer.text_of(n, "") for n in numbers] == [b"one", b"two", b"one"]


def echoes(folder):
    """A scene of which a text is held, and waits in a queue."""
    text = 'delays = { "says.word -> echo.said" = { min = 0.1 } }\n'
    text += RECORD.replace('"says"', '"says", "echo.*"') + fmu_table("says", "Says")
    text += fmu_table("echo", "Echo", "rate = 16\n") + wire_table("says.word", "echo.said")
    slave(
        folder, "Echo", ("input", {"said": "?"}), ("output", {"again": "?"}),
        body="self.again = self.said", **SAVES,
    )  # fmt: skip
    says(folder)
    return scene(folder, text)


def test_a_run_writes_its_own_texts_alone(tmp_path, monkeypatch):
    """The same bytes in a process that has had other runs, also into the folder of one; a text that
    this run never has is in no file."""
    path, options = echoes(tmp_path), {"record.format": "rows"}
    for folder, mode in (("a", "go"), ("b", "stop"), ("b", "go")):
        if folder == "a":
            monkeypatch.setattr(transfer, "_TEXTS", {0: b""})
        given = options | {"fmu.says.start.mode": mode}
        hl.run(path, given, out=tmp_path / folder, figures=False, save=[0.28125])
    files = {p.name for p in (tmp_path / "a").iterdir()}
    assert files == {*hl.load(tmp_path / "a").record.files}
    assert files == {p.name for p in (tmp_path / "b").iterdir()}
    assert files >= {"haptics.texts", "16hz.texts", "at-0.28125.state"}
    for name in files - {"run.json"}:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert [*hl.load(tmp_path / "b")["says.word"]] == WORDS


@pytest.mark.parametrize("what", ["output", "held", "waiting"])
def test_a_state_whose_text_is_none_is_refused(tmp_path, what):
    """One that waits in a queue as the FMU takes it."""
    path = echoes(tmp_path)
    hl.run(path, out=tmp_path / "out", figures=False, save=[0.28125])
    state = tmp_path / "out" / "at-0.28125.state"
    content, name = state_file.read_state(state), "says.word -> echo.said"
    if what == "output":
        content["fmus"]["says"]["outputs"]["word"] = 1.5
    elif what == "held":
        content["held"][name][:] = 1.5
    else:
        numbers, known = content["blocks"][name]["numbers"], {*map(float, transfer._TEXTS)}
        numbers[[n in known and n != 0 for n in numbers]] = 1.5
    state_file.write_state(state, content)
    fault = hl.run(state, out=tmp_path / "later", figures=False).run["fault"]["message"]
    assert re.search("said cannot be 1.5, the number" if what == "waiting" else "changed", fault)
    assert "the number of no text" in fault
