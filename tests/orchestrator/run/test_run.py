"""Runs of real FMUs: causality on stamped signals, faults keep results, nothing stays behind."""

import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator.base.faults import FmuFault, Interrupted
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.fmi.in_process import InProcess
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.tables import Table, read_table
from hapticlink.orchestrator.run.event_loop import run
from hapticlink.orchestrator.scene.conditions import parse_condition
from hapticlink.orchestrator.system.system import Fmu, System
from tests.orchestrator.timelines import fixed, single, varying

TIMELINES = {
    "60": fixed(Fraction(512), Fraction(60), 256),
    "30": fixed(Fraction(512), Fraction(30), 256),
    "24": fixed(Fraction(512), Fraction(24), 256),
    "10": fixed(Fraction(512), Fraction(10), 256),
    "30 on ticks": fixed(Fraction(512), Fraction(30), 256, "tick"),
    "variable": varying(Fraction(512), Fraction(10), Fraction(60), 7, 256),
}


def table(folder: Path, clock: str = "haptics") -> Table:
    return read_table(folder / f"{clock}.csv")


@pytest.mark.parametrize("timeline", TIMELINES.values(), ids=TIMELINES.keys())
@pytest.mark.parametrize(("coupling", "late"), [("gauss-seidel", 0), ("jacobi", 1)])
def test_stamped_signals(
    stamped: Callable[[Timeline, str], System],
    tmp_path: Path,
    timeline: Timeline,
    coupling: str,
    late: int,
) -> None:
    outcome = run(Plan(stamped(timeline, coupling)), RunFolder(tmp_path))
    assert outcome.fault is None
    fast, slow = table(tmp_path), table(tmp_path, "graphics")
    time, frames = fast["time"], slow["time"]
    starts = [timeline.seconds(s) for s in timeline.clock("graphics").starts if s <= timeline.end]
    assert frames.tolist() == starts
    assert time.tolist() == [timeline.seconds(s) for s in timeline.clock("haptics").starts][:257]

    # Every graphics sample reaches the fast side at the first tick at or after its time.
    newest = frames[np.searchsorted(frames, time, side="right") - 1]
    np.testing.assert_allclose(fast["controller.seen_g"], newest, rtol=0, atol=1e-12)
    # A frame reads at its start the newest mechanism sample of then.
    read = time[np.searchsorted(time, frames, side="right") - 1]
    np.testing.assert_allclose(slow["graphics.seen_m"][1:], read[:-1], rtol=0, atol=1e-12)
    # Sampled blocks read the plants of their own tick; plants read them `late` ticks late.
    np.testing.assert_allclose(fast["controller.seen_d"], time, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fast["controller.stamp"], time, rtol=0, atol=0)
    expected = np.maximum(np.arange(256) - late, 0) / 512
    np.testing.assert_allclose(fast["device.seen_f"][1:], expected, rtol=0, atol=1e-12)


def test_same_run_same_bytes(stamped: Callable[[Timeline, str], System], tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        run(Plan(stamped(TIMELINES["variable"], "gauss-seidel")), RunFolder(tmp_path / name))
    for file in ("haptics.csv", "graphics.csv"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


Slave = Callable[..., Fmu]


def alone(unit: Fmu, steps: int = 64, stop_when: str | None = None) -> Plan:
    condition = parse_condition(stop_when) if stop_when else None
    return Plan(System((unit,), (), single(64, steps), "gauss-seidel", condition))


def left_behind() -> set[str]:
    return {p.name for p in Path(tempfile.gettempdir()).glob("hapticlink-*")}


@pytest.mark.parametrize(
    ("name", "body", "message"),
    [
        ("Nan", "self.y = float('nan') if time > 0.5 else time", "output y is nan at t = 0.515625"),
        ("Infinite", "self.y = 1e308 * 10 if time > 0.5 else 0.0", "output y is inf at t = 0.5156"),
        ("Refuses", "if time > 0.5: return False", "fmi2DoStep returned discard at t = 0.5 s"),
        ("Raises", "if time > 0.5: raise RuntimeError('broken gear')", "fmi2DoStep returned"),
    ],
)
def test_a_fault_names_fmu_variable_and_time_and_keeps_results(
    slave: Slave, tmp_path: Path, name: str, body: str, message: str
) -> None:
    before, plan = left_behind(), alone(slave(name, body))
    outcome = run(plan, RunFolder(tmp_path))
    assert isinstance(outcome.fault, FmuFault)
    assert str(outcome.fault).startswith(f"{name}: {message}")
    assert outcome.end_time == 0.5
    rows = table(tmp_path)
    assert rows["time"].tolist() == [k / 64 for k in range(33)]
    assert left_behind() == before
    assert not [entry for entry in sys.path if "hapticlink-" in entry]


def test_what_the_fmu_said_is_in_the_fault(slave: Slave, tmp_path: Path) -> None:
    body = "self.log('the belt slipped', 3); return False"
    unit = slave("Talks", body.replace("3", "__import__('pythonfmu').enums.Fmi2Status.error"))
    outcome = run(alone(unit), RunFolder(tmp_path))
    assert "the belt slipped" in str(outcome.fault)


def test_ctrl_c_ends_between_events_with_results(slave: Slave, tmp_path: Path) -> None:
    before, handler = left_behind(), signal.getsignal(signal.SIGINT)
    body = f"if time == 0.25: __import__('os').kill({os.getpid()}, 2)"
    outcome = run(alone(slave("Interrupts", body)), RunFolder(tmp_path))
    assert isinstance(outcome.fault, Interrupted)
    assert outcome.reason == "interrupted"
    assert table(tmp_path)["time"][-1] == outcome.end_time
    assert 0.2 < outcome.end_time < 0.3
    assert left_behind() == before
    assert signal.getsignal(signal.SIGINT) is handler


def test_stop_when_ends_in_good_order_with_its_row(slave: Slave, tmp_path: Path) -> None:
    outcome = run(alone(slave("Stops"), stop_when="Stops.y >= 0.5"), RunFolder(tmp_path))
    assert (outcome.fault, outcome.reason, outcome.end_time) == (None, "stop_when", 0.5)
    assert table(tmp_path)["Stops.y"].tolist() == [k / 64 for k in range(33)]


def test_an_fmu_that_cannot_be_loaded_is_named_and_leaves_nothing(
    slave: Slave, tmp_path: Path
) -> None:
    unit = slave("Absent")
    before = left_behind()
    unit.description.path.unlink()
    outcome = run(alone(unit), RunFolder(tmp_path))
    assert str(outcome.fault).startswith("Absent: could not be loaded")
    assert left_behind() == before


def test_a_full_disk_is_a_fault(
    slave: Slave, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the second row on: the published table is a link to a device that is always full."""
    plan, before, replace = alone(slave("Full"), steps=600), left_behind(), os.replace

    def full(source: Path, target: Path) -> None:
        replace(source, target)
        if target.name == "haptics.rows":
            target.unlink()
            target.symlink_to("/dev/full")

    monkeypatch.setattr(os, "replace", full)
    outcome = run(plan, RunFolder(tmp_path))
    assert "No space left on device" in str(outcome.fault)
    assert left_behind() == before


def test_calls_are_counted(slave: Slave, tmp_path: Path) -> None:
    outcome = run(alone(slave("Counted")), RunFolder(tmp_path))
    assert outcome.calls == {"Counted": {"get": 64, "step": 64}}


def test_loading_and_unloading_are_no_part_of_the_runs_time(
    slave: Slave, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fmu, pauses = slave("Counted"), []

    def paused(method: Callable[[InProcess], object]) -> Callable[[InProcess], object]:
        def call(instance: InProcess) -> object:
            time.sleep(0.3)
            pauses.append(method.__name__)
            return method(instance)

        return call

    for name in ("_load", "close"):
        monkeypatch.setattr(InProcess, name, paused(getattr(InProcess, name)))
    outcome = run(alone(fmu), RunFolder(tmp_path))
    assert pauses == ["_load", "close"]
    assert outcome.wall_time < 0.3
