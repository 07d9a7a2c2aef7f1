"""Connections from a table, a log, a formula, and another run."""

from itertools import pairwise

import numpy as np
import pytest
from fmpy import simulate_fmu

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from tests.little_fmus import slave

RATE = 100
ROWS = [[0.0, 1.0], [0.25, 3.0], [0.5, -2.0]]


def scene(folder, variables, sources, body="pass", rate=RATE):
    """A little FMU whose inputs are fed by `sources`, at `rate`."""
    path = slave(folder, "Fed", *variables, body=body)
    lines = [
        'title = "fed"',
        "duration = 1.0",
        f'[[fmu]]\nname = "fed"\npath = "{path}"\nrate = {rate}\ntiming = "sampled"',
        *(f'[[connection]]\nfrom = {of}\nto = "fed.{to}"' for to, of in sources.items()),
    ]
    file = folder / "fed.toml"
    file.write_text("\n".join(lines))
    return file


REAL = ("input", {"u": 0.0}), ("output", {"y": 0.0})


@pytest.mark.parametrize("packaging", ["python", "native"])
@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_a_table_acts_as_in_fmpy(tmp_path, interpolation, packaging):
    """FMPy interpolates lines of its input at the beginning of each step; steps it is given by two
    rows of one time, of which it takes the later."""
    body = 'values["y"] = values["u"]'
    of = f"{{ table = {ROWS}, interpolation = '{interpolation}' }}"
    run = hl.run(scene(tmp_path, REAL, {"u": of}, body), {"packaging": packaging})
    rows = ROWS
    if interpolation == "hold":
        ends = [[b[0], a[1]] for a, b in pairwise(ROWS)]
        rows = sorted([*ROWS, *ends], key=lambda row: (row[0], ROWS.count(row)))
    given = np.array([tuple(r) for r in rows], dtype=[("time", float), ("u", float)])
    theirs = simulate_fmu(
        str(tmp_path / "Fed.fmu"), stop_time=1.0, step_size=1 / RATE, output_interval=1 / RATE,
        input=given, output=["y"],
    )  # fmt: skip
    # FMPy's row of an instant is the end of the step before, ours of a sampled FMU its beginning.
    np.testing.assert_allclose(run["fed.y"][:-1], theirs["y"][1:], rtol=0, atol=1e-12)
    assert np.ptp(run["fed.y"]) == 5.0


def test_numbers_of_other_types_and_a_formula(tmp_path):
    """By the closed form; a Boolean is true from .5 on, an Integer the nearest."""
    inputs = {"on": False, "n": 0, "u": 0.0}
    outputs = {"a": 0.0, "b": 0.0, "c": 0.0}
    body = """values["a"] = float(values["on"])
        values["b"] = float(values["n"])
        values["c"] = values["u"]"""
    sources = {
        "on": "{ formula = 'where(t % 0.5 < 0.245, 1, 0)' }",
        "n": "{ table = [[0.0, 2], [0.3, 7]], interpolation = 'hold' }",
        "u": "{ formula = '-0.5*sin(2*pi*3*t)**2 + max(t, 0.2)' }",
    }
    run = hl.run(scene(tmp_path, (("input", inputs), ("output", outputs)), sources, body))
    t = np.arange(RATE + 1) / RATE
    assert np.array_equal(run["fed.a"], (t % 0.5 < 0.245) * 1.0)
    assert np.array_equal(run["fed.b"], np.where(t < 0.3 - 1e-9, 2.0, 7.0))
    expected = -0.5 * np.sin(2 * np.pi * 3 * t) ** 2 + np.maximum(t, 0.2)
    np.testing.assert_allclose(run["fed.c"], expected, rtol=0, atol=1e-14)


def test_what_a_run_recorded_drives_another_one_to_the_same_bits(tmp_path):
    """The wrench of a hand on an arm, which reacts to the handle, as that of nobody."""
    hand = {"type": "spring", "stiffness": [80.0, 80.0, 0.2], "target": [[0.0, 0.05, 0.02, -0.8]]}
    options = {"duration": 0.5, "hand": hand}
    own = hl.run("closed-loop-ideal", options, out=tmp_path / "own", figures=False)
    log = {"path": str(tmp_path / "own" / "haptics.csv"), "columns": ["time", "hand.F"]}
    wire = {"from": {"table": log}, "to": "haptic_device.F_hand"}
    again = hl.run("closed-loop-ideal", {**options, "connection.+": wire})
    assert np.array_equal(own["haptic_device.x_true"], again["haptic_device.x_true"])
    assert np.array_equal(again["haptic_device_F_hand.y"], own["hand.F"])


def test_a_log_has_units_and_lies_beside_the_scene(tmp_path):
    (tmp_path / "log.csv").write_text("t,force\n0,1\n500,2\n")
    of = "{ table = { path = 'log.csv', units = ['ms', 'kN'] }, interpolation = 'hold' }"
    file = scene(tmp_path, REAL, {"u": of}, 'values["y"] = values["u"]')
    run = hl.run(file)
    assert (run["fed.y"][0], run["fed.y"][-1]) == (1000.0, 2000.0)
    assert run.run["units"]["fed_u.y"] == "N"


def test_a_log_acts_at_the_times_that_it_has(tmp_path):
    (tmp_path / "log.csv").write_text("t,u\n250,True\n750,false\n")
    of = "{ table = { path = 'log.csv', units = ['ms', '1'] }, interpolation = 'hold' }"
    file = scene(tmp_path, REAL, {"u": of}, 'values["y"] = values["u"]')
    t = np.arange(RATE + 1) / RATE
    assert np.array_equal(hl.run(file)["fed.y"], np.where(t < 0.75 - 1e-9, 1.0, 0.0))


def test_a_log_that_cannot_be_read_is_told_once(tmp_path):
    (tmp_path / "log.csv").write_text("t,u\n0,1\n1,nan\n")
    file = scene(tmp_path, REAL, {"u": "{ table = { path = 'log.csv' } }"})
    with pytest.raises(SceneFault, match=r"1 fault\n.*line 3, column 2: 'nan' is no finite number"):
        hl.run(file)


def test_it_is_swept_as_all_keys(tmp_path):
    file = scene(tmp_path, REAL, {"u": "{ formula = 't' }"}, 'values["y"] = values["u"]')
    run = hl.run(file, {"connection.0.from.formula": "2*t"})
    assert run["fed.y"][-1] == 2.0


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("{ formula = 'f(t)' }", "`formula` 'f(t)': no function of a formula 'f'"),
        ("{ formula = 'x' }", "no variable of a formula 'x'"),
        ("{ formula = 't +' }", "invalid syntax; write a formula such as"),
        ("{ formula = '(lambda: 1)()' }", "is nothing that a formula may have"),
        ("{ formula = 't.real' }", "'t.real' is nothing that a formula may have"),
        ("{ formula = '1e400' }", "1e309 is no finite number"),
        ("{ formula = 'sin(t, 2)' }", "sin takes 1 arguments, not 2"),
        ("{ formula = '" + "(" * 300 + "t" + ")" * 300 + "' }", "too many nested parentheses"),
        ("{ }", "give a signal either a `table` or a `formula`"),
        ("{ formula = 't', table = [[0.0, 1.0]] }", "either a `table` or a `formula`"),
        ("{ formula = ['t', 't'] }", "has 2 numbers, fed.u takes 1"),
        ("{ table = [[0.0, 1.0], [0.0, 2.0]] }", "does not come after"),
        ("{ table = [] }", "the table has no rows"),
        ("{ table = [[0.0, 1.0], [1.0]] }", "row 2 has 1 numbers, the first one 2"),
        ("{ table = [[0.0], [0.1]] }", "at least one value beside its time"),
        ("{ formula = [] }", "either a `table` or a `formula`"),
        ("{ formula = 't', units = ['N', 'N'] }", "2 `units` for 1 values"),
        ("{ formula = 't', units = ['furlong'] }", "furlong"),
        ("{ formulae = 't' }", "connection[0].from.formulae: unknown key"),
        ("{ table = { path = 'none.csv' } }", "connection[0].from.table"),
    ],
)
def test_what_is_no_signal_is_refused(tmp_path, of, said):
    with pytest.raises(hl.Fault) as refused:
        hl.run(scene(tmp_path, REAL, {"u": of}))
    assert said in str(refused.value)


def test_settings_that_give_no_block_are_refused_with_their_line(tmp_path):
    """They are found wrong only when the block is built."""
    file = tmp_path / "law.toml"
    file.write_text(
        'title = "law"\nduration = 1.0\n\n[[fmu]]\nname = "law"\nblock = "discrete_equivalent"\n'
        '\n[fmu.settings]\nrule = "tustin"\n'
    )
    with pytest.raises(SceneFault, match=r"line 9: fmu\[0\] \(law\)\.settings\.rule: .*'tustin'"):
        hl.run(file)
    formula = scene(tmp_path, REAL, {"u": "{ formula = 'x' }"})
    line = next(i for i, row in enumerate(formula.read_text().split("\n"), 1) if "formula" in row)
    with pytest.raises(SceneFault, match=rf"line {line}: connection\[0\]\.from\.formula: "):
        hl.run(formula)
    with pytest.raises(SceneFault, match=r"--set connection.0.from.formula=y: connection\[0\]"):
        hl.run(formula, {"connection.0.from.formula": "y"})


TEXT = ("input", {"s": "a"}), ("output", {"said": "-"})
SAYS = 'values["said"] = values["s"]'
CSV = 'time,code,mode\n0,"1",shut\n250,"2","open, wide"\n500,"2","open, wide"\n750,"3",shut\n'


@pytest.mark.parametrize(
    ("of", "words"),
    [
        ('[[0.0, "x"], [0.25, "y"], [0.5, "y"], [0.75, ""]]', ["x", "y", "y", ""]),
        ('[[0.25, "x"], [0.75, "y"]]', ["x", "x", "x", "y"]),  # the ends are held
        ('{ path = "log.csv", columns = ["time", "mode"], units = ["ms"] }',
         ["shut", "open, wide", "open, wide", "shut"]),
        ('{ path = "log.csv", columns = ["time", "mode"], units = ["ms", ""] }',
         ["shut", "open, wide", "open, wide", "shut"]),
        ('{ path = "plain.csv" }', ["1", "2", "2", "2"]),  # quotes make it a text
    ],
)  # fmt: skip
@pytest.mark.parametrize("start_time", [0.0, 0.5])
def test_a_text_is_fed_from_a_table(tmp_path, of, words, start_time):
    """Each from the step on that begins at its time, and the first from initialisation on."""
    (tmp_path / "log.csv").write_text(CSV)
    (tmp_path / "plain.csv").write_text('0.0,"1"\n0.25,"2"\n')
    path = scene(tmp_path, TEXT, {"s": f"{{ table = {of} }}"}, SAYS)
    options = {"record.signals": ["fed.*"], "start_time": start_time}
    run = hl.run(path, options, figures=False)
    times = np.floor(run.tables["100hz"]["time"] * 4 + 1e-9).astype(int)
    expected = [words[min(k, 3)] for k in times]
    assert [*run["fed.said"][:-1]] == expected[:-1]
    assert run["fed.s"][0] == expected[0]


def test_a_run_feeds_a_text_of_another_one(tmp_path):
    first = scene(tmp_path, TEXT, {"s": '{ table = [[0.0, "x"], [0.3, "y"], [0.6, "x"]] }'}, SAYS)
    hl.run(first, {"record.signals": ["fed.*"]}, out=tmp_path / "first", figures=False)
    of = '{ table = { path = "first/100hz.csv", columns = ["time", "fed.said"] } }'
    (second := tmp_path / "second").mkdir()
    again = scene(second, TEXT, {"s": of.replace("first/", str(tmp_path / "first") + "/")}, SAYS)
    found = hl.run(again, {"record.signals": ["fed.said"]}, figures=False)
    assert [*found["fed.said"]] == [*hl.load(tmp_path / "first")["fed.said"]]


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ('{ table = [[0.0, "a"]], interpolation = "linear" }', "texts are held until the next"),
        ('{ table = [[0.0, "a"]], units = ["N"] }', "units = ['N']: texts are held until the next"),
        ('{ table = [[0.0, "a"]], fomula = "t" }', "fomula = 't': texts are held"),
        ("{ table = { path = 'bare.csv', columns = ['time'] } }", "one value beside its time"),
        ('{ table = [[0.0, "a"], [0.1, 2.0]] }', "row 2, [0.1, 2.0]: with texts a row is a time"),
        ('{ table = [[0.1, "a"], [0.1, "b"]] }', "row 2: 0.1 does not come after 0.1"),
        ('{ table = { path = "log.csv", columns = ["time", "mode"], units = ["ms", "N"] } }',
         "texts have none: give that of the time alone"),
        ('{ table = { path = "log.csv", columns = ["mode", "code"] } }', "'shut' is no number"),
        ('{ table = { path = "bare.csv" } }', "takes a table of texts, those of a CSV in quotes"),
        ("{ formula = 't' }", "s is a String"),
    ],
)  # fmt: skip
def test_what_feeds_no_text_is_refused_at_its_connection(tmp_path, of, said):
    (tmp_path / "log.csv").write_text(CSV)
    (tmp_path / "bare.csv").write_text("time,code\n0.0,1\n")
    with pytest.raises(SceneFault) as refused:
        hl.run(scene(tmp_path, TEXT, {"s": of}))
    assert said in str(refused.value)
    assert "connection[0]" in str(refused.value)
    assert len(str(refused.value).splitlines()) == 2


@pytest.mark.parametrize("other", ['{ table = [[0.0, "b"]] }', '"fed.said"'])
def test_a_text_that_is_fed_twice_is_refused(tmp_path, other):
    path = scene(tmp_path, TEXT, {"s": '{ table = [[0.0, "a"]] }'}, SAYS)
    path.write_text(path.read_text() + f'\n[[connection]]\nfrom = {other}\nto = "fed.s"\n')
    with pytest.raises(SceneFault, match=r"connection\[0\].*fed\.s is fed by another .*; keep one"):
        hl.run(path, figures=False)


@pytest.mark.parametrize("rows", ["[0.0, 'a']", "[0.0, 'a'], [0.5, 'b'], [0.7, 'c']"])
def test_a_number_takes_no_text(tmp_path, rows):
    """Said once, at the connection."""
    with pytest.raises(SceneFault) as refused:
        hl.run(scene(tmp_path, REAL, {"u": f"{{ table = [{rows}] }}"}))
    assert str(refused.value).splitlines()[1:] == [
        "  line 9: connection[0].from.table: 'a': u takes a number; connect a text to a String"
    ]


def test_a_table_of_texts_into_another_process_is_refused_before_the_run(tmp_path):
    path = scene(tmp_path, TEXT, {"s": '{ table = [[0.0, "a"], [0.5, "b"]] }'}, SAYS)
    path.write_text(path.read_text().replace("timing", "isolate = true\ntiming", 1))
    with pytest.raises(InputFault, match=r"fed\.s is a text, .* within one process.*start value"):
        hl.run(path, out=tmp_path / "out", figures=False)
    assert not (tmp_path / "out" / "run.json").exists()


def test_one_program_names_the_table_that_it_cannot_hold(tmp_path):
    path = scene(tmp_path, TEXT, {"s": '{ table = [[0.0, "a"], [0.5, "b"]] }'}, SAYS)
    with pytest.raises(InputFault) as refused:
        hl.build(path, as_one=True, out=tmp_path / "one")
    assert "connection[0].from.table: what happens at given times" in str(refused.value)
    assert "[[at]]" not in str(refused.value)
