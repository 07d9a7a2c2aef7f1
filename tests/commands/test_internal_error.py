"""An unexpected error is reported in two lines, with its traceback in a file."""

from pathlib import Path

import pytest

from hapticlink.orchestrator import open_scene
from tests.shared_fixtures import status


@pytest.mark.parametrize("error", [ZeroDivisionError("of length 0"), RecursionError(), KeyError(3)])
def test_an_error_of_ours_is_a_message_and_a_report(
    error: Exception,
    own_temporary_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def load(*_: object) -> None:
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


def test_arguments_that_are_no_text(capsys: pytest.CaptureFixture[str]) -> None:
    assert status("run", "pendulum", "--set", "title=\udcff") == 2
    assert r"'title=\udcff': no text" in capsys.readouterr().err
