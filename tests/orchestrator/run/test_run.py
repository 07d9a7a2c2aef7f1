"""Runs of real FMUs: causality on stamped signals, what FMUs say, and what counts as run time."""

import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from hapticlink.orchestrator.fmi.in_process_fmi2 import InProcess
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_folder import RunFolder
from hapticlink.orchestrator.results.tables import Table, read_table
from hapticlink.orchestrator.run.execute_plan import run
from tests.orchestrator.foreign_fmus import python_fmu
from tests.orchestrator.foreign_fmus import run as run_scene
from tests.orchestrator.timelines import fixed, varying

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
def test_stamped_signals(stamped, tmp_path, timeline, coupling, late):
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


ONE = '[[fmu]]\nname = "one"\npath = "One.fmu"\n'


def test_what_the_fmu_said_is_in_the_fault(tmp_path):
    error = "__import__('pythonfmu').enums.Fmi2Status.error"
    python_fmu(tmp_path, "One", f"self.log('the belt slipped', {error}); return False")
    experiment, _ = run_scene(tmp_path, ONE)
    assert "the belt slipped" in str(experiment.outcome.fault)


def test_loading_and_unloading_are_no_part_of_the_runs_time(tmp_path, monkeypatch):
    python_fmu(tmp_path, "One")
    pauses = []

    def paused(method):
        def call(instance):
            time.sleep(0.3)
            pauses.append(method.__name__)
            return method(instance)

        return call

    for name in ("_load", "close"):
        monkeypatch.setattr(InProcess, name, paused(getattr(InProcess, name)))
    outcome = run_scene(tmp_path, ONE)[0].outcome
    assert pauses == ["_load", "close"]
    assert outcome.wall_time < 0.3
