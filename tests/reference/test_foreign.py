"""The short form of `hapticlink bench foreign`, with FMUs that pythonfmu and pythonfmu3 build, the
package's archives among them, and without a network."""

import dataclasses
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest

from benchmarks import foreign, foreign_packages
from benchmarks.foreign_packages import find_fmus
from benchmarks.foreign_runs import Case, choose_experiment, choose_inputs, compare
from benchmarks.rows import Rows
from tests.little_fmus import edited, python_fmu, python_fmu_of
from tests.orchestrator.c_fmus import equations_fmu

LAG = "self.y += size * (self.u + self.gain - self.y)"
LAG3 = """
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Float64

class Lag3(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.u, self.y = 0.0, 0.5, 0.0
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        self.register_variable(Float64("u", causality=Fmi3Causality.input))
        self.register_variable(Float64("y", causality=Fmi3Causality.output))

    def do_step(self, time, size):
        self.y += size * (self.u - self.y)
        return True
"""


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_both_tools_give_the_same_bits_with_an_input_that_changes(tmp_path, fmi):
    if fmi == "2":
        path = python_fmu(tmp_path, "Lag", LAG)
    else:
        path = python_fmu_of(tmp_path, LAG3, "lag_of_fmi_3", "3")
    assert choose_experiment(path) == ((100, 128), 1.0)
    start, then = choose_inputs(path)["u"]
    assert then == start + 1
    found = compare(path, 128, 1.0, tmp_path)
    assert (found.rows, found.equal, found.difference) == (129, True, 0.0)
    assert (found.hapticlink, found.fmpy, found.inputs) == ("", "", "set")
    assert found.outputs == {"2": 2, "3": 1}[fmi]


def test_what_is_stiff_is_measured(tmp_path):
    """dx/dt = u - k x decays with k."""
    case = Case("model-exchange", {"k": 1e5, "level": -1e9, "top": 1e9}, 1e-6)
    found = compare(equations_fmu(tmp_path), 64, 1.0, tmp_path, case=case)
    assert (found.hapticlink, found.fmpy, found.outputs) == ("", "", 7)
    assert found.fastest == pytest.approx(1e5, rel=1e-6)
    row = {"duration_s": "1.0", **{n: str(v) for n, v in dataclasses.asdict(found).items()}}
    assert foreign._is_stiff(row)
    few = foreign.EXPLICIT * foreign.STIFF * (found.steps - 1)
    assert not foreign._is_stiff(row | {"fastest": str(few)})
    assert case.settings == "k = 100000, level = -1e+09, top = 1e+09, tolerance = 1e-06"


def test_a_difference_is_measured_and_has_its_time(tmp_path):
    """The FMU tells the master by its process, which its library has been loaded into."""
    body = "import sys; self.y = 1.0 * ('benchmarks' in sys.modules and end > 0.5)"
    found = compare(python_fmu(tmp_path, "Tells", body), 64, 1.0, tmp_path)
    assert (found.equal, found.difference, found.output) == (False, 1.0, "y")
    assert found.first == 0.5 + 1 / 64


def test_inputs_that_end_a_run_are_left_alone(tmp_path):
    path = python_fmu(tmp_path, "Refuses", "self.y = 1 / (self.u == 0.0)")
    found = compare(path, 64, 1.0, tmp_path)
    assert (found.equal, found.rows, found.inputs) == (True, 65, "untouched")


def test_the_page_has_what_ran_and_why_others_did_not(tmp_path, monkeypatch):
    """A source distribution and a wheel, with an FMU in both."""
    lag = python_fmu(tmp_path, "Lag", LAG)
    other = edited(python_fmu(tmp_path, "Old", LAG), lambda t: t.replace('"2.0"', '"1.0"', 1))
    with tarfile.open(tmp_path / "some_fmus-1.2.tar.gz", "w:gz") as made:
        made.add(lag, "some_fmus-1.2/tests/Lag.fmu")
        made.add(other, "some_fmus-1.2/tests/Old.fmu")
    with zipfile.ZipFile(tmp_path / "more-3.0-py3-none-any.whl", "w") as wheel:
        wheel.write(lag, "more/Lag.fmu")
    bring(monkeypatch, tmp_path, *tmp_path.glob("*.tar.gz"), *tmp_path.glob("*.whl"))
    monkeypatch.setattr(foreign, "install_libraries", lambda folder: None)
    (tmp_path / "out").mkdir()
    told: list[str] = []
    text = foreign.bench(tmp_path / "out", False, lambda what, *_: told.append(what), "the command")
    assert "1 FMUs run in hapticlink and in FMPy" in text
    assert text.count("| Lag | more 3.0 | PythonFMU") == 1
    assert "| 128 Hz | 129 | 2 | 0, every bit equal |" in text
    assert "| Old | some-fmus 1.2 |" in text
    needed = "an FMU of FMI 2.0 or 3.0 for co-simulation or model exchange is needed;"
    assert f"| it is of FMI 1.0: {needed}" in text
    rates = ("Lag", 100), ("Lag", 128), ("Old", 100)
    assert told[1:] == [f"{name} co-simulation at {rate} Hz" for name, rate in rates]
    rows = Rows(tmp_path / "out" / "runs.csv", foreign.COLUMNS, keys=len(foreign.KEYS))
    assert len(rows.rows) == 3


def bring(monkeypatch: pytest.MonkeyPatch, folder: Path, *archives: Path) -> None:
    """Packages that are there, and no repositories."""
    monkeypatch.setattr(foreign_packages, "download_packages", lambda folder: archives)
    (folder / "repositories.txt").write_text("# none\n")
    monkeypatch.setattr(foreign_packages, "REPOSITORIES", folder / "repositories.txt")


def test_fmus_keep_their_place_in_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lag = python_fmu(tmp_path, "Lag", LAG)
    with tarfile.open(tmp_path / "some_fmus-1.2rc1.tar.gz", "w:gz") as made:
        made.add(lag, "some_fmus-1.2rc1/tests/Lag.fmu")
    bring(monkeypatch, tmp_path, tmp_path / "some_fmus-1.2rc1.tar.gz")
    (found,) = find_fmus(tmp_path)
    assert (found.package, found.file, found.fmi) == ("some-fmus 1.2rc1", "tests/Lag.fmu", "2.0")
    assert found.path.read_bytes() == lag.read_bytes()


def test_fmus_of_a_repository_are_those_of_its_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lag, origin = python_fmu(tmp_path, "Lag", LAG), tmp_path / "origin"
    bring(monkeypatch, tmp_path)
    (origin / "fmus").mkdir(parents=True)
    (origin / "fmus" / "Lag.fmu").write_bytes(lag.read_bytes())
    (origin / "Other.fmu").write_text("in a folder that is not asked for")
    settings = tmp_path / "gitconfig"
    settings.write_text(
        f'[url "{origin}"]\n\tinsteadOf = https://github.com/some/fmus\n'
        "[uploadpack]\n\tallowFilter = true\n\tallowAnySHA1InWant = true\n"
        "[user]\n\tname = a\n\temail = a@b\n"
    )
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(settings))
    commands = ("init -q", "add .", "commit -qm made", "rev-parse HEAD")
    for command in commands:
        done = subprocess.run(
            ["git", "-C", str(origin), *command.split()], check=True, stdout=subprocess.PIPE
        )
    commit = done.stdout.decode().strip()
    (tmp_path / "repositories.txt").write_text(f"some/fmus {commit} fmus\n")
    (found,) = find_fmus(tmp_path)
    assert (found.package, found.file) == (f"some/fmus {commit[:7]}", "fmus/Lag.fmu")
    assert found.path.read_bytes() == lag.read_bytes()
