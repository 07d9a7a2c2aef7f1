"""Default folders, --json, --quiet, completion, `new` and `doctor`, from outside."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.commands import completion, options
from tests.plugins import hapticlink
from tests.shared_fixtures import status


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ((), "bar"),
        (("graphics.rate=10", "hold=foh"), "bar,graphics.rate=10,hold=foh"),
        (("hand.wrench=[1.0, -2.0]",), "bar,hand.wrench=1.0,-2.0"),
    ],
)
def test_the_default_folder_names_the_options(given: tuple[str, ...], name: str) -> None:
    assert options.default_folder("runs", "some/bar.toml", given) == Path("runs") / name


def test_options_of_other_characters_have_folders_of_their_own() -> None:
    one, other = (options.default_folder("runs", "bar", [f"title={c}"]) for c in "/\\")
    assert one != other
    assert one.parent == Path("runs")
    apart, joined = (options.default_folder("runs", "bar", [f"title={t}"]) for t in ("a b", "ab"))
    assert apart != joined
    long = options.default_folder("runs", "bar", ["title=" + "x" * 1000])
    assert len(long.name) < 200


def test_a_run_does_not_replace_one_of_other_options(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for rate in ((), ("--set", "haptics.rate=256")):
        assert status("run", str(bar), "--no-figures", *rate) == 0
    found = {p.name: json.loads((p / "run.json").read_text()) for p in Path("runs").iterdir()}
    rates = {name: run["scene"]["haptics"]["rate"] for name, run in found.items()}
    assert rates == {bar.stem: 512, f"{bar.stem},haptics.rate=256": 256}


def test_json_is_the_whole_output(
    bar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status("run", str(bar), "--no-figures", "--json", "--out", str(tmp_path / "run")) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(
        (tmp_path / "run/run.json").read_text()
    )


def test_quiet_says_warnings_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ("--no-figures", "--quiet", "--out", str(tmp_path / "run"), "--set", "duration=0.1")
    assert status("run", "five-bar", *given) == 0
    assert capsys.readouterr() == ("", "")
    assert status("run", "five-bar", *given, "--set", "record.signals=none") == 0
    told = capsys.readouterr()
    assert told.out == ""
    assert "not recorded" in told.err


def test_a_new_scene_runs_and_is_not_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert status("new", "crane") == 0
    assert status("run", "crane.toml", "--no-figures") == 0
    run = hl.load("runs/crane")
    assert run.run["end"] == {"reason": "duration", "time": 2.0}
    assert run.run["warnings"] == []
    Path("crane.toml").write_text("mine")
    assert status("new", "crane.toml") == 2
    assert Path("crane.toml").read_text() == "mine"
    assert "crane.toml exists" in capsys.readouterr().err
    assert status("new", "nowhere/crane") == 2


def test_completion_knows_scenes_and_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text("")
    assert {"closed-loop-ideal", "mine.toml"} <= set(completion.scenes())
    keys = completion.keys()
    assert {"graphics.rate=", "controller.topology.stiffness=", "hand.wrench="} <= set(keys)
    assert len(set(keys)) == len(keys)
    assert status("__complete", "run", "closed-loop-ideal", "--set", "haptics.") == 0
    assert "haptics.rate=" in capsys.readouterr().out


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_the_name_of_a_scene(tmp_path: Path) -> None:
    """The script as it is installed, called as bash calls it where TAB is pressed."""
    called = [sys.executable, "-m", "hapticlink", "--install-completion"]
    (tmp_path / "hapticlink").write_text(f'#!/bin/sh\nexec {shlex.join(called[:3])} "$@"\n')
    (tmp_path / "hapticlink").chmod(0o755)
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "HOME": str(tmp_path), "PATH": path}
    subprocess.run([*called, "--shell", "bash"], env=environment, check=True, capture_output=True)
    assert not (tmp_path / ".bashrc").exists()  # nobody has asked for a change of it
    pressed = """. ~/.local/share/bash-completion/completions/hapticlink
    COMP_WORDS=(hapticlink run clo) COMP_CWORD=2 COMP_LINE="hapticlink run clo" COMP_POINT=18
    _hapticlink; echo "${COMPREPLY[@]}" """
    told = subprocess.run(
        ["bash", "--norc", "-c", pressed],
        env=environment, check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert "closed-loop-ideal" in told.stdout.split()


def test_the_doctor_builds_and_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert status("doctor", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["runs"]["python"] == "works"
    assert found["versions"]["casadi"]
    assert "websockets" in found["extras"]["view"]
    assert None not in found["versions"].values()


@pytest.mark.parametrize("command", ["run", "sweep", "stability"])
def test_help_has_examples(command: str, tmp_path: Path) -> None:
    told = hapticlink(tmp_path, f"hapticlink {command} --help")[0].said
    assert f"hapticlink {command} " in told.partition("For example:")[2]
    assert "\x1b" not in told  # no colours where it is no terminal
