"""FMI 3.0 from a compiled FMU: every number type, arrays, texts and bytes."""

from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.fmi.description import describe
from tests.little_fmus import edited, python_fmu, slave
from tests.orchestrator.c_fmus import NUMBERS, c_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fault, fmu_table, ran, run, wire_table

ONE = fmu_table("one", "types")
EXTREMES = {
    "Float64": -1e300, "Float32": 0.1, "Int64": -(2**53), "Int32": -(2**31), "Int16": -(2**15),
    "Int8": -(2**7), "UInt64": 2**53, "UInt32": 2**32 - 1, "UInt16": 2**16 - 1, "UInt8": 2**8 - 1,
    "Boolean": True,
}  # fmt: skip


@pytest.fixture(autouse=True)
def log(tmp_path, monkeypatch):
    """What the FMU gets as texts and blobs."""
    c_fmu3(tmp_path)
    monkeypatch.setenv("TYPES_FMU_LOG", str(tmp_path / "log"))
    return tmp_path / "log"


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_start_values_of_every_type(tmp_path, isolate, log):
    starts = "".join(f"start.in_{k} = {str(v).lower()}\n" for k, v in EXTREMES.items())
    starts += 'start.text = "Grüße"\nstart.blob = "00ff10"\n'
    found = ran(tmp_path, ONE + isolate + starts).haptics
    assert sorted(EXTREMES) == sorted(NUMBERS)
    for kind, value in EXTREMES.items():
        column = found[f"one.out_{kind}"]
        assert column[0] == 0.0
        np.testing.assert_array_equal(column[1:], np.float32(0.1) if kind == "Float32" else value)
    said = log.read_text(encoding="utf-8").splitlines()
    assert said == ["blob 00ff10", "Grüße"]


def test_which_output_is_the_derivative_of_which(tmp_path):
    """By value reference (FMI 3.0 section 2.4.7.4), entry by entry of an array."""

    def change(text):
        size = '<Dimension start="2"/>'
        text = text.replace('"out_Float32" valueReference="3" ', '"slope" valueReference="3" ')
        for name, more in (("out_Float64", ""), ("slope", 'derivative="1" ')):
            head, tail = text.split(f'name="{name}" ')
            text = f'{head}{more}name="{name}" ' + tail.replace("/>", f">{size}</{kind(name)}>", 1)
        return text

    def kind(name):
        return "Float32" if name == "slope" else "Float64"

    found = describe(edited(tmp_path / "types.fmu", change))
    assert found.derivatives == {"out_Float64[1]": "slope[1]", "out_Float64[2]": "slope[2]"}


def test_connections_to_every_type_round_to_whole_numbers(tmp_path):
    python_fmu(tmp_path, "Gives", "self.y = 2.6 - self.steps * 0.25")
    wires = "".join(wire_table("gives.y", f"one.in_{k}") for k in NUMBERS)
    found = ran(tmp_path, fmu_table("gives", "Gives") + ONE + wires, "duration=0.125")
    y = found.haptics["gives.y"][:-1]
    for kind in NUMBERS:
        given = y.astype(np.float32) if kind == "Float32" else y
        expected = given if "Float" in kind else y >= 0.5 if kind == "Boolean" else np.rint(y)
        np.testing.assert_array_equal(found.haptics[f"one.out_{kind}"][1:], expected)


@pytest.mark.parametrize(
    ("kind", "value", "limits", "isolate"),
    [
        ("Int8", 128.0, "-128 to 127", ISOLATED),
        ("UInt8", -1.0, "0 to 255", ""),
        ("UInt64", 2.0**64, "0 to 18446744073709551615", ""),
        ("Int64", 2.0**63, "-9223372036854775808 to 9223372036854775807", ""),
        ("Int32", -(2.0**31) - 1, "-2147483648 to 2147483647", ""),
    ],
)
def test_a_number_that_its_type_cannot_hold_is_a_fault(tmp_path, kind, value, limits, isolate):
    python_fmu(tmp_path, "Gives", f"self.y = {value!r} if self.steps == 3 else 1.0")
    wire = wire_table("gives.y", f"one.in_{kind}")
    experiment, found = run(tmp_path, fmu_table("gives", "Gives") + ONE + isolate + wire)
    said = f"one: in_{kind} cannot be {value!r}: {kind} holds {limits} at t = 0.046875 s"
    assert str(experiment.outcome.fault) == said
    assert found.haptics[f"one.out_{kind}"].tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_whole_numbers_beyond_2_53_start_exactly(tmp_path, isolate):
    """The largest whole numbers of both wide types that a double holds."""
    exact = {"UInt64": 2**64 - 2048, "Int64": -(2**63)}
    starts = "".join(f"start.in_{k} = {v}\n" for k, v in exact.items())
    found = ran(tmp_path, ONE + isolate + starts).haptics
    assert {kind: int(found[f"one.out_{kind}"][-1]) for kind in exact} == exact


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize(
    ("starts", "message"),
    [
        (f"start.in_UInt64 = {2**64 - 1}", f"out_UInt64 is {2**64 - 1}, which signals and results"),
        (f"start.in_Int64 = {2**53 + 1}", f"out_Int64 is {2**53 + 1}, which signals and results"),
        (
            f"start.in_Int64 = {2**63}",
            f"in_Int64 cannot be {2**63}: Int64 holds {-(2**63)} to {2**63 - 1}",
        ),
        # Of an array of another size than that of modelDescription.xml.
        ('start.size = 3\nstart."array[1,1]" = 1.0', "has no start value in an array of this size"),
    ],
)
def test_start_values_that_cannot_be(tmp_path, isolate, starts, message):
    assert message in fault(tmp_path, f"{ONE}{isolate}{starts}\n")


@pytest.mark.parametrize("isolate", ["", ISOLATED])
@pytest.mark.parametrize(
    "array", ["[[1, 2, 3], [4, 5, 6], [7, 8, 10]]", "[1, 2, 3, 4, 5, 6, 7, 8, 10]"]
)
def test_a_structural_parameter_sizes_a_matrix_given_by_rows(tmp_path, isolate, array):
    """Set in configuration mode (the FMU refuses it elsewhere); sum of i times entry i."""
    found = ran(tmp_path, f"{ONE}{isolate}start.size = 3\nstart.array = {array}\n")
    expected = sum((i + 1) * v for i, v in enumerate([1, 2, 3, 4, 5, 6, 7, 8, 10]))
    np.testing.assert_array_equal(found.haptics["one.sum"], expected)


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ("start.array = [[1, 2], [3]]\n", "rows of \\[2, 1\\] values for the 2 rows of 2 of array"),
        ("start.array = [[1, 2, 3], [4, 5, 6]]\n", "rows of \\[3, 3\\] values"),
        ("start.size = 3\nstart.array = [[1, 2], [3, 4]]\n", "for the 3 rows of 3 of array"),
        ('start.blob = "0g"\n', "blob takes pairs of hexadecimal digits"),
        ('start.text = "a\\u0000b"\n', "text would end at the"),
        ("start.size = true\n", "size takes a whole number"),
    ],
)
def test_what_fits_no_array_or_binary_is_refused(tmp_path, starts, message):
    with pytest.raises(SceneFault, match=message):
        run(tmp_path, ONE + starts)


@pytest.mark.parametrize(
    ("source", "target", "kind"),
    [
        ("one.out_UInt8", "two.text", "text is a String"),
        ("one.out_UInt8", "two.blob", "blob is a Binary"),
        ("one.echo", "two.in_UInt8", "echo is a Binary"),
        ("one.echo", "two.text", "echo is a Binary"),
    ],
)
def test_a_text_is_connected_to_one_of_its_type(tmp_path, source, target, kind):
    with pytest.raises(SceneFault, match=f"{kind}: .* output is connected to a .* input only"):
        run(tmp_path, ONE + fmu_table("two", "types") + wire_table(source, target))


def test_bytes_are_passed_on(tmp_path, log):
    """Zeros among them too."""
    two = fmu_table("two", "types") + wire_table("one.echo", "two.blob")
    found = ran(tmp_path, f'{ONE}start.blob = "00ff10"\n{two}')
    first, *others = [line for line in log.read_text().splitlines() if line.startswith("blob")]
    assert first == "blob 00ff10"
    assert set(others) == {"blob 00ff10"}
    assert "one.echo" not in found.haptics.columns


TEXTS = fmu_table("gives", "Gives", "rate = 50\n") + fmu_table("takes", "Takes")


def speaking(folder: Path) -> str:
    """A scene of an FMU that gives longer and longer texts to one at twice its rate."""
    body = """values["word"] += "ä"
        values["steps"] = len(values["word"])"""
    slave(folder, "Gives", ("output", {"word": "öö", "steps": 0}), body=body)
    counts = "values['length'] = len(values['heard'])"
    slave(folder, "Takes", ("input", {"heard": ""}), ("output", {"length": 0}), body=counts)
    return TEXTS + wire_table("gives.word", "takes.heard")


def test_a_text_is_held_between_rates(tmp_path):
    found = ran(tmp_path, speaking(tmp_path), "haptics.rate=100", "duration=0.1")
    np.testing.assert_array_equal(found.haptics["takes.length"], [0, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6])


def test_a_text_is_set_at_a_given_time(tmp_path):
    counts = "values['length'] = len(values['heard'])"
    slave(tmp_path, "Takes", ("input", {"heard": ""}), ("output", {"length": 0}), body=counts)
    at = '[[at]]\ntime = 0.05\nset = { "takes.heard" = "äöü" }\n'
    found = ran(tmp_path, fmu_table("takes", "Takes") + at, "haptics.rate=100", "duration=0.1")
    np.testing.assert_array_equal(found.haptics["takes.length"], [0] * 6 + [3] * 5)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('hold = "foh"\n', "word is a text, which can have no values in between; take zoh"),
        (ISOLATED, "word is a text, which is read and set within one process"),
    ],
)
def test_a_text_has_no_slope_and_leaves_no_process(tmp_path, more, said):
    scene = speaking(tmp_path)
    scene = scene.replace("rate = 50\n", "rate = 50\n" + more * (more == ISOLATED))
    with pytest.raises(InputFault, match=said):
        run(tmp_path, scene + more * (more != ISOLATED))
