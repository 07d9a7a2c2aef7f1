"""What long commands say before they start."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hapticlink.commands import progress
from hapticlink.fmus import durations
from hapticlink.orchestrator.base.errors import Fault, Interrupted


def test_a_long_command_tells_how_long_it_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    times = iter([0.0, 90.0, 0.0, 30.0, 0.0, 0.0])
    monkeypatch.setattr(durations, "monotonic", lambda: next(times))
    for _ in range(3):
        with progress.timed("bench it", "about 3 minutes"):
            pass
    told = re.findall("duration (.*)", capsys.readouterr().err)
    known = "up to 1.5 minutes here, less if partly finished before"
    assert told == ["about 3 minutes", known, known]


def test_an_interrupted_command_keeps_no_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path))
    with pytest.raises(Fault, match="finished runs are kept"), progress.timed("bench it"):
        raise Interrupted
    assert not [*tmp_path.iterdir()]
