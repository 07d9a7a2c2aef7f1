"""Results of an earlier run that are no files, or have no end: a run replaces them, and what reads
them refuses them at once."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.results.recover import recover
from tests.shared_fixtures import status

resource = pytest.importorskip("resource")


def replaced(name: str, *, by: str = "", gone: str = "") -> Callable[[Path], object]:
    """A file that a link takes the place of, or a pipe."""

    def spoil(out: Path) -> None:
        (out / (gone or name)).unlink()
        (out / name).symlink_to(by) if by else os.mkfifo(out / name)

    return spoil


def brackets(out: Path) -> None:
    (out / "run.json").write_text("[" * 100_000)


def folder_in_the_list(out: Path) -> None:
    (out / "kept").mkdir()
    story = json.loads((out / "run.json").read_text())
    story["files"] += ["kept", "..", "/etc/passwd", 7, "no\0name"]
    (out / "run.json").write_text(json.dumps(story))


def one_line(out: Path) -> None:
    (out / "haptics.csv").unlink()
    (out / "haptics.rows").write_text("x" * 2_000_000)


def folder_as_story(out: Path) -> None:
    (out / "run.json").unlink()
    (out / "run.json").mkdir()


fifo, endless_story = replaced("run.json"), replaced("run.json", by="/dev/zero")
endless = replaced("haptics.csv", by="/dev/zero")
endless_rows = replaced("haptics.rows", by="/dev/zero", gone="haptics.csv")


@pytest.fixture
def out(tmp_path):
    hl.run("pendulum", {"duration": 0.05}, out=tmp_path / "out", figures=False)
    return tmp_path / "out"


@pytest.mark.parametrize("spoil", [fifo, endless, brackets, folder_in_the_list, endless_story])
def test_a_run_replaces_them(out, spoil):
    spoil(out)
    assert status("run", "pendulum", "--set", "duration=0.1", "--out", out, "--no-figures") == 0
    assert read_results.load(out).haptics["time"][-1] == pytest.approx(0.1, abs=2e-3)


def test_a_folder_in_the_place_of_run_json_is_told(out, capsys):
    folder_as_story(out)
    assert status("run", "pendulum", "--out", out, "--no-figures") == 1
    assert capsys.readouterr().err == f"hapticlink: {out}/run.json: Is a directory\n"


@pytest.mark.parametrize(
    "spoil", [fifo, endless, endless_rows, one_line, brackets, folder_as_story, endless_story]
)
def test_what_reads_them_refuses_them(out, spoil):
    spoil(out)
    for read in (read_results.load, hl.load):
        with pytest.raises(InputFault, match=str(out)):
            read(out)
    for command in ("report", "compare", "view", "recover"):
        arguments = [command, out, *([out] if command == "compare" else [])]
        assert status(*arguments) == 2 or (spoil is endless and command == "recover")
    if spoil is not endless:
        with pytest.raises(InputFault):
            recover(out)


def test_rows_that_are_a_pipe_beside_a_table_hang_nothing(out):
    os.mkfifo(out / "haptics.rows")
    assert recover(out) == {}
    assert status("recover", out) == 0
