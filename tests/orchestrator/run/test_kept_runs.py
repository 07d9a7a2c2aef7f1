"""Points of a sweep, which keep FMUs, system and operations of the ones before, give what single
runs give, to the byte."""

import random
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticlink.orchestrator import experiment
from hapticlink.orchestrator.base import shelf
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.run import execute_plan, kept_runs
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.system import build_system, fmu_files
from hapticlink.orchestrator.system.fmu_files import prefer_compiled

BASE = ("packaging=native", "duration=0.25")
KEYS: dict[str, list[str]] = {
    "graphics.rate": ["20", "45", "{ min = 20, max = 50, seed = 3 }"],
    "haptics.rate": ["256", "1000"],
    "hold": ["foh", "lead", "delayed", "passive"],
    "downsampling": ["mean"],
    "controller.topology.stiffness": ["80.0", "150.0"],
    "controller.topology": ["false"],
    "controller.teleoperation.damping": ["[60.0, 60.0, 0.3]"],
    "hand.wrench": ["[-0.4, 0.0, -0.0025]", "[-0.3, 0.1, 0.0]"],
    "hand.damping": ["[0.2, 0.2, 0.001]"],
    "delays.'virtual_environment.Lambda_inv'": ["0.02", "{ min = 0.0, max = 0.03, seed = 5 }"],
    "delays.'controller.x_D'": ["0.05"],  # more samples than a hold has room for at first
    "record.every": ["3"],
    "record.signals": ["'connected'", '["virtual_mechanism"]'],
    "coupling": ["jacobi"],
    "duration": ["0.2"],
    "at": ['[{ time = 0.1, set = { "hand.wrench" = [-0.1, 0.0, 0.0] } }]'],
    "linkage.start.shoulder1": ["0.7", "0.85", "2.5"],  # of which the last one does not close
    "linkage.start.elbow2": ["1.5", "-1.5"],
    "stop_when": ["'haptic_device.workspace_margin < 1.0'"],
}
DIVERGES = ("graphics.rate=4", "duration=2.0", "controller.teleoperation.stiffness=[9e4, 9e4, 9e2]")
BURSTS = ("hand.wrench=[1e308, 0.0, 0.0]",)
"""The next run of the same FMUs after a doStep that failed."""
OUTSIDE = ("linkage.operational_point={ body = 'link2', at = [0.9, 0.0] }",)
"""The start."""
TIMES = ("timings", "run_time_s")
AT = "at=[{{ time = 0.05, set = {{ 'hand.wrench' = [{}, 0.0, 0.0] }} }}]"


@contextmanager
def nothing_kept() -> Iterator[None]:
    """As in a process of its own."""
    for each in shelf._shelves:
        each.clear()
    process_cache.trim(0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shelf, "_keeping", 0)
        yield


def content(scene: str, options: tuple[str, ...], folder: Path) -> Any:
    """What a run gives: its fault, or tables and run.json but times."""
    try:
        found = simulate(scene, folder, options, in_memory=True)
    except Fault as fault:
        return str(fault)
    return told(found)


def told(found: Experiment) -> Any:
    tables = {
        name: (table.columns, np.array(table.rows).tobytes())
        for name, table in found.results.tables.items()
    }
    return tables, {key: value for key, value in found.run.items() if key not in TIMES}


def drawn(generator: random.Random) -> tuple[str, ...]:
    keys = generator.sample([*KEYS], generator.choice([0, 1, 1, 2, 3]))
    if "controller.topology" in keys:
        keys = [k for k in keys if not k.startswith("controller.topology.")]
    return (*BASE, *(f"{key}={generator.choice(KEYS[key])}" for key in keys))


@pytest.mark.parametrize("seed", [1, 2])
def test_points_in_any_order_are_those_of_single_runs(seed: int, tmp_path: Path) -> None:
    generator = random.Random(seed)
    points = [drawn(generator) for _ in range(12)]
    points += [(*BASE, *DIVERGES), (*BASE, *OUTSIDE), (*BASE, "graphics.rate=-1")]
    points += [(*BASE, *BURSTS), (*BASE, "hold=lead", *BURSTS), BASE, (*BASE, "hold=lead")]
    points = generator.sample(2 * points, 2 * len(points))
    with nothing_kept():
        alone = {p: content("closed-loop-ideal", p, tmp_path / "run") for p in {*points}}
    with process_cache.keep_unpacked():
        for point in points:
            assert content("closed-loop-ideal", point, tmp_path / "run") == alone[point], point
    ends = {
        point: told if isinstance(told, str) else told[1]["end"] for point, told in alone.items()
    }
    assert "fault" in str(ends[(*BASE, *BURSTS)])
    assert "diverged" in str(ends[(*BASE, *DIVERGES)])
    assert ends[(*BASE, *OUTSIDE)] == {"reason": "fault", "time": 0.0}


@pytest.mark.parametrize("scene", ["closed-loop", "serial", "enclosure", "two-users"])
def test_draws_of_gains_and_hands_of_other_scenes(scene: str, tmp_path: Path) -> None:
    gains = ["controller.teleoperation.damping=[60.0, 60.0, 0.3]", "duration=0.1"]
    points = [("duration=0.1",), tuple(gains), ("duration=0.1",), (*gains, "hold=passive")]
    points = [("packaging=native", *point) for point in points]
    with nothing_kept():
        alone = [content(scene, point, tmp_path / "run") for point in points]
    with process_cache.keep_unpacked():
        assert [content(scene, point, tmp_path / "run") for point in points] == alone


ZEROS = (
    ("pendulum", "linkage.start.pivot={}", "0.0", "-0.0"),
    (
        "serial",
        "linkage.start={}",
        "{ shoulder1 = 0.0, elbow1 = -1.5 }",
        "{ shoulder1 = -0.0, elbow1 = -1.5 }",
    ),
    ("closed-loop-ideal", AT, "0.0", "-0.0"),
    ("closed-loop-ideal", AT, "1.0", "1"),
    ("closed-loop-ideal", AT, "1.0", "true"),  # which is refused
)


@pytest.mark.parametrize(("scene", "option", "one", "other"), ZEROS)
def test_points_that_are_equal_but_not_the_same(
    scene: str, option: str, one: str, other: str, tmp_path: Path
) -> None:
    points = [("packaging=native", "duration=0.1", option.format(v)) for v in (one, other, one)]
    with nothing_kept():
        alone = [content(scene, point, tmp_path / "run") for point in points]
    assert alone[0] != alone[1]
    with process_cache.keep_unpacked():
        assert [content(scene, point, tmp_path / "run") for point in points] == alone


def test_contexts_that_overlap_end_with_the_last_one() -> None:
    """As in threads, of which the one that began first also ends first."""
    with nothing_kept():
        first, second = process_cache.keep_unpacked(), process_cache.keep_unpacked()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert shelf.is_keeping()
        second.__exit__(None, None, None)
        assert not shelf.is_keeping()


def test_another_thread_does_not_prefer_compiled_blocks() -> None:
    with prefer_compiled(), ThreadPoolExecutor(1) as pool:
        assert fmu_files._prefers_compiled.get()
        assert not pool.submit(fmu_files._prefers_compiled.get).result()
    assert not fmu_files._prefers_compiled.get()


def test_what_is_kept_is_used_and_bounded(tmp_path: Path) -> None:
    """Instances do not grow in number with the points, and none is left behind."""

    def run(*options: str) -> Experiment:
        return simulate("closed-loop-ideal", tmp_path / "run", (*BASE, *options), in_memory=True)

    with nothing_kept():
        before = process_cache.count_instances()
        with process_cache.keep_unpacked():
            run()
            one = process_cache.count_instances()
            assert one - before == len(run().system.fmus)
            assert len(kept_runs._RUNS) == 1
            for i in range(6):
                run(f"hand.wrench=[-0.{i}1, 0.0, 0.0]", f"controller.topology.stiffness=1{i}0.0")
                assert process_cache.count_instances() == one
            for i in range(3 * kept_runs.MOST):
                run(f"graphics.rate={20 + i}")
                assert len(kept_runs._RUNS) <= kept_runs.MOST
                assert process_cache.count_instances() <= (kept_runs.MOST + 1) * one
        assert process_cache.count_instances() == before
        assert len(kept_runs._RUNS) == 0


def test_a_run_whose_memory_has_grown_is_not_kept(tmp_path: Path) -> None:
    with nothing_kept(), process_cache.keep_unpacked():
        for option, kept in (("delays.'controller.x_D'=0.05", 0), ("hold=lead", 1)):
            simulate("closed-loop-ideal", tmp_path / "run", (*BASE, option), in_memory=True)
            assert len(kept_runs._RUNS) == kept


def test_gains_and_hands_load_no_fmu_and_prepare_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads, prepared = [], []
    load, prepare = InProcess._load, execute_plan.CompiledLoop.__init__
    monkeypatch.setattr(InProcess, "_load", lambda self: (loads.append(self.name), load(self))[1])
    monkeypatch.setattr(
        execute_plan.CompiledLoop,
        "__init__",
        lambda self, *of: (prepared.append(1), prepare(self, *of))[1],
    )
    with nothing_kept(), process_cache.keep_unpacked():
        for i in range(4):
            options = (*BASE, f"hand.wrench=[-0.{i}, 0.0, 0.0]", f"controller.topology.damping={i}")
            simulate("closed-loop-ideal", tmp_path / "run", options, in_memory=True)
    assert len(prepared) == 1
    assert len(loads) == len({*loads})


def test_rates_and_start_poses_load_no_fmu_and_build_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of other clocks the operations and the record are made anew, of other poses nothing."""
    made = Counter[str]()

    def count(of: Any, name: str) -> None:
        function = getattr(of, name)
        monkeypatch.setattr(of, name, lambda *a, **k: (made.update([name]), function(*a, **k))[1])

    for of, name in (
        (InProcess, "_load"),
        (fmu_files, "find_block"),
        (build_system, "_assemble"),
        (experiment, "setup"),
        (execute_plan, "Simulation"),
        (CompiledLoop, "take_plan"),
    ):
        count(of, name)
    rates, poses = ("25", "37.4", "60"), ("0.7", "0.75", "0.8", "0.85", "0.9")
    points = [f"graphics.rate={rate}" for rate in rates]
    points += [f"linkage.start.shoulder1={pose}" for pose in poses]
    with nothing_kept(), process_cache.keep_unpacked():
        found = [
            simulate("closed-loop-ideal", tmp_path / "run", (*BASE, point), in_memory=True)
            for point in points
        ]
    blocks = len(found[0].system.fmus)
    assert made["_load"] == made["find_block"] == blocks
    assert made["Simulation"] == 1
    assert made["take_plan"] == len(rates)  # and back to the scene's rate
    assert made["_assemble"] == 1
    assert made["setup"] == len(rates) + 1


def test_an_fmu_that_cannot_be_reset_is_loaded_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reset, made, loads = InProcess.reset, InProcess._instantiate, list[str]()

    def run() -> Any:
        return told(simulate("closed-loop-ideal", tmp_path / "run", BASE, in_memory=True))

    with nothing_kept():
        alone = run()
        with process_cache.keep_unpacked():
            monkeypatch.setattr(
                InProcess, "reset", lambda self: self.name != "controller" and reset(self)
            )
            assert run() == alone
            assert len(kept_runs._RUNS) == 0
            monkeypatch.undo()
            monkeypatch.setattr(
                InProcess, "_instantiate", lambda self: (loads.append(self.name), made(self))[1]
            )
            assert run() == alone
    assert loads == ["controller"]


def test_an_fmu_that_fails_at_its_end_fails_its_own_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run() -> Experiment:
        return simulate("closed-loop-ideal", tmp_path / "run", BASE, in_memory=True)

    terminate = InProcess.terminate
    with nothing_kept(), process_cache.keep_unpacked():
        before = told(run())
        monkeypatch.setattr(
            InProcess,
            "terminate",
            lambda self: (
                self.failed("fmi2Terminate", 3) if self.name == "hand" else terminate(self)
            ),
        )
        assert "fmi2Terminate" in str(run().outcome.fault)
        assert len(kept_runs._RUNS) == 0
        monkeypatch.undo()
        assert told(run()) == before
