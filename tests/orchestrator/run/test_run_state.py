"""A run that goes on from a state gives the bytes of one that was not interrupted; what does not
fit is refused by name."""

import csv
import hashlib
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault, SceneFault
from hapticlink.orchestrator.holds import HOLDS, Hold
from hapticlink.orchestrator.results.recover import recover
from hapticlink.orchestrator.scene.find_scene import list_shipped
from tests.little_fmus import python_fmu
from tests.orchestrator.c_fmus import equations_fmu, event_fmu3
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, scene, wire_table
from tests.shared_fixtures import status

SMALL = {"duration": 0.8, "haptics.rate": 128, "graphics.rate": 16, "record.every": 3}
LATE = {"min": 0.01, "max": 0.06, "loss": 0.3, "seed": 3}
NOISE = {"time": 0.2, "until": 0.6, "noise": {"controller.x_D": 1e-4}, "seed": 2}
SET = [{"time": 0.1, "set": {"controller.K_pc": [90.0, 90.0, 0.4]}}, NOISE]
BODY, ACROSS = "single-body", "closed-loop-direct"
RUNNING = {
    "noise, random latency and loss": (
        BODY,
        SMALL | {"delays": {"virtual_environment.Lambda_inv": LATE}, "at": SET},
    ),
    "first order": (BODY, SMALL | {"hold": "foh"}),
    "frames at times of their own": (
        BODY,
        SMALL | {"graphics.rate": {"min": 8, "max": 20, "seed": 4}},
    ),
    "energy account and queues": (
        ACROSS,
        {"duration": 0.6, "hold": "passive", "delays": {"controller.F_drift": 0.03}},
    ),
    "tank": (ACROSS, {"duration": 0.6, "hold": "pspm"}),
    "steps that are taken early": (ACROSS, {"duration": 0.6, "hold": "model"}),
    "steps that are repeated": (
        "sampled-spring",
        {"duration": 0.8, "coupling": "iterated", "iteration.method": "newton",
         "hand.timing": "continuous"},
    ),
}  # fmt: skip


def joined(folder: Path, later: Path, table: str, begun: float) -> list[str]:
    """The lines of a table before a time, then those of the run that goes on."""
    first, rest = ((f / table).read_text().splitlines() for f in (folder, later))
    return [first[0], *(r for r in first[1:] if float(r.split(",")[0]) < begun), *rest[1:]]


def assert_goes_on(folder: Path, given: str, options: dict[str, object], name: str) -> None:
    """The tables of a run that goes on from a state of a shorter one are those of the whole run."""
    hl.run(given, options, out=folder / "whole", figures=False)
    # A scene that ends earlier, so that what is left out at its end is not in the state.
    shorter = options | {"duration": 0.55}
    hl.run(given, shorter, out=folder / "first", figures=False, save=[0.3, "every=0.2", "end"])
    state = folder / "first" / name
    later = hl.run(state, {"duration": options["duration"]}, out=folder / "later", figures=False)
    assert later.fault is None
    begun = later.run["resumed"]["time"]
    record = json.loads((folder / "whole" / "run.json").read_text())
    for table in (f"{clock}.csv" for clock in record["rates"]):
        whole = (folder / "whole" / table).read_text().splitlines()
        assert joined(folder / "first", folder / "later", table, begun) == whole
    for key in ("energies", "energies_within_a_rate", "links", "delays", "end", "step_errors",
                "iterations", "premises", "overdrawn"):  # fmt: skip
        assert later.run[key] == record[key], key


@pytest.mark.parametrize(
    ("what", "state"),
    [
        *((what, "at-0.3.state") for what in RUNNING),
        ("first order", "end.state"),
        ("first order", "last.state"),
    ],
)
def test_a_run_goes_on_to_the_same_bytes(tmp_path, what, state):
    assert_goes_on(tmp_path, *RUNNING[what], state)


def test_to_save_changes_no_byte(tmp_path):
    for name, save in (("saved", [0.3, "every=0.1", "end"]), ("plain", [])):
        hl.run("single-body", SMALL, out=tmp_path / name, figures=False, save=save)
    for table in ("haptics.csv", "graphics.csv"):
        assert len({(tmp_path / name / table).read_bytes() for name in ("saved", "plain")}) == 1
    assert not hl.load(tmp_path / "saved").run["unsaved"]
    states = {path.name for path in (tmp_path / "saved").glob("*.state")}
    assert states == {"at-0.3.state", "last.state", "end.state"}
    hl.run("single-body", SMALL, out=tmp_path / "saved", figures=False)  # replaces them as well
    assert not [*(tmp_path / "saved").glob("*.state")]


def test_a_run_that_ends_before_says_what_it_did_not_save(tmp_path):
    options = SMALL | {"stop_when": "hand.F[2] > 0.05"}  # the profile's, after 0.25 s
    found = hl.run("single-body", options, out=tmp_path, figures=False, save=[0.1, "end"])
    assert found.run["end"]["reason"] == "stop_when"
    assert found.run["end"]["time"] > 0.1
    assert found.run["unsaved"] == ["end.state"]
    assert "warning: end.state not saved: the run ended before" in found.run["warnings"]
    assert {*found.run["files"]} >= {path.name for path in tmp_path.glob("*.state")}
    assert "end.state" not in found.run["files"]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A state at 0.3 s."""
    folder = tmp_path_factory.mktemp("small")
    hl.run("single-body", SMALL | {"at": SET}, out=folder, figures=False, save=[0.3])
    return folder / "at-0.3.state"


def test_a_branch_with_other_gains_is_the_run_that_sets_them_then(small, tmp_path):
    gains = {
        "controller.teleoperation.damping": [35.0, 35.0, 0.2],
        "hand.damping": [2.0, 2.0, 0.002],
    }
    branch = hl.run(small, {**gains, "record.every": 1})
    begun = branch.run["resumed"]["time"]
    ports = {
        "controller.B_pc": gains["controller.teleoperation.damping"],
        "hand.damping": gains["hand.damping"],
    }
    set_then = [{"time": begun, "set": ports}]
    whole = hl.run("single-body", SMALL | {"at": SET + set_then, "record.every": 1})
    rows = whole.haptics["time"] >= begun
    for name in whole.haptics.columns:
        np.testing.assert_array_equal(branch.haptics[name], whole.haptics[name][rows])
    assert not np.array_equal(branch["haptic_device.x[1]"], hl.run(small)["haptic_device.x[1]"])


def test_another_hold_begins_with_the_newest_sample(small):
    lead, same = (hl.run(small, {"record.every": 1, "hold": h}) for h in ("lead", "zoh"))
    assert set(lead.run["holds"].values()) >= {"lead"}
    next_frame = lead.haptics["time"] < 0.4  # until then there is one sample, which both hold
    for name in same.haptics.columns:
        np.testing.assert_allclose(
            lead.haptics[name][next_frame], same.haptics[name][next_frame], rtol=1e-12
        )


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"duration": 0.2}, "the run ends at 0.195312 s, and its time is 0.3"),
        ({"graphics.rate": 32}, "its steps until then are others: leave it as it was"),
        ({"haptics.rate": 160}, "its rates are others"),
        ({"linkage.body.body.mass": 2.0}, "virtual_mechanism is another FMU"),
        ({"linkage.start": {"float": [0.01, 0.0, 0.0]}}, "is a fixed parameter, which a start"),
        ({"controller.topology": True}, "controller is another FMU: leave what it is made of"),
        ({"coupling": "jacobi"}, "coupling is another: leave it as it was"),
        ({"at": SET[:1]}, "[[at]] noise of 0.0001 on controller.x_D until 0.6 s, at 0.2 s, has"),
        ({"at.1.seed": 7}, "noise of 0.0001 on controller.x_D until 0.6 s, at 0.2 s, has acted"),
        ({"at": [*SET, {"time": 0.25, "set": {"hand.damping": [0.0, 0.0, 0.0]}}]}, "is past"),
        ({"controller.teleoperation.stiffness": [1.0] * 3}, "controller.K_pc[1] is set by [[at]],"),
        ({"delays": {"controller.Lambda_inv": 0.01}}, "in the state: leave hold, latency and kind"),
        ({"linkage.body.body.mass": 2.0}, "settings that differ: linkage.body.0.mass = 2.0 (1.0"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_by_name(small, options, why):
    with pytest.raises(InputFault) as refused:
        hl.run(small, options)
    assert why in str(refused.value)


def test_a_shorter_run_is_no_other_rate(small):
    """Its clocks stop before the state's, which is not said of them as well."""
    with pytest.raises(InputFault) as refused:
        hl.run(small, {"duration": 0.2})
    _, ends, differ = str(refused.value).splitlines()
    assert ends.strip().startswith("the run ends at")
    assert differ.strip() == "settings that differ: duration = 0.2 (0.8 in the state)"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda text: text[:-9] + "x" + text[-8:], "damaged, its checksum is another"),
        (lambda text: text[:-9] + "é" + text[-8:], "damaged, its checksum is another"),
        (lambda text: "title = 1", "no state of a run: give a file that `run --save` wrote"),
    ],
)
def test_a_file_that_is_no_state(small, tmp_path, change, why):
    path = tmp_path / "a.state"
    path.write_bytes(change(small.read_text()).encode("latin-1"))
    with pytest.raises(InputFault, match=why):
        hl.run(path)


def forge(state, folder, old, new):
    """The state with other content, and its checksum."""
    first, _, body = state.read_text().split("\n", 2)
    assert old in body
    body = body.replace(old, new)
    path = folder / "a.state"
    path.write_text(f"{first}\n{hashlib.sha256(body.encode()).hexdigest()}\n{body}")
    return path


@pytest.mark.parametrize("key", ["5", "null", '{"bytes": "YQ=="}', '{"tuple": [1, 2]}'])
def test_a_key_of_a_changed_scene_that_is_no_text_is_refused(small, tmp_path, key):
    with pytest.raises(SceneFault, match="is no Unicode text"):
        hl.run(forge(small, tmp_path, '["title", ', f'[{key}, {{"table": [[7, 1]]}}], ["title", '))


@pytest.mark.parametrize(
    "change",
    [
        ('"layout"', '"other"'),  # what reads the file misses it
        ('"guid"', '"other"'),  # what compares it with the scene
        ('"bounds"', '"other"'),  # what puts the run into it
        ('{"table": [', '{"table": 1, "rest": ['),
        ('"array": [', '"array": [1, '),
        ('{"table"', '"table"'),  # no JSON any more
        ('["rows", ', '["rows", 1], ["other", '),
        ('["balance", ', '["balance", {"tuple": []}], ["other", '),  # what is read much later
    ],
)
def test_content_that_was_changed_with_its_checksum_is_a_clear_error(small, tmp_path, change):
    path = forge(small, tmp_path, *change)
    try:
        found = hl.run(path).run["fault"]["message"]
    except InputFault as refused:
        found = str(refused)
    assert re.search(r"a\.state: changed since .* save the state again", found)


@pytest.mark.parametrize(
    ("save", "why"),
    [
        ([0.9], r"--save 0.9: give a time after 0 s, up to 0.75 s, from where on steps"),
        (["0"], "write a time"),
        (["often=1"], "write a time"),
        (["every=0"], "write a time"),
    ],
)
def test_a_time_at_which_nothing_can_be_saved(tmp_path, save, why):
    with pytest.raises(InputFault, match=why):
        hl.run("single-body", SMALL, out=tmp_path, save=save)


def test_a_state_of_another_scene_is_refused_with_what_differs(small):
    """Its FMUs lack some parameters of those of the same names."""
    with pytest.raises(InputFault, match=r"cannot go on from this state(.|\n)*is another FMU"):
        hl.run("serial", {"resume": str(small), "duration": 0.5})


def test_a_run_does_not_replace_what_it_goes_on_from(small):
    with pytest.raises(InputFault, match="has the state and the results before it"):
        hl.run(small, out=small.parent)


def test_fmus_that_cannot_save_are_named_before_the_run(tmp_path):
    python_fmu(tmp_path, "Gives")
    event_fmu3(tmp_path)
    equations_fmu(tmp_path)
    text = fmu_table("gives", "Gives") + fmu_table("also", "Gives")
    text += fmu_table("one", "events", ISOLATED) + fmu_table("solved", "equations")
    with pytest.raises(InputFault) as refused:
        hl.run(scene(tmp_path, text), out=tmp_path / "out", save=["end"])
    assert not (tmp_path / "out" / "run.json").exists()
    cannot = "cannot save its state (canGetAndSetFMUstate)"
    reasons = {"gives": cannot, "also": cannot, "one": "in a process of its own"}
    reasons["solved"] = "the history of its solver"
    for name, why in reasons.items():
        assert f"{name} (" in str(refused.value)
        assert why in str(refused.value)


def test_events_of_an_fmu_go_on(tmp_path):
    """Time events, and discrete inputs that are set in event mode where they have changed."""
    event_fmu3(tmp_path)
    text = fmu_table("one", "events", "start.u = 0.1\n") + fmu_table("other", "events")
    path = scene(tmp_path, text + wire_table("one.falls", "other.level", "factor = -1.0\n"))
    assert_goes_on(tmp_path, str(path), {"duration": 3.0}, "at-0.3.state")


class Wandering(Hold):
    """The newest sample and a random walk, with state of several kinds."""

    def __init__(self, context):
        self.context, self.drawn = context, np.random.default_rng(5)
        self.walk, self.seen = np.zeros(context.size), {"count": 0}

    def push(self, described, sample, arrival):
        self.seen["count"] += 1
        self.newest = (described, sample.copy())

    def value(self, tick, ahead=0.0):
        self.walk = self.walk + 1e-6 * self.drawn.standard_normal(self.context.size)
        return self.newest[1] + self.walk * self.seen["count"]


class Open(Wandering):
    def __init__(self, context):
        super().__init__(context)
        self.file = object()


@pytest.fixture
def plugins(monkeypatch):
    monkeypatch.setitem(HOLDS, "wandering", Wandering)
    monkeypatch.setitem(HOLDS, "open", Open)


def test_the_hold_of_a_plugin_goes_on(plugins, tmp_path):
    options = {"holds": {"virtual_environment.Lambda_inv": "wandering"}}
    assert_goes_on(tmp_path, "single-body", SMALL | options, "at-0.3.state")


def test_a_hold_whose_attributes_cannot_be_saved(plugins, tmp_path):
    options = {"holds": {"virtual_environment.Lambda_inv": "open"}}
    found = hl.run("single-body", SMALL | options, out=tmp_path / "out", save=[0.3])
    assert "hold 'open': file is a object, which cannot be saved" in found.fault
    assert not (tmp_path / "out" / "haptics.csv").read_text().splitlines()[1:]


def test_a_sweep_starts_all_its_points_from_one_state(small, tmp_path):
    found = hl.sweep(
        small, {"hand.damping": [[1.0, 1.0, 0.0], [3.0, 3.0, 0.0]]}, out=tmp_path, jobs=1
    )
    assert [row["end"] for row in found.rows] == ["duration"] * 2
    for row, damping in zip(found.rows, ([1.0, 1.0, 0.0], [3.0, 3.0, 0.0]), strict=True):
        alone = hl.run(small, {"hand.damping": damping})
        assert row["tracking_max_mm"] == alone.tracking().distance_mm.max()


def test_other_analyses_begin_at_the_start(small, tmp_path):
    for asked in (hl.stability, lambda s: hl.export(s, out=tmp_path / "a.ssp")):
        with pytest.raises(InputFault, match="runs and sweeps alone go on from a state"):
            asked(str(small))


def test_the_command(small, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    state = str(small)
    assert status("run", "--from", state, "--no-figures", "--out", "a") == 0
    said = capsys.readouterr().out
    assert f"goes on from {state}, at 0.304688 s" in said
    scene_too = ("--from", state, "--set", "duration=0.8", "--set", "haptics.rate=64")
    assert status("run", "single-body", *scene_too) == 2
    assert "the scene cannot go on from this state" in capsys.readouterr().err
    assert status("run") == 2
    with Path("a/haptics.csv").open() as file:
        assert float([*csv.reader(file)][1][0]) == 0.3046875  # the first third row from there on


@pytest.mark.parametrize("name", list_shipped())
def test_every_shipped_scene_goes_on_to_the_same_bytes(tmp_path, name):
    """From a time within its run, and from the end of a shorter one."""
    for state in ("at-0.3.state", "end.state"):
        assert_goes_on(tmp_path / state, name, {"duration": 0.8}, state)


@pytest.mark.parametrize("name", list_shipped())
def test_every_shipped_scene_branches_to_the_bytes_of_a_run_of_its_own(tmp_path, name):
    """A branch that is disturbed behind the state is the run that is disturbed then."""
    folders = [tmp_path / each for each in ("first", "whole", "branch")]
    first = hl.run(name, {"duration": 0.8}, out=folders[0], figures=False, save=[0.3])
    fed = {text.partition(" -> ")[2] for text in first.run["connections"]}
    port = next((p for p in ("controller.x_D", "hand.x", "wall.x") if p in fed), None)
    push = {"set": {"virtual_mechanism.F_drift": [0.05, 0.0, 0.0]}}
    own = hl.scene(name).source.tables.get("at", [])
    disturbed = {"at": [*own, {"time": 0.5, **({"noise": {port: 1e-5}} if port else push)}]}
    whole = hl.run(name, {"duration": 0.8, **disturbed}, out=folders[1], figures=False)
    branch = hl.run(folders[0] / "at-0.3.state", disturbed, out=folders[2], figures=False)
    for table in (f"{clock}.csv" for clock in whole.run["rates"]):
        lines = joined(folders[0], folders[2], table, branch.run["resumed"]["time"])
        assert lines == (folders[1] / table).read_text().splitlines()
    assert not np.array_equal(first["virtual_mechanism.x"], whole["virtual_mechanism.x"])


KILLED = 25


def test_a_run_that_is_killed_at_any_time_goes_on_from_its_last_state(tmp_path):
    """SIGKILL after a random time, once the first state is there, of a run that saves its state ten
    times a second."""
    whole, drawn, went_on = tmp_path / "whole", np.random.default_rng(46), 0
    options = ["--set", "duration=60", "--set", "packaging=native", "--set", "record.every=7"]
    assert process(*options, "--out", str(whole)).wait() == 0
    for attempt in range(4 * KILLED):
        if went_on == KILLED:
            break
        first, later = (tmp_path / f"{name}{attempt}" for name in ("first", "later"))
        running = process(*options, "--save", "every=0.1", "--out", str(first))
        state = first / "last.state"
        while running.poll() is None and not state.exists():
            time.sleep(0.001)
        time.sleep(float(drawn.uniform(0.0, 0.6)))
        running.kill()
        if running.wait() != -signal.SIGKILL:
            continue  # it had ended
        recover(first)
        found = hl.run(state, out=later, figures=False)
        assert found.fault is None
        for table in ("haptics.csv", "graphics.csv"):
            lines = joined(first, later, table, found.run["resumed"]["time"])
            assert lines == (whole / table).read_text().splitlines()
        went_on += 1
    assert went_on == KILLED


def process(*options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "hapticlink", "run", "closed-loop", "--no-figures", "--quiet"]
    return subprocess.Popen([*command, *options])
