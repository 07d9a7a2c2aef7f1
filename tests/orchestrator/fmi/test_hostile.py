"""FMUs that behave badly: what they return is not believed, and what they change is restored."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticlink.orchestrator.experiment import simulate
from tests.orchestrator.hostile_fmus import hostile_fmu, hostile_scene

pytest.importorskip("resource")  # the FMU needs POSIX


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("isolate", ["", "isolate = true"])
@pytest.mark.parametrize(
    ("place", "act"),
    [
        ("step", "minus"), ("step", "least"), ("step", "pending"), ("step", "most"),
        ("get", "minus"), ("set", "minus"), ("enter", "minus"), ("leave", "least"),
        ("end", "minus"),
    ],
)  # fmt: skip
def test_only_ok_and_warning_are_success(
    tmp_path: Path, loop: str, fmi: str, isolate: str, place: str, act: str
) -> None:
    hostile_fmu(tmp_path, fmi)
    scene = hostile_scene(tmp_path, f"{place}_{act}_20", isolate)
    outcome = simulate(scene, tmp_path / "out").outcome
    assert outcome.reason == "fault"
    name = {"minus": "status -1", "least": "status -2147483648", "most": "status 2147483647"}
    assert f"returned {name.get(act, act)}" in str(outcome.fault)
    ends = {"step": 19 / 64, "get": 19 / 64, "set": 20 / 64, "enter": 0, "leave": 0, "end": 0.5}
    assert outcome.end_time == ends[place]


@pytest.mark.parametrize("place", ["save", "restore"])
def test_a_state_that_is_saved_or_restored_in_part_is_none(
    tmp_path: Path, loop: str, place: str
) -> None:
    hostile_fmu(tmp_path)
    scene = hostile_scene(tmp_path, f"{place}_minus_5")
    options = ["faults.discard=retry"]
    fault = str(simulate(scene, tmp_path / "out", options).outcome.fault)
    assert "returned status -1 at t = 0.0" in fault
