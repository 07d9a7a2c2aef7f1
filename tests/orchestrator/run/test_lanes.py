"""Runs side by side, with the steps of FMUs at once, give what single runs give, to the byte."""

from itertools import zip_longest
from pathlib import Path

import pytest

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import Interrupted
from hapticlink.orchestrator.experiment import simulate_together
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.run.compiled import lanes
from tests.orchestrator.run.test_kept_runs import content, nothing_kept, told

BASE = ("packaging=native", "duration=0.25")
WRENCHES = [f"hand.wrench=[{-0.1 * i}, {0.05 * (i - 3)}, 0.001]" for i in range(6)]
GAINS = [f"controller.teleoperation.damping=[{gain}, {gain}, 0.3]" for gain in (50.0, 60.0)]


def compare(scene: str, points: list[tuple[str, ...]], folder: Path) -> list[str]:
    """Whether runs side by side, twice, are those of single ones; how these ended."""
    scenes = [open_scene.load(scene, point) for point in points]
    with nothing_kept():
        alone = [content(scene, point, folder) for point in points]
    with process_cache.keep_unpacked():
        for _ in range(2):
            together = simulate_together(scenes, folder, True, told)
            assert together == alone
    return [run["end"]["reason"] for _, run in alone]


def count_steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The runs that are side by side each time."""
    counts: list[int] = []
    run = lanes.run_side_by_side

    def counted(loops, steps, turn):
        assert "virtual_mechanism" in steps
        ended = run(loops, steps, turn)
        counts.append(ended.count(None))
        return ended

    monkeypatch.setattr(lanes, "run_side_by_side", counted)
    return counts


def test_gains_and_hands_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables, energies, checks of steps, counts of calls, run.json: all but times."""
    counts = count_steps(monkeypatch)
    points = [(*BASE, wrench) for wrench in WRENCHES] + [(*BASE, gain) for gain in GAINS]
    points += [(*BASE, WRENCHES[0], gain) for gain in GAINS]
    assert set(compare("closed-loop-ideal", points, tmp_path)) == {"duration"}
    assert counts == [8, 2, 8, 2]


def test_runs_that_end_early_or_fail_are_taken_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hand that pulls the device out of its workspace, one whose steps fail; the others go on."""
    counts = count_steps(monkeypatch)
    hands = ["hand.wrench=[60.0, 0.0, 0.0]", "hand.wrench=[1e308, 0.0, 0.0]", *WRENCHES[:3]]
    ended = compare("closed-loop-ideal", [(*BASE, hand) for hand in hands], tmp_path)
    assert ended == ["stop_when", "fault", "duration", "duration", "duration"]
    assert counts == [3, 3]


def test_points_of_the_same_events_go_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Holds, seeds of latencies and of noise have the same events; those of rates have not."""
    counts = count_steps(monkeypatch)
    crossing = 'delays."virtual_mechanism.x"={ min = 0.01, max = 0.05, loss = 0.1, seed = '
    noise = 'at=[{ time = 0.05, noise = { "controller.x_D" = 0.001 }, seed = '
    rate = "graphics.rate={ min = 20, max = 50, seed = "
    groups = [
        ["hold=zoh", "hold=foh", "hold=passive"],
        [f"{crossing}{seed} }}" for seed in (1, 2)],
        [f"{noise}{seed} }}]" for seed in (1, 2)],
        [f"{rate}1 }}", f"{rate}2 }}", "graphics.rate=20"],
    ]
    options = [option for group in zip_longest(*groups) for option in group if option]
    compare("closed-loop-direct", [(*BASE, option) for option in options], tmp_path)
    assert counts == [7, 7]


@pytest.mark.slow
def test_start_poses_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = count_steps(monkeypatch)
    poses = [f"linkage.start.shoulder1={angle}" for angle in (0.75, 0.8, 0.85)]
    compare("closed-loop-ideal", [(*BASE, pose) for pose in poses], tmp_path)
    assert counts == [3, 3]


def test_a_signal_ends_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [
        open_scene.load("closed-loop-ideal", (*BASE, "duration=60.0", wrench))
        for wrench in WRENCHES
    ]
    real = interrupt.raise_if_interrupted

    def interrupted(time: float | None = None) -> None:
        real()
        if time:
            raise Interrupted(time)

    with process_cache.keep_unpacked():
        monkeypatch.setattr(interrupt, "raise_if_interrupted", interrupted)
        with pytest.raises(Interrupted):
            simulate_together(scenes, tmp_path, True, told)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("closed-loop", ()),
        ("closed-loop-direct", ("hold=passive",)),
        ("closed-loop-direct", ("hold=model",)),
        ("closed-loop-ideal", ("hold=foh", "graphics.rate={ min = 20, max = 50, seed = 3 }")),
        ("serial", ()),
        ("obstacles", ()),
        ("two-users", ()),
    ],
)
def test_other_scenes(scene: str, options: tuple[str, ...], tmp_path: Path) -> None:
    gains = [f"controller.teleoperation.damping=[{g}, {g}, 0.3]" for g in (50.0, 55.0, 60.0, 65.0)]
    compare(scene, [(*BASE, *options, gain) for gain in gains], tmp_path)
