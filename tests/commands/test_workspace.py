"""`info` prints and draws the device's workspace, and warns if a scene starts outside it."""

from pathlib import Path

import numpy as np
import pytest

from hapticlink.analysis.findings.workspace import lines
from hapticlink.visualization.mechanism.workspace_drawing import draw
from tests.devices import device
from tests.shared_fixtures import status

FAR = ("--set", "linkage.start.float=[0.22, 0.0, 0.0]")
OUTSIDE = "is outside the device's workspace, or too far from the device's own start"


def test_info_tells_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status("info", "single-body", "--out", tmp_path) == 0
    told = capsys.readouterr().out
    assert "at every theta: x -0.2 to 0.19 m, y -0.1 to 0.1 m" in told
    assert "the handle starts at (0, 0, 0), 0.128 m" in told
    assert (tmp_path / "workspace.png").read_bytes().startswith(b"\x89PNG")


def test_a_start_outside_is_told_by_info_and_by_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert OUTSIDE in list(lines(device(), (0.22, 0.0, 0.0)))[-1]
    assert status("run", "single-body", "--no-figures", "--out", tmp_path, *FAR) == 1
    told = capsys.readouterr()
    assert f"{told.out}{told.err}".count(OUTSIDE) == 1
    on = ("--set", "stop_when=''", "--set", "duration=0.01")
    assert status("run", "single-body", "--no-figures", "--out", tmp_path, *FAR, *on) == 0
    assert OUTSIDE in capsys.readouterr().out


def test_a_start_inside_a_contact_is_told_by_info_and_by_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The middle of a disc of 8 mm at the axis of link 2, of 3 mm radius: 11 mm deep."""
    options = "--set", "contacts.disc.pin.center=[0.0445477, 0.0148492]"
    hand = "--set", "hand={type='spring', stiffness=[300, 300, 0], damping=[1, 1, 0]}"
    said = "the scene starts inside a contact, link2 11 mm deep in pin"
    assert status("info", "obstacles", *options) == 0
    assert said in capsys.readouterr().out
    short = "--no-figures", "--out", tmp_path, "--set", "duration=0.02"
    assert status("run", "obstacles", *short, *options, *hand) == 0
    told = capsys.readouterr().out
    assert said in told
    pull = 300 * np.hypot(0.0445477, 0.0148492)
    assert f"the hand's spring begins with a pull of {pull:.3g} N" in told


def test_the_drawing_shows_the_device_at_the_start_with_units() -> None:
    start = (0.04, 0.01, 0.5)
    (axes,) = draw(device(), start, "title").axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("x (m)", "y (m)", "title")
    lines = {line.get_label(): np.transpose(line.get_data()) for line in axes.get_lines()}
    np.testing.assert_allclose(lines["handle where the scene starts"], [start[:2]])
    half = 0.04 * np.array([np.cos(0.5), np.sin(0.5)])
    crank = [start[:2] + way * half for way in (-1, 0, 1)]
    np.testing.assert_allclose(lines["body of the handle"], crank)
