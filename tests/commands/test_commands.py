"""The commands from outside: files, messages and exit statuses."""

import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import hapticlink as hl
from hapticlink.analysis.findings import summary
from hapticlink.commands.progress import progress, time_command, waiting
from hapticlink.fmus import durations
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import Fault, Interrupted
from hapticlink.orchestrator.results import read_results
from hapticlink.visualization.figures import run_figures
from tests.shared_fixtures import status


def test_a_mechanism_alone_runs_at_the_haptic_rate(
    bar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status("run", str(bar), "--out", str(tmp_path / "out")) == 0
    found = read_results.load(tmp_path / "out")
    time = np.arange(129) / 512
    np.testing.assert_array_equal(found.haptics["time"], time)
    x = found.haptics["virtual_mechanism.x"][:, 0]
    np.testing.assert_allclose(x, 0.5 * time, rtol=0, atol=1e-13)  # no force: uniform motion
    assert found.run["end"] == {"reason": "duration", "time": 0.25}
    assert found.run["energies"] == "none"
    assert found.run["fault"] is None
    assert imread(tmp_path / "out" / "mechanism.png").min() < 0.5  # ink on it
    assert "done at 0.25 s" in capsys.readouterr().out


def test_a_process_that_has_run_an_fmu_builds_whole_ones(bar: Path, tmp_path: Path) -> None:
    """Not with the modules that the first FMU has brought along, whose folder is gone."""
    hl.explain(bar)  # the FMU of the run is in the cache
    code = (
        "import sys, hapticlink as hl\n"
        "hl.run(sys.argv[1])\n"
        "hl.run(hl.export(sys.argv[1], {'duration': 0.0371}, out='bar.ssp'))"
    )
    subprocess.run([sys.executable, "-c", code, str(bar)], cwd=tmp_path, check=True)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_nothing_acts_on_the_terminal_but_the_bar(
    bar: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Escape codes in a title, a name, an option; and what a bar takes for its own codes."""
    bar.write_text(bar.read_text().replace("A bar", r"A bar [/b] \u001b[2J \u009b31m"))
    assert status("info", bar) == 0
    assert capsys.readouterr().out.startswith(r"A bar [/b] \x1b[2J \x9b31m at 0.5 m/s")
    assert status("run", bar, "--set", "du\x1b[31mration=1") == 2
    assert r"du\x1b[31mration: unknown key" in capsys.readouterr().err
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with progress("[/b] \x1b[2J", 1.0) as told:
        assert told
        told(0.5)
    assert r"[/b] \x1b[2J" in terminal.getvalue()


def test_info_names_rates_and_connections(capsys: pytest.CaptureFixture[str]) -> None:
    assert status("info", "closed-loop-ideal") == 0
    said = capsys.readouterr().out
    assert "ticks of 1/7680 s, gauss-seidel" in said
    assert "virtual_environment.Lambda_inv -> controller.Lambda_inv: 33.3 to 66.5, zoh" in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "no-such-scene"], "neither a file nor a shipped scene"),
        (
            ["run", "closed-loop-ideal", "--set", "controler.topology=false"],
            "did you mean 'controller'",
        ),
        (["run", "closed-loop-ideal", "--set", "holds.hand.G=zoh"], "is no connection of this"),
        (["run", "closed-loop-ideal", "--set", "stop_when=hand.G<0"], "there is no such output"),
        (["run", "closed-loop-ideal", "--bogus"], "Unknown option"),
        (["fly"], "Unknown command"),
        (["run", "pendulum", "--set", "title=\udcff"], r"'title=\udcff': no text"),
        (["build", "five-bar", "--all-platforms", "--out", "none"], "--set packaging=native"),
        (["new", "nowhere/crane"], "nowhere"),
        (["export-results", "runs/a", "--to", "mcap"], '.frame("haptics").to_parquet('),
        (
            ["advise", "closed-loop-ideal", "--draws=3"],
            "there are eight; --seed N gives eight others",
        ),
    ],
)
def test_bad_input_is_status_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status(*arguments) == 2
    assert message in " ".join("".join(capsys.readouterr()).split())


EQUATIONS = ("hapticlink.components.component", "hapticlink.fmus.python_fmu_entries", "scipy")


@pytest.mark.parametrize(
    ("line", "left"),
    [
        (("--help",), (*EQUATIONS, "casadi", "numpy", "pydantic", "fmpy", "matplotlib")),
        (("run", "--help"), (*EQUATIONS, "casadi", "numpy", "pydantic", "fmpy", "matplotlib")),
        (("view", "--help"), (*EQUATIONS, "casadi", "numpy", "pydantic", "fmpy", "matplotlib")),
        (("run", "{bar}", "--no-figures"), (*EQUATIONS, "matplotlib")),
        (("run", "{bar}"), ("scipy",)),
        (("info", "{bar}"), ("scipy", "matplotlib")),
    ],
)
def test_a_command_imports_what_it_uses(
    bar: Path, tmp_path: Path, line: tuple[str, ...], left: tuple[str, ...]
) -> None:
    """Where every FMU is in the cache."""
    hl.explain(bar)
    code = (
        "import sys\nfrom hapticlink.commands import main\n"
        "try:\n    main(sys.argv[2:])\nexcept SystemExit as ended:\n"
        "    assert not ended.code, ended.code\n"
        "print([m for m in sys.argv[1].split() if m in sys.modules])"
    )
    given = [part.format(bar=bar) for part in line]
    done = subprocess.run(
        [sys.executable, "-c", code, " ".join(left), *given],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == "[]"
    assert bool([*tmp_path.rglob("*.png")]) == (line == ("run", "{bar}"))


def test_a_signal_before_the_first_event_has_a_good_end(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run has taken no time then."""
    made = hl.run(bar, out=tmp_path, figures=False)
    made.run["timings"]["run"], made.run["end"] = 0.0, {"reason": "interrupted", "time": 0.0}
    vars(made).pop("record", None)  # read before the change

    def interrupted(*_: object, **__: object) -> None:
        raise hl.RunInterrupted(made)

    monkeypatch.setattr(hl, "run", interrupted)
    status("run", bar, "--out", tmp_path)
    assert "interrupted at 0 s" in capsys.readouterr().out


@pytest.mark.parametrize("error", [ZeroDivisionError("of length 0"), RecursionError(), KeyError(3)])
def test_an_error_of_ours_is_a_message_and_a_report(
    error: Exception,
    own_temporary_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def load(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(open_scene, "load", load)
    assert status("run", "pendulum") == 1
    said = capsys.readouterr().err
    (report,) = own_temporary_folder.glob("hapticlink-error-*.txt")
    assert said.splitlines()[0].startswith("hapticlink: an error of hapticlink itself")
    assert said.splitlines()[1] == f"  please report it, with {report}"
    text = report.read_text()
    assert "Traceback" in text
    assert "raise error" in text
    assert "$ " in text


RUN = f"{sys.executable} -m hapticlink run pendulum --set duration=0.01 --no-figures --out out"


@pytest.mark.skipif(os.name != "posix", reason="a shell's redirections")
@pytest.mark.parametrize(
    "closed", [">&-", "2>&-", "<&- >&- 2>&-", "--set isolate=true <&- >&- 2>&-"]
)
def test_a_closed_stream_is_no_fault(tmp_path: Path, closed: str) -> None:
    subprocess.run(f"{RUN} {closed}", shell=True, cwd=tmp_path, check=True)
    found = read_results.load(tmp_path / "out")
    assert found.run["end"]["reason"] == "duration"
    assert len(found.haptics["time"]) == 6


def test_letters_that_the_terminal_lacks_are_escaped(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "hapticlink", "info", "pendulum", "--set", "title=λ"],
        env=os.environ | {"PYTHONIOENCODING": "ascii"}, capture_output=True, check=False,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout[:7]) == (0, b"\\u03bb\n")


def test_a_long_command_tells_how_long_it_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    times = iter([0.0, 90.0, 0.0, 30.0, 0.0, 0.0])
    monkeypatch.setattr(durations, "monotonic", lambda: next(times))
    for _ in range(3):
        with time_command("bench it", "about 3 minutes"):
            pass
    told = re.findall("duration (.*)", capsys.readouterr().err)
    known = "up to 1.5 minutes here, less if partly finished before"
    assert told == ["about 3 minutes", known, known]


def test_an_interrupted_command_keeps_no_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    with pytest.raises(Fault, match="finished runs are kept"), time_command("bench it"):
        raise Interrupted
    with (
        pytest.raises(Interrupted, match=r"interrupted \(the user's port\)"),
        waiting("the user's port"),
    ):
        raise Interrupted
    assert not [*tmp_path.iterdir()]


def test_a_run_is_told_before_its_figures_are_drawn(
    bar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All but the names of its files, which are told when they are there; once each, as without
    figures. What is read by a program comes at once."""
    before: list[str] = []
    drawn = run_figures.files

    def files_of(results: read_results.Results, *formats: Any) -> Iterator[tuple[str, bytes]]:
        before.append(capsys.readouterr().out)
        return drawn(results, *formats)

    monkeypatch.setattr(run_figures, "files", files_of)
    assert status("run", bar, "--out", tmp_path / "a") == 0
    after = capsys.readouterr().out
    *told, files = summary.print_lines(made := hl.load(tmp_path / "a"), bar.stem)
    assert before.pop().splitlines() == told
    assert after.splitlines() == [files]
    assert {"plan.txt", "mechanism.png"} <= {*made.record.files}
    for quiet in ("--quiet", "--json"):
        assert status("run", bar, quiet, "--out", tmp_path / "a") == 0
        assert before.pop() == ""
        assert bool(capsys.readouterr().out) == (quiet == "--json")
    assert status("run", bar, "--no-figures", "--out", tmp_path / "b") == 0
    every = capsys.readouterr().out.splitlines()
    assert every == [*summary.print_lines(hl.load(tmp_path / "b"), bar.stem)]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX pipes")
def test_nobody_reads_what_a_run_says_before_its_figures(bar: Path, tmp_path: Path) -> None:
    """The reader has closed the pipe: the command ends in good order, and blames no disk."""
    command = f"{sys.executable} -m hapticlink run {bar} --out {tmp_path / 'out'} | true"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert hl.load(tmp_path / "out").fault is None
