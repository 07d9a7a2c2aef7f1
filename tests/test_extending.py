"""The tutorial of docs/extending.md: its files and commands, as they stand there."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hapticlink.components.registry import Registry
from hapticlink.orchestrator.holds import Hold, HoldContext
from hapticlink.orchestrator.results import read_results
from hapticlink.orchestrator.results.read_results import Results
from tests.plugins import Ended, hapticlink

PAGE = (Path(__file__).parent.parent / "docs" / "extending.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r'```\w+ title="(.+?)"\n(.*?)```', PAGE, re.DOTALL))
LINES = "".join(re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)).splitlines()
Run = Callable[[str], Results]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tutorial")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def ended(folder: Path) -> dict[str, Ended]:
    return dict(zip(LINES, hapticlink(folder, *LINES), strict=True))


@pytest.fixture
def run(folder: Path, ended: dict[str, Ended]) -> Run:
    def loaded(name: str) -> Results:
        (found,) = (folder / "runs").glob(f"{name}*")  # options, if any, are part of the name
        return read_results.load(found)

    return loaded


def test_every_command_ends_well(ended: dict[str, Ended]) -> None:
    assert {line: e.said for line, e in ended.items() if e.status} == {}


def test_hold(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1 at tick 0 and 4 at tick 15: at tick 20, 4 + beta 3 5/15 with beta = 1/2."""
    parts: dict[str, type[Hold]] = {}
    monkeypatch.setattr(Registry, "register", lambda self, name, part: parts.update({name: part}))
    exec(FILES["fractional_order.py"], {"__name__": "fractional_order"})
    hold = parts["fractional-order"](HoldContext(1))
    hold.push(0, np.array([1.0]), 0)
    assert hold.value(7) == 1.0
    hold.push(15, np.array([4.0]), 15)
    assert hold.value(20) == hold.value(15, ahead=5) == pytest.approx(4.5)
    name = "virtual_environment.Lambda_inv -> controller.Lambda_inv"
    given = {"hold=fractional": "fractional-order", "hold=_type": "fractional-order(beta=0.3)"}
    for option, told in given.items():
        found = run(f"closed-loop-ideal*{option}")
        assert found.run["holds"][name] == told
        assert [*found.run["plugins"]] == ["fractional_order"]


def test_integrator(run: Run) -> None:
    assert run("five-bar").run["scene"]["mechanism"]["integrator"] == "midpoint"
    # x = (m/c) ln(1 + c v0 t/m) of the sail, to the third power of h: two orders above rounding.
    assert 1e-8 < abs(sailed(run("midpoint"))) < 1e-6


def sailed(found: Results) -> float:
    """How far the cart is from m dv/dt = -c v^2, v0 = 3 m/s, at the end (m)."""
    m, c, v0, t = 2.0, 0.8, 3.0, found.haptics["time"][-1]
    assert "drag" in found.run["plugins"]
    return found.haptics["virtual_mechanism.x"][-1, 0] - m / c * np.log1p(c * v0 * t / m)


def test_force(run: Run) -> None:
    assert abs(sailed(run("sail"))) < 1e-10


def test_force_in_the_processes_of_a_sweep(folder: Path, ended: dict[str, Ended]) -> None:
    rows = (folder / "sweeps" / "sail" / "table.csv").read_text().splitlines()
    assert [row.split(",")[:2] for row in rows[1:]] == [["0.4", "duration"], ["0.8", "duration"]]


def test_block(run: Run, ended: dict[str, Ended]) -> None:
    """v = F/b (1 - e^(-bt/m)); the second mass, of 1 kg, gets 50 x at 50 Hz."""
    found = run("pushed")
    b, m, t = 0.25, 2.0, found.haptics["time"]
    v = (1 - np.exp(-b * t / m)) / b
    np.testing.assert_allclose(found.haptics["first.v"], v, rtol=1e-12)
    x = found.haptics["first.x"][::10]
    pushed = np.concatenate([[0.0], np.cumsum(50.0 * x[:-1] / 50)])
    np.testing.assert_allclose(found.tables["50hz"]["second.v"], pushed, rtol=1e-11)
    said = ended["hapticlink info pushed.toml --plugin mass"].said
    assert "second: continuous, at 50hz, 2 outputs" in said


def test_scheme(run: Run) -> None:
    found = run("file-order").run
    assert (found["coupling"], found["causal"]) == ("file-order", True)


def test_family(run: Run) -> None:
    assert run("hanging").haptics["virtual_mechanism.q"].shape[1] == 6


def test_command(ended: dict[str, Ended]) -> None:
    said = next(e.said for line, e in ended.items() if "--plugin peak" in line)
    assert re.match(r"virtual_mechanism.closure_error: \S+e-1\d\n", said)
