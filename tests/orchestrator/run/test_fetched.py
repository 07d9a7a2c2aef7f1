"""A run fetches, sets and records no more than is used, with the same results."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.experiment import Experiment, simulate
from tests.little_fmus import python_fmu, slave
from tests.orchestrator.c_fmus import NUMBERS, c_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, scene, wire_table
from tests.orchestrator.foreign_scenes import ran as ran_foreign

SCENE, SHORT = "closed-loop-ideal", ("duration=0.5",)
TOLD = ("end", "fault", "energies", "energies_within_a_rate", "step_errors", "delays", "unstable")


def ran(folder: Path, *options: str) -> Experiment:
    found = simulate(SCENE, folder, (*SHORT, *options))
    assert found.outcome.fault is None
    return found


def columns(folder: Path) -> dict[str, list[list[str]]]:
    """The tables as text, column by column without their names."""
    found = {}
    for path in folder.glob("*.csv"):
        with path.open(newline="") as file:
            found[path.stem] = [list(column) for column in zip(*csv.reader(file), strict=True)]
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return ran(folder), columns(folder)


LIST = '["hand", "virtual_mechanism.x", "virtual_environment.P_c[1,2]"]'


@pytest.mark.parametrize(
    ("signals", "every"), [("all", 7), ("connected", 1), ("none", 7), (LIST, 7)]
)
def test_recorded_columns_are_those_of_the_whole_table(whole, tmp_path, signals, every):
    """Each column in each row to the byte, and all else that a run tells."""
    found = ran(tmp_path, f"record.signals={signals}", f"record.every={every}")
    for rate, table in columns(tmp_path).items():
        rows = range(1, len(whole[1][rate][0]))
        rows = sorted({*rows[::every], rows[-1]})
        kept = {c[0]: [c[0], *(c[i] for i in rows)] for c in whole[1][rate]}
        assert table == [kept[c[0]] for c in table]
        assert signals != "all" or len(table) == len(kept)
    assert (not columns(tmp_path)) == (signals == "none")
    assert {k: found.run[k] for k in TOLD} == {k: whole[0].run[k] for k in TOLD}
    assert bool([*summary.describe_unrecorded(found.run["not_recorded"])]) == (signals != "all")
    said = " ".join(summary.lines(found.results))
    assert ("one row in 7" in said) == (every > 1)


def test_only_what_is_used_is_fetched(tmp_path):
    """What connections read; of the plants also what steps and faults are judged by."""
    found = ran(tmp_path, "record.signals=none").system
    kept = {u.name: {s.port for s in u.description.outputs} for u in found.fmus}
    read = {(c.source, c.source_port) for c in found.connections}
    assert all(port in kept[fmu] for fmu, port in read)
    assert kept["controller"] == {port for fmu, port in read if fmu == "controller"}
    assert kept["hand"] == {"F"}
    assert "energy" in kept["virtual_mechanism"]  # of the balance
    assert "workspace_margin" in kept["haptic_device"]  # of stop_when
    assert "iota" not in kept["virtual_environment"]


def test_calls_of_an_event(tmp_path):
    """One get, set and step of each FMU at each communication point; a checked step adds two half
    steps and two gets, with the state saved and restored."""
    outcome = ran(tmp_path).outcome
    calls, ticks = outcome.details.calls, 256
    assert calls["hand"] == {"get": ticks + 1, "step": ticks + 1}
    assert calls["controller"] == {"get": ticks + 1, "set": ticks + 1, "step": ticks + 1}
    for plant in ("haptic_device", "virtual_mechanism"):
        checked = outcome.details.step_errors[plant].checked
        assert calls[plant] == {
            "get": ticks + 2 * checked,
            "rollback": checked,
            "save": checked,
            "set": ticks,
            "step": ticks + 2 * checked,
        }


def test_an_fmu_in_a_process_of_its_own_counts_its_steps(tmp_path):
    """Of half a second at 64 Hz, as one that the loop calls."""
    python_fmu(tmp_path, "One")
    for where in ("", ISOLATED):
        path = scene(tmp_path, fmu_table("one", "One", where))
        assert simulate(str(path), tmp_path / "out").outcome.details.calls["one"]["step"] == 32


def test_the_loop_gets_whole_numbers_once(tmp_path):
    """One get of each type in each row: none is repeated in Python, which takes integers of 64 bits
    that may not be exact as doubles."""
    c_fmu3(tmp_path)
    found = simulate(str(scene(tmp_path, fmu_table("one", "types"))), tmp_path / "out")
    assert found.outcome.details.calls["one"] == {"get": 32 * len(NUMBERS), "step": 32}


FOREIGN = fmu_table("source", "Steady") + fmu_table("eats", "Eats")
FOREIGN += wire_table("source.y", "eats.u")


def test_an_fmu_that_uses_up_its_input_gets_it_at_each_step(tmp_path):
    """FMI has inputs keep their values, but FMUs of others need not, so that these are set though
    they have not changed."""
    python_fmu(tmp_path, "Steady", "self.y = 1.0")
    python_fmu(tmp_path, "Eats", "self.y += self.u; self.u = 0.0")
    path = scene(tmp_path, FOREIGN)
    found = simulate(str(path), tmp_path / "out")
    eaten = found.results.haptics["eats.y"]
    assert (eaten[2:] - eaten[1:-1] == 1.0).all()
    assert found.outcome.details.calls["eats"]["set"] == found.outcome.details.calls["eats"]["step"]


WALL = "settings = { stiffness = 1.0, position = 0.0 }\n"
HELD = (
    fmu_table("source", "Source", "rate = 8\n")
    + f'[[fmu]]\nname = "wall"\nblock = "virtual_wall"\n{WALL}'
    + wire_table("source.y", "wall.x", 'convert = false\nhold = "zoh"\n')
)


def test_unchanged_inputs_are_not_set_again(tmp_path):
    """A block of this project gets a held value once: at 0 s, and as each of 4 steps has ended."""
    python_fmu(tmp_path, "Source")
    found = simulate(str(scene(tmp_path, HELD)), tmp_path / "out")
    assert found.outcome.fault is None
    assert found.outcome.details.calls["wall"] == {"get": 33, "set": 5, "step": 33}


def test_rows_instead_of_csv(whole, tmp_path):
    found = ran(tmp_path, "record.format=rows")
    assert {p.name for p in tmp_path.iterdir()} == {"run.json", "haptics.rows", "graphics.rows"}
    for rate, table in whole[0].results.tables.items():
        assert found.results.tables[rate].columns == table.columns
        assert found.results.tables[rate].rows.tobytes() == table.rows.tobytes()
    ran(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {"run.json", "haptics.csv", "graphics.csv"}


def test_results_of_a_run_that_records_nothing(tmp_path):
    found = ran(tmp_path, "record.signals=none")
    assert {p.name for p in tmp_path.iterdir()} == {"run.json"}
    assert found.outcome.end_time == 0.5
    assert [*found.results.tables] == ["haptics", "graphics"]
    assert json.loads((tmp_path / "run.json").read_text())["files"] == ["run.json"]


def test_any_variable_is_recorded_by_its_name_or_a_pattern(tmp_path):
    """Locals of each type of number, an input and a parameter, as the FMU's own output has them; in
    a process of its own, too."""
    variables = (
        ("input", {"u": 0.0}),
        ("local", {"level": 0.0, "n": 3, "on": True}),
        ("parameter", {"gain": 2.5}),
        ("output", {"y": 0.0}),
    )
    body = """values["level"] += values["gain"] * size
        values["n"] += 1
        values["on"] = not values["on"]
        values["y"] = values["level"]"""
    path = slave(tmp_path, "Fed", *variables, body=body)
    for isolate in (False, True):
        text = fmu_table("fed", str(path.with_suffix("")), ISOLATED if isolate else "")
        text += '[[connection]]\nfrom = { formula = "t" }\nto = "fed.u"\n'
        file = scene(tmp_path, text, rate=10, duration=1.0)
        run = hl.run(file, {"record.signals": ["fed.*"]}, out=tmp_path / "run")
        assert np.array_equal(run["fed.level"], run["fed.y"])
        assert run["fed.level"][-1] == pytest.approx(2.5)
        assert np.array_equal(run["fed.n"], 3.0 + np.arange(11))
        assert np.array_equal(run["fed.on"], (np.arange(11) + 1) % 2)
        assert set(run["fed.gain"]) == {2.5}
        assert run["fed.u"][-1] == pytest.approx(0.9)  # of the step that ends there
        header = next(csv.reader((tmp_path / "run" / "haptics.csv").open()))
        assert not any(name.startswith("fed_u") for name in header)


@pytest.mark.parametrize("packaging", ["python", "native"])
def test_what_is_no_output_changes_nothing_of_a_run(whole, tmp_path, packaging):
    """Joint gains and the held matrices that a controller gets, beside the outputs to the byte."""
    names = ["controller.k_j", "controller.P_c", "virtual_environment.P_c", "haptic_device.x_true"]
    found = ran(tmp_path, f"record.signals={json.dumps(names)}", f"packaging={packaging}")
    (table,) = (t for rate, t in columns(tmp_path).items() if rate == "haptics")
    by_name = {c[0]: c[1:] for c in table}
    own = {c[0]: c[1:] for c in whole[1]["haptics"]}
    assert by_name["haptic_device.x_true[1]"] == own["haptic_device.x_true[1]"]
    assert set(by_name["controller.k_j"]) == {"200.0"}
    sent = {c[0]: c[1:] for c in columns(tmp_path)["graphics"]}["virtual_environment.P_c[1,1]"]
    assert set(by_name["controller.P_c[1,1]"]) <= {*sent}  # held, unchanged
    assert len(set(by_name["controller.P_c[1,1]"])) > 2
    assert found.run["end"]["reason"] == "duration"


def test_a_pattern_that_fits_nothing_is_refused(tmp_path):
    with pytest.raises(SceneFault, match=r"'virtual_mechanism\.nope\*' is no FMU, nor variable"):
        simulate(SCENE, tmp_path, ('record.signals=["virtual_mechanism.nope*"]',))


def test_an_fmu_without_the_output_is_told(tmp_path):
    slave(tmp_path, "Hears", ("input", {"u": 0.0}))
    with pytest.raises(SceneFault, match=r"'hears' has no output; 'hears\.\*' are all of its"):
        ran_foreign(tmp_path, fmu_table("hears", "Hears"), "record.signals=['hears']")


def test_a_run_without_the_pose_of_its_point_is_drawn(tmp_path):
    """The coordinates alone draw no mechanism: its finding tells of the point."""
    names = '["virtual_mechanism.q", "haptic_device.x_true"]'
    run = hl.run(SCENE, {"duration": 0.1, "record.signals": json.loads(names)}, out=tmp_path)
    assert not (run.folder / "mechanism.png").exists()


SLOWER = {"haptic_device.x": 64, "virtual_environment.*": 512, "virtual_mechanism.*": 32}


@pytest.mark.parametrize("kind", ["csv", "rows", "memory"])
@pytest.mark.parametrize("every", [1, 2])
def test_each_signal_has_a_rate_of_rows_of_its_own(tmp_path, kind, every):
    """`every` counts their rows, too; a rate beyond that of the FMU is the FMU's."""
    whole = hl.run("single-body", {"duration": 0.3}, figures=False)
    options = {"duration": 0.3, "record.every": every, "record.signals": SLOWER}
    if kind == "memory":
        found = hl.run("single-body", options, figures=False)
    else:
        options["record.format"] = kind
        hl.run("single-body", options, out=tmp_path, figures=False)
        found = hl.load(tmp_path)
    assert {*found.tables} == {"haptics", "haptics_32hz", "haptics_64hz", "graphics"}
    for table, signal, step in (
        ("haptics_64hz", "haptic_device.x", 8),
        ("haptics_32hz", "virtual_mechanism.q", 16),
        ("graphics", "virtual_environment.q", 1),
    ):
        source = whole.tables[table.partition("_")[0]]
        last = len(source["time"]) - 1
        rows = sorted({*range(0, last, step * every), last})  # there is always the last one
        np.testing.assert_array_equal(found.tables[table]["time"], source["time"][rows])
        np.testing.assert_array_equal(found[signal], source[signal][rows])
    assert "haptic_device.x" in found.record.not_recorded  # in every row of its rate


@pytest.mark.parametrize(("rate", "every"), [(170.667, 3), (512 / 3, 3), (73.1429, 7)])
def test_a_rate_is_taken_as_a_refusal_names_it(rate, every):
    options = {"duration": 0.1, "record.signals": {"haptic_device.x": rate}}
    found = hl.run("single-body", options, figures=False)
    (table,) = (t for name, t in found.tables.items() if name.startswith("haptics_"))
    np.testing.assert_array_equal(table["time"][:-1] * 512 / every, range(len(table["time"]) - 1))


def test_what_has_fewer_rows_is_in_no_finding(tmp_path):
    """Beside positions of another time a handle would be far from its point."""
    rates = {"haptic_device.*": 64, "*": 512}
    found = hl.run("single-body", {"duration": 0.3, "record.signals": rates}, figures=False)
    assert "not recorded in every row, and so not reported or drawn in full: tracking" in str(found)
    assert "from the operational point" not in str(found)


@pytest.mark.parametrize(
    ("signals", "options", "why"),
    [
        ({"haptic_device.x": 60}, {}, "60 Hz is no whole part of the 512 Hz of haptics, at whose "
         "communication points rows are: take 56.8889 or 64"),
        ({"virtual_environment.q": 7}, {"graphics.rate": {"min": 20, "max": 30, "seed": 1}},
         "the rate of graphics varies, of which 7 Hz is no part"),
        ({"nobody.x": 64}, {}, "'nobody.x' is no FMU, nor variable of one"),
        ({"haptic_device.x": 170.6}, {}, "take 128 or 170.667"),
        ({"haptic_device.x": 0}, {}, "0 is out of range: give a number >= 1e-05"),
    ],
)  # fmt: skip
def test_a_rate_that_rows_cannot_have_is_refused(signals, options, why):
    with pytest.raises(SceneFault) as refused:
        hl.run("single-body", {"record.signals": signals, **options}, figures=False)
    assert why in str(refused.value)
