"""Runs from Python, in memory and in a folder, compared with those of the command."""

import json
import os
import re
import signal
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.tracking import Tracking
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Directions, Linkage, Mechanism
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.results.recorded_scene import scene_part
from hapticlink.visualization.figures import run_figures
from tests.shared_fixtures import sets, status

SHORT = {"duration": 0.1, "graphics.rate": 40}
FAR = {"linkage.start_velocity.slide": 1e308, "linkage.start.slide": 1.7e308}
"""A pose that is finite, and overflows after some steps."""


@pytest.fixture(scope="module")
def short() -> hl.Run:
    return hl.run("closed-loop-ideal", SHORT)


def same(one: hl.Run, two: hl.Run) -> bool:
    tables = zip(one.tables.items(), two.tables.items(), strict=True)
    return all(
        a == b and s.columns == t.columns and np.array_equal(s.rows, t.rows)
        for (a, s), (b, t) in tables
    )


def test_a_run_is_the_same_in_memory_in_a_folder_and_by_the_command(
    tmp_path: Path, emptied_temporary_folder: Path
) -> None:
    memory = hl.run("closed-loop-ideal", SHORT)
    assert memory.folder is None
    assert not list(emptied_temporary_folder.iterdir())
    folder = hl.run("closed-loop-ideal", SHORT, out=tmp_path / "api")
    options = sets(f"{key}={value}" for key, value in SHORT.items())
    assert status("run", "closed-loop-ideal", *options, "--out", tmp_path / "command") == 0
    command = hl.load(tmp_path / "command")
    assert same(memory, folder)
    assert same(memory, command)
    assert same(memory, hl.load(str(tmp_path / "api")))
    assert folder.run == hl.load(tmp_path / "api").run
    for key in ("scene", "options", "files", "holds", "end", "stop_when"):
        assert folder.run[key] == command.run[key]
    assert set(folder.run["files"]) == {p.name for p in (tmp_path / "api").iterdir()}
    assert folder.run["options"] == ["duration=0.1", "graphics.rate=40"]


def test_what_is_known_of_a_run_is_what_is_read_from_its_folder(tmp_path: Path) -> None:
    """Its record and the parts of its scene, of which summary and figures are made."""
    ran = hl.run("enclosure", SHORT, out=tmp_path, figures=False)
    read = hl.load(tmp_path)
    assert ran.known_scene
    assert not read.known_scene
    assert ran.record == read.record
    parts = {"linkage": Linkage, "mechanism": Mechanism, "directions": Directions}
    for name, kind in (parts | {"device": Device, "contacts": Contacts}).items():
        assert scene_part(ran, name, kind) == scene_part(read, name, kind)


@pytest.mark.parametrize("scene", ["bar", "closed-loop-ideal"])
def test_a_long_run_reads_no_table_back_and_tells_the_same(
    scene: str,
    bar: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A run whose tables stay in their files: its lines, run.json and figures, without a CSV that
    is read. That of a bar has no numbers."""
    told, runs = [], []
    given = (bar,) if scene == "bar" else (scene, *sets(["duration=0.06"]))
    for name, size in (("short", 1 << 24), ("long", 2000)):
        monkeypatch.setattr("hapticlink.orchestrator.results.read_results.IN_MEMORY", size)
        monkeypatch.setattr("numpy.loadtxt", lambda *_, **__: pytest.fail("a CSV was read"))
        assert status("run", *given, "--out", tmp_path / name) == 0
        said = capsys.readouterr().out.replace(f"/{name}", "")
        told.append([line for line in said.splitlines() if "run time" not in line])
        runs.append(json.loads((tmp_path / name / "run.json").read_text()))
        del runs[-1]["timings"]
    assert told[0] == told[1]
    assert runs[0] == runs[1]
    monkeypatch.undo()
    short, long = (hl.load(tmp_path / name) for name in ("short", "long"))
    assert same(short, long)
    assert {p.name for p in (tmp_path / "long").iterdir()} == {*long.run["files"]}


def test_options_of_a_scene_object_act(bar: Path) -> None:
    scene = hl.scene(bar, {"haptics.rate": 128})
    ended = hl.run(scene, {"duration": 0.125})
    assert len(ended.haptics["time"]) == 17
    assert ended.run["options"] == ["haptics.rate=128", "duration=0.125"]
    assert ended.run["scene"]["duration"] == 0.125


def test_signals_go_by_name_each_with_its_times(short: hl.Run) -> None:
    found = short
    assert list(found) == ["haptics", "graphics"]
    for name, rate, shape in (
        ("haptic_device.M", "haptics", (3, 3)),
        ("virtual_environment.x", "graphics", (3,)),
        ("virtual_environment.x[2]", "graphics", ()),
    ):
        assert name in found
        times = found.time(name)
        assert np.array_equal(times, found[rate]["time"])
        assert np.array_equal(found[name], found[rate][name])
        assert found[name].shape == (len(times), *shape)
        assert np.array_equal(found.time(rate), times)
    assert "virtual_environment.y" not in found
    with pytest.raises(KeyError, match=r"did you mean 'virtual_environment\.x'"):
        found["virtual_environment.y"]
    for ambiguous in (lambda: found["time"], lambda: found.time("time")):
        with pytest.raises(KeyError, match="no rate or signal 'time'"):
            ambiguous()
    assert repr(found).splitlines()[0].endswith(": done at 0.0996094 s")
    assert "4 rows of time, virtual_environment.x" in repr(found)


def test_print_gives_the_lines_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        status(
            "run", "closed-loop-ideal", *sets(["duration=0.1"]), "--no-figures", "--out", tmp_path
        )
        == 0
    )
    name, said = capsys.readouterr().out.partition(":")[::2]
    found = hl.load(tmp_path)
    assert name == "closed-loop-ideal"
    assert f"{found}\n" == f"{found.run['scene']['title']}:{said}"


def test_a_scene_is_four_lines() -> None:
    lines = repr(hl.scene("closed-loop-ideal", {"graphics.rate": 15})).splitlines()
    assert len(lines) == 4
    assert "4 bodies, 1 closed loops" in lines[1]
    assert "graphics at 15 Hz" in lines[2]


def test_runs_in_memory_are_named_by_the_settings_in_which_they_differ() -> None:
    scene = hl.scene("closed-loop-direct", {"duration": 0.1})
    found = hl.compare([hl.run(scene, {"hold": hold}) for hold in ("zoh", "foh")])
    assert [*found.runs] == ["hold zoh", "hold foh"]
    told = found.values()["hold foh"]
    assert told["Settings that differ"] == {"hold": "foh"}
    assert [line.get_label() for line in found.figures()["distance"].axes[0].lines]
    with pytest.raises(hl.InputFault, match="two runs or more"):
        hl.compare([found.runs["hold foh"]])


def test_tracking_is_what_lies_between_the_two_poses(short: hl.Run) -> None:
    error = short["virtual_mechanism.x"] - short["haptic_device.x_true"]
    time, distance, angle = short.tracking()
    assert np.array_equal(time, short.time("haptics"))
    np.testing.assert_allclose(distance, 1e3 * np.linalg.norm(error[:, :2], axis=1), rtol=1e-12)
    np.testing.assert_allclose(angle, np.abs(error[:, 2]), rtol=0, atol=1e-15)
    line = short.figures()["distance"].axes[0].lines[0]
    assert np.array_equal(line.get_ydata(), distance)


def test_measures_are_those_of_the_samples_until_a_time(short: hl.Run) -> None:
    time, distance, angle = short.tracking()
    for measures, count in ((short.measures(), len(time)), (short.measures(time[9]), 10)):
        error = measures.tracking[""]
        assert error.max_mm == distance[:count].max()
        assert error.rms_mm == pytest.approx(np.sqrt(np.mean(distance[:count] ** 2)), rel=1e-14)
        assert error.max_rad == angle[:count].max()
        assert error.end_s == time[count - 1]
        force = np.hypot(*short["controller.F_drift"][:count, :2].T)
        assert measures.forces["virtual coupling, F_drift"] == force.max()
        assert measures.closure_m == short["virtual_mechanism.closure_error"][:count].max()
    counts = measures.constrained
    assert counts
    frames = short["virtual_environment.n_constraints"]
    frames = frames[short.time("virtual_environment.n_constraints") <= time[9]]
    assert counts.samples == {n: np.count_nonzero(frames == n) for n in {*frames}}
    assert measures.port
    assert asdict(measures.port) == short.run["user_port"]


def test_a_frame_is_the_table_over_its_times(short: hl.Run) -> None:
    pandas = pytest.importorskip("pandas")
    found = short
    frame = found.frame("graphics")
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "time"
    assert np.array_equal(frame.index, found.time("graphics"))
    assert list(frame.columns) == [c for c in found.graphics.columns if c != "time"]
    name = "virtual_environment.Lambda_inv[2,3]"
    assert np.array_equal(frame[name], found[name])
    with pytest.raises(KeyError, match="there are haptics, graphics"):
        found.frame("hand.F")
    with pytest.raises(KeyError, match="name one of the rates: haptics, graphics"):
        found.frame()


def test_a_frame_of_the_only_rate_needs_no_name(bar: Path) -> None:
    pytest.importorskip("pandas")
    assert hl.run(bar).frame().equals(hl.run(bar).frame("haptics"))


def test_a_tracking_error_shows_its_largest_and_its_root_mean_square() -> None:
    found = Tracking(np.array([0.0, 1.0]), np.array([3.0, 4.0]), np.array([0.5, 0.0]))
    assert repr(found).splitlines() == [
        "distance (mm): 4 at most, at 1 s, 3.536 RMS",
        "angle (rad): 0.5 at most, at 0 s, 0.3536 RMS",
    ]
    cells = ET.fromstring(found._repr_html_()).findall(".//td")
    assert [cell.text for cell in cells[:4]] == ["distance (mm)", "4", "1", "3.536"]
    none = np.array([])
    assert repr(Tracking(none, none, none)) == "no samples"


def test_without_pandas_a_frame_says_what_to_install(
    bar: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(hl.InputFault, match=re.escape(install_command("pandas"))):
        hl.run(bar).frame("haptics")


def test_a_fault_of_the_run_is_told_with_its_results(bar: Path, tmp_path: Path) -> None:
    for out in (None, tmp_path):
        lost = hl.run(bar, FAR, out=out, figures=False)
        assert lost.fault is not None
        assert lost.fault.startswith("virtual_mechanism: ")
        assert lost.fault in repr(lost)
        assert lost.run["fault"]["kind"] == "FmuFault"
    assert hl.load(tmp_path).fault == lost.fault
    assert hl.run(bar).fault is None


def test_a_start_outside_of_the_workspace_is_a_fault_before_the_first_step() -> None:
    far = {"linkage.operational_point": {"body": "link2", "at": [0.9, 0.0]}}
    lost = hl.run("closed-loop-ideal", far)
    said = "haptic_device: the start pose (x m, y m, theta rad) = (0.66"
    assert str(lost.fault).startswith(said)
    assert "outside the device's workspace, or too far" in str(lost.fault)
    assert [len(part) for part in lost.tracking()] == [1, 1, 1]
    assert lost.figures() == {}
    (row,) = hl.sweep("closed-loop-ideal", {"duration": [0.1]}, far, jobs=1).rows
    assert row["end"] == "fault"
    assert "outside the device's workspace" in row["message"]


def test_what_a_killed_run_has_written_can_be_looked_at(bar: Path, tmp_path: Path) -> None:
    whole = hl.run(bar, out=tmp_path, figures=False)
    run = tmp_path / "run.json"
    begin, _, _ = run.read_text().partition('  "end": {')
    run.write_text(begin + '  "end": {"reason": "running"}\n}\n')
    found = hl.load(tmp_path)
    assert same(found, whole)
    assert "not ended" in repr(found)
    axes = found.figures()["mechanism"].axes[0]
    assert "until the last row so far at 0.25\xa0s" in axes.get_title().replace("\n", " ")


def test_a_folder_without_a_table_of_its_run_is_refused(bar: Path, tmp_path: Path) -> None:
    hl.run(bar, out=tmp_path, figures=False)
    (tmp_path / "haptics.csv").unlink()
    with pytest.raises(hl.InputFault, match=r"haptics\.csv"):
        hl.load(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("out", ["folder", None])
def test_ctrl_c_raises_with_the_results_so_far(out: str | None, tmp_path: Path) -> None:
    told: list[float] = []

    def interrupt(time: float) -> None:
        if not told and time > 0.5:
            told.append(time)
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(hl.RunInterrupted, match=r"interrupted at t = \d") as ended:
        hl.run("five-bar", {"duration": 60.0}, progress=interrupt, out=out and tmp_path / out)
    found = ended.value.run
    assert found.time("haptics")[-1] == pytest.approx(told[0], abs=2 / 512)
    assert found.run["end"]["reason"] == "interrupted"
    assert (found.folder is None) == (out is None)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_while_figures_are_drawn_says_so(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn = run_figures.files

    def interrupted(found: hl.Run, formats: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        os.kill(os.getpid(), signal.SIGINT)
        return drawn(found, formats)

    monkeypatch.setattr(run_figures, "files", interrupted)
    assert status("run", bar, "--out", tmp_path) == 1
    assert "has the results of the run, not all of its figures" in capsys.readouterr().err
    assert hl.load(tmp_path).run["end"]["reason"] == "duration"
    with pytest.raises(hl.Fault, match="not all of its figures"):
        hl.run(bar, out=tmp_path)


def test_what_a_run_warns_of_stands_in_run_json(tmp_path: Path) -> None:
    """A pulled graphics copy at 10 Hz folds; one that follows exactly does not."""
    options = {"graphics.rate": 10, "duration": 2.0}
    pulled = {**options, "graphics.sync": "operational"}
    memory, folder = (
        hl.run("closed-loop-ideal", pulled, out=out, figures=False) for out in (None, tmp_path)
    )
    (warning,) = memory.run["warnings"]
    off = int((memory["virtual_environment.branch_ok"] == 0).sum())
    assert off > 0
    assert warning.startswith(f"warning: the graphics copy was folded in {off} of ")
    assert folder.run["warnings"] == hl.load(tmp_path).run["warnings"] == [warning]
    assert hl.run("closed-loop-ideal", options).run["warnings"] == []


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_a_disk_that_is_full_for_the_figures_keeps_the_run(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object) -> list[str]:
        with open("/dev/full", "wb", buffering=0) as file:
            file.write(b"a figure")
        return []

    monkeypatch.setattr("hapticlink.visualization.figure_files.write", full)
    made = hl.run(bar, out=tmp_path)
    assert made.fault is None
    assert "No space left on device" in caplog.text
    assert hl.load(tmp_path).run["end"]["reason"] == "duration"


def test_after_ctrl_c_no_handler_of_exceptions_goes_on():
    """As of a loop over runs that shall survive one that fails, and of a progress of one's own."""
    runs, signals = [], [signal.SIGINT]

    def progress(time: float) -> None:
        if time > 0.0 and signals:
            signal.raise_signal(signals.pop())

    def loop() -> None:
        for _ in range(3):
            try:
                runs.append(hl.run("pendulum", {"duration": 60}, progress=progress))
            except Exception as error:
                runs.append(error)

    with pytest.raises(KeyboardInterrupt, match="interrupted at t = "):
        loop()
    assert not runs
