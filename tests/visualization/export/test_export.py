"""A run that is exported has the numbers of its tables, and the lines of its drawing."""

from __future__ import annotations

import json
import re
import sys
import tracemalloc
from collections import defaultdict
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import mcap.writer
import numpy as np
import pytest
from matplotlib.figure import Figure
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from pyarrow import parquet

import hapticlink as hl
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.results import windows
from hapticlink.orchestrator.results.read_results import Results, Table
from hapticlink.visualization.mechanism import drawing
from hapticlink.visualization.replay.recorded_frames import Recorded
from tests.shared_fixtures import status

Messages = dict[str, list[tuple[int, Any]]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that its device's workspace ends before its time."""
    out = tmp_path_factory.mktemp("runs") / "run"
    options = {"graphics.rate": 10, "controller.topology": False}
    ended = hl.run("closed-loop", options, out=out, figures=False)
    assert ended.run["end"]["time"] < 3
    return out


def messages(path: Path) -> Messages:
    """By topic, times (ns) and messages."""
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            found[channel.topic].append((message.log_time, decoded))
    return found


def undecoded(path: Path) -> list[tuple[str, int, bytes]]:
    """Topic, time (ns) and bytes of each message."""
    with path.open("rb") as file:
        read = make_reader(file).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in read]


def bits(values: Any) -> bytes:
    return np.ascontiguousarray(values, float).tobytes()


def test_parquet_has_the_bits_units_and_settings_of_the_run(folder: Path) -> None:
    run = hl.load(folder)
    assert status("export-results", folder, "--to", "parquet") == 0
    for name in ("haptics", "graphics"):
        read = parquet.read_table(folder / f"{name}.parquet")
        assert tuple(read.column_names) == run.tables[name].columns
        assert bits(np.column_stack([*map(np.asarray, read)])) == bits(run.tables[name].rows)
        units = {f.name: (f.metadata or {}).get(b"unit", b"").decode() for f in read.schema}
        if name == "haptics":
            assert [units[f"haptic_device.x[{i}]"] for i in (1, 2, 3)] == ["m", "m", "rad"]
            assert (units["time"], units["virtual_mechanism.energy"]) == ("s", "J")
        settings = json.loads(read.schema.metadata[b"hapticlink"])
        assert settings["scene"]["graphics"]["rate"] == 10
    listed = json.loads((folder / "run.json").read_text())["files"]
    assert {"haptics.parquet", "graphics.parquet"} <= {*listed}


def test_mcap_has_the_bits_of_the_tables_at_the_ticks_of_the_run(
    folder: Path, tmp_path: Path
) -> None:
    run = hl.load(folder)
    assert status("export-results", folder, "--to", "mcap", "--out", tmp_path) == 0
    found = messages(tmp_path / "run.mcap")
    assert {"/hand", "/controller", "/virtual_environment"} <= {*found}
    for fmu, fields in {
        "virtual_mechanism": ("q", "lambda", "energy"),
        "haptic_device": ("M", "x_true"),
        "virtual_environment": ("Lambda_inv", "branch_ok"),
    }.items():
        time = run.time(f"{fmu}.{fields[0]}")
        assert bits([m.time for _, m in found[f"/{fmu}"]]) == bits(time)
        exact = [Fraction(round(t * 5120), 5120) * 10**9 for t in time]  # 512 and 10 Hz
        assert all(abs(ns - t) <= Fraction(1, 2) for (ns, _), t in zip(
            found[f"/{fmu}"], exact, strict=True))  # fmt: skip
        for field in fields:
            values = [getattr(m, field) for _, m in found[f"/{fmu}"]]
            assert bits(values) == bits(run[f"{fmu}.{field}"])
    port = user_port(run)
    assert port
    energies = [m.generated for _, m in found["/energy/user_port"]]
    assert bits(energies) == bits(port.generated_J)
    handles = [(m.pose.position.x, m.pose.position.y) for _, m in found["/scene/handle"]]
    every = -(-len(run.time("haptic_device.x")) // len(handles))
    assert bits(handles) == bits(run["haptic_device.x_true"][::every, :2])


def test_units_and_settings_are_in_the_mcap(folder: Path, tmp_path: Path) -> None:
    (path,) = hl.export_results(folder, to="mcap", out=tmp_path)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        (attached,) = reader.iter_attachments()
    assert summary
    about = {channel.topic: channel.metadata for channel in summary.channels.values()}
    assert about["/haptic_device"]["x"] == "haptic_device.x [m, m, rad]"
    assert about["/energy/user_port"]["generated"] == "generated [J]"
    assert (
        json.loads(attached.data)["scene"] == json.loads((folder / "run.json").read_text())["scene"]
    )


@pytest.mark.parametrize("scene", ["closed-loop", "trammel", "quick-return"])
def test_the_lines_of_the_scene_are_those_of_the_drawing(scene: str, tmp_path: Path) -> None:
    run = hl.run(scene, {"duration": 0.1})
    (path,) = hl.export_results(run, to="mcap", out=tmp_path)
    (*_, (ns, last)) = messages(path)["/scene/mechanism"]
    recorded = Recorded(run)
    frame = recorded.frames()[int(np.abs(recorded.times * 1e9 - ns).argmin())]
    axes = Figure().subplots()
    ended = [mark for mark in recorded.picture.marks if mark.kind != "directions"]
    drawing.paint(axes, ended, frame)
    painted = {tuple(np.round(line.get_xydata().ravel() / 1e3, 9))
               for line in axes.lines if len(line.get_xydata()) > 1}  # fmt: skip
    painted |= {tuple(np.round(p.get_path().vertices[:-1].ravel() / 1e3, 9))
                for p in axes.patches if len(p.get_path().vertices) < 50}  # fmt: skip
    (entity,) = last.entities
    lines = {tuple(np.round([c for p in line.points for c in (p.x, p.y)], 9))
             for line in entity.lines}  # fmt: skip
    closed = {line[:-2] for line in lines}
    assert len(painted) >= 4
    assert painted <= lines | closed


def test_what_is_no_number_and_names_that_are_no_identifiers_are_kept(tmp_path: Path) -> None:
    run = hl.run("pendulum", {"duration": 0.02})
    columns = ("time", "a.b c", "a.b_c", "a.time", "a.1", "a.m[2]", "a.m[1]")
    rows = np.array([[0.0, np.nan, -np.inf, -0.0, 5e-324, 1 / 3, 2.0]])
    changed = Results(None, run.run, {"haptics": Table(columns, rows)})
    (path,) = hl.export_results(changed, to="mcap", out=tmp_path)
    ((_, message),) = messages(path)["/a"]
    values = [message.time, message.b_c, message.b_c_, message.time_, message._1]
    assert bits([*values, *message.m]) == bits(rows[0, [0, 1, 2, 3, 4, 6, 5]])


def test_a_run_without_poses_is_exported_without_the_mechanism(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kept = {"duration": 0.05, "record.signals": ["virtual_mechanism.energy"]}
    (path,) = hl.export_results(hl.run("pendulum", kept), to="mcap", out=tmp_path)
    assert [*messages(path)] == ["/virtual_mechanism"]
    assert "virtual_mechanism.q is not recorded" in caplog.text


def long(folder: Path, times: int) -> Path:
    """The folder of a run whose rows follow each other several times."""
    hl.run("pendulum", {"duration": 0.25}, out=folder, figures=False)
    table = hl.load(folder).haptics
    part, (header, *_) = table.rows[1:], (folder / "haptics.csv").read_text().splitlines()
    shifts = [np.concatenate([[i * 0.25], np.zeros(part.shape[1] - 1)]) for i in range(times)]
    rows = np.vstack([table.rows[:1], *(part + shift for shift in shifts)])
    np.savetxt(folder / "haptics.csv", rows, "%.17g", ",", header=header, comments="")
    run = json.loads((folder / "run.json").read_text())
    run["end"]["time"] = 0.25 * times
    (folder / "run.json").write_text(json.dumps(run))
    return folder


@pytest.mark.parametrize("to", ["parquet", "mcap"])
def test_windows_give_the_same_and_memory_stays_flat(
    to: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = {times: long(tmp_path / str(times), times) for times in (16, 64)}
    hl.export_results(folders[16], to=to, out=tmp_path / "whole")
    monkeypatch.setattr(windows, "WINDOW_BYTES", 10_000)
    monkeypatch.setattr(mcap.writer, "Writer", partial(mcap.writer.Writer, chunk_size=2**16))
    monkeypatch.setattr(text_files, "LARGEST_JSON", 1 << 16)  # as much memory as that

    def peak(times: int) -> int:
        tracemalloc.start()
        try:
            hl.export_results(folders[times], to=to, out=tmp_path / "windows")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    first = peak(16)
    if to == "mcap":
        whole, parts = (undecoded(tmp_path / each / "run.mcap") for each in ("whole", "windows"))
        assert parts == whole
    else:
        paths = [tmp_path / each / "haptics.parquet" for each in ("whole", "windows")]
        assert parquet.read_table(paths[0]).equals(parquet.read_table(paths[1]))
        assert parquet.ParquetFile(paths[1]).num_row_groups > 2
    rows = hl.load(folders[64]).haptics.rows
    assert peak(64) - first < rows.nbytes / 4


def test_a_missing_extra_and_results_without_a_folder_say_what_to_do(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(hl.InputFault, match="the results are in memory: name a folder"):
        hl.export_results(hl.run("pendulum", {"duration": 0.02}), to="parquet")
    with pytest.raises(hl.InputFault, match="not the folder of a run"):
        hl.export_results(tmp_path, to="mcap")
    for to, name in (("parquet", "pyarrow"), ("mcap", "mcap.writer")):
        monkeypatch.setitem(sys.modules, name, None)
        hint = f"--to {to} needs {name}: {install_command('export')}"
        with pytest.raises(hl.InputFault, match=re.escape(hint)):
            hl.export_results(folder, to=to, out=tmp_path)  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]
