"""Runs in real time, by a clock that goes on only while somebody waits for it, so that counters and
stamps are exact; and threads that are real, of which no time is asserted."""

import math
import re
import signal
import threading
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from time import perf_counter_ns
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi.calls_of_fmi import InProcess
from hapticlink.orchestrator.results.read_results import read_table
from hapticlink.orchestrator.run import concurrent_fmus, pace
from hapticlink.orchestrator.run.real_time import RealTimeRun
from hapticlink.visualization.figures.real_time_figure import exceedance
from hapticlink.visualization.figures.run_figures import figures
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import ISOLATED, fmu_table, scene
from tests.orchestrator.results.records import tables_of
from tests.orchestrator.wall_clock import MS, WallClock

HAPTIC, GRAPHICS = Fraction(1, 512), Fraction(1, 60)
FAST = ("duration=0.3", "graphics.rate=60")
Made = tuple[dict[str, Any], dict[str, bytes]]


def made(
    folder: Path, clock: WallClock | None, *options: str, scene: str = "closed-loop-ideal"
) -> Made:
    """The run.json and the tables of a run, in real time if there is a clock."""
    run = simulate(scene, folder, options, real_time=clock and clock.run()).run
    assert run["fault"] is None
    return run, tables_of(folder)


@pytest.mark.parametrize(
    "options",
    [
        ["coupling=jacobi", "hold=foh"],
        ["graphics.align=tick", "delays.virtual_mechanism.x=0.01"],
        ["coupling=gauss-seidel-plants"],
    ],
    ids=lambda options: options[0],
)
def test_a_run_whose_samples_are_in_time_writes_the_bytes_of_any_run(tmp_path, options):
    _, plain = made(tmp_path / "plain", None, *FAST, *options)
    run, paced = made(tmp_path / "paced", WallClock(lambda k: 15 * MS), *FAST, *options)
    told = run["real_time"]
    assert not told["reproducible"]
    assert (told["ticks"], told["deadlines_missed"], told["moved"]) == (154, 0, 0.0)
    assert told["lateness"]["max"] == told["step_time"]["max"] == 0.0
    in_loop = "gauss-seidel-plants" in options[0]
    assert ("virtual_environment" in told["in_loop"]) == in_loop
    if not in_loop:
        paced.pop("graphics_samples.csv")
        assert told["samples"]["graphics"] == {"taken": 17, "late": 0, "largest_lateness": 0.0}
    assert paced == plain


def late_samples(computing: Callable[[int], int], until: Fraction) -> list[tuple[float, float]]:
    """Stamp and arrival of each sample: a step begins where the one before it arrives, and ends at
    the first frame that is not past by then; it arrives there, or at the first haptic tick after it
    is computed."""
    found: list[tuple[float, float]] = []
    begun, frame, stamp, k = Fraction(0), 0, Fraction(0), 0
    while stamp <= until:
        frame = max(frame + 1, math.floor(begun / GRAPHICS) + 1)
        stamp = frame * GRAPHICS
        done = begun + Fraction(computing(k), 10**9)
        begun = stamp if done <= stamp else math.ceil(done / HAPTIC) * HAPTIC
        found.append((float(stamp), float(begun)))
        k += 1
    return [row for row in found if row[0] <= until]


@pytest.mark.parametrize("hold", ["zoh", "smooth", "passive"])
def test_late_samples_arrive_with_their_stamps(tmp_path, hold):
    """Steps of 3, 25, 50, 3, ... ms at 60 Hz."""

    def computing(k):
        return (3, 25, 50)[k % 3] * MS

    options = (*FAST, f"hold={hold}", "delays.virtual_mechanism.x=0.004")
    run, _ = made(tmp_path, WallClock(computing), *options, scene="closed-loop-direct")
    samples = read_table(tmp_path / "graphics_samples.csv")
    want = np.array([(0.0, 0.0), *late_samples(computing, 153 * HAPTIC)])
    assert np.allclose(samples.rows[:, :2], want, rtol=0, atol=1e-12)
    assert np.allclose(samples["lateness"], want[:, 1] - want[:, 0], rtol=0, atol=1e-12)
    assert samples["computing"][1:3].tolist() == [0.003, 0.025]
    assert np.allclose(read_table(tmp_path / "graphics.csv")["time"], want[:, 0])
    told = run["real_time"]["samples"]["graphics"]
    assert (told["taken"], told["late"]) == (len(want) - 1, (np.diff(want) > 0).sum())
    assert told["largest_lateness"] == samples["lateness"].max() > 0.03


def test_deadlines_that_are_missed_are_counted(tmp_path):
    """A tick that begins 3 ms late is complete after the next is due; one that begins 0.25 s late
    moves the schedule."""
    clock = WallClock(late={101 * MS: 3 * MS, 205 * MS: 250 * MS})
    told = made(tmp_path, clock, *FAST)[0]["real_time"]
    assert told["lateness"]["max"] == told["moved"] == 0.25
    assert told["deadlines_missed"] == 2
    assert told["lateness"]["p50"] == 0.0
    assert sum(count for _, count in told["histograms"]["lateness"]) == told["ticks"] == 154
    counted = [end for end, _ in told["histograms"]["lateness"][-2:]]
    assert np.allclose(counted, [0.003, 0.25], rtol=1 / 64, atol=0)
    assert clock.time == 250 * MS + int(153e9 / 512)


HARDWARE = "hardware = true\n"


def hardware_scene(folder: Path, more: str = HARDWARE, **options: bool) -> Path:
    """A device's FMU, which notes the tick and the length of each step, in a loop at 512 Hz."""
    note = "self.y = 1000.0 * round(512 * time) + round(512 * size)"
    python_fmu(folder, "Device", note, **options)
    return scene(folder, fmu_table("device", "Device", more), 512, 0.3)


FIXED = {"canHandleVariableCommunicationStepSize": False}


@pytest.mark.parametrize(
    ("late", "skips", "missed"),
    [
        ({}, {}, 0),
        ({101 * MS: 1 * MS}, {}, 0),  # tick 52, due at 101.6 ms: complete before the next is due
        ({101 * MS: 3 * MS}, {52: 2}, 2),
        # The last time until after the end, so that the last tick is late, too.
        ({101 * MS: 5 * MS, 107 * MS: 2 * MS, 290 * MS: 15 * MS}, {52: 3, 55: 2, 149: 4}, 10),
    ],
    ids=["in time", "within a period", "one", "several"],
)
def test_hardware_is_not_given_the_ticks_that_are_past(tmp_path, late, skips, missed):
    """It goes on to the first tick that is not past, or the last one of the run."""
    path = hardware_scene(tmp_path)
    run = simulate(path, tmp_path / "out", (), real_time=WallClock(late=late).run()).run
    assert run["fault"] is None
    begun, want = 0, []
    while begun < 153:
        want.append((begun, skips.get(begun, 1)))
        begun += want[-1][1]
    rows = read_table(tmp_path / "out" / "haptics.csv")
    assert (rows["time"][1:] * 512).tolist() == [begun + length for begun, length in want]
    assert rows["device.y"][1:].tolist() == [1000.0 * begun + length for begun, length in want]
    told, skipped = run["real_time"], sum(skips.values()) - len(skips)
    assert (told["ticks"], told["skipped"]) == (154, skipped)
    assert told["deadlines_missed"] == missed
    assert told["moved"] == 0.0


def test_hardware_that_is_very_late_begins_anew_at_its_rate(tmp_path):
    """Beyond eight periods the schedule moves by the lateness."""
    path, clock = hardware_scene(tmp_path), WallClock(late={101 * MS: 16 * MS})
    told = simulate(path, tmp_path / "out", (), real_time=clock.run()).run["real_time"]
    assert (told["skipped"], told["deadlines_missed"], told["moved"]) == (0, 1, 0.016)
    assert clock.time == 16 * MS + int(153e9 / 512)


def test_ticks_past_are_caught_up_with_where_no_hardware_is(tmp_path):
    path = hardware_scene(tmp_path, "")
    clock = WallClock(late={101 * MS: 5 * MS})
    told = simulate(path, tmp_path / "out", (), real_time=clock.run()).run["real_time"]
    assert (told["ticks"], told["skipped"], told["deadlines_missed"]) == (154, 0, 2)
    rows = read_table(tmp_path / "out" / "haptics.csv")
    assert np.array_equal(rows["time"], np.arange(154) / 512)


def test_longer_steps_have_the_frames_between_them(tmp_path):
    """Frames at 60 Hz beside a loop whose ticks are skipped keep their times."""
    python_fmu(tmp_path, "Frames")
    path = hardware_scene(tmp_path)
    path.write_text(path.read_text() + fmu_table("frames", "Frames", "rate = 60\n"))
    clock = WallClock(late={99 * MS: 4 * MS})  # over the frame at 100 ms
    told = simulate(path, tmp_path / "out", (), real_time=clock.run()).run["real_time"]
    assert told["skipped"] == 2
    samples = read_table(tmp_path / "out" / "60hz_samples.csv")
    assert np.array_equal(samples["time"], np.arange(len(samples["time"])) / 60)
    assert told["samples"]["60hz"]["taken"] == 17


@pytest.mark.parametrize(
    ("more", "options", "message"),
    [
        (HARDWARE, FIXED, "which device cannot take"),
        (
            HARDWARE + "rate = 64\ntiming = 'sampled'\n",
            {},
            "device: hardware in the haptic loop is at its rate; .* due within the instant",
        ),
    ],
)
def test_hardware_whose_ticks_cannot_be_skipped_is_refused(tmp_path, more, options, message):
    path = hardware_scene(tmp_path, more, **options)
    run = simulate(path, tmp_path / "out", (), real_time=WallClock().run())
    assert run.results.haptics["time"].size == 0
    assert re.search(message, str(run.outcome.fault))


@pytest.fixture(scope="module")
def device(tmp_path_factory) -> Path:
    """A scene whose device is an FMU that drives hardware."""
    folder = tmp_path_factory.mktemp("device")
    hl.build("closed-loop-ideal", out=folder)
    path = folder / "scene.toml"
    swapped = '[[fmu]]\nreplaces = "haptic_device"\npath = "haptic_device.fmu"\nhardware = true\n'
    path.write_text(f'extends = "closed-loop-ideal"\nduration = 0.3\n{swapped}')
    return path


def test_no_step_of_hardware_is_tried_twice(device, tmp_path):
    clock = WallClock(late={101 * MS: 5 * MS})
    run = simulate(device, tmp_path, (), real_time=clock.run()).run
    assert run["fault"] is None
    assert [*run["step_errors"]] == ["virtual_mechanism"]  # without `hardware` the device's, too
    assert run["real_time"]["skipped"] == 2


@pytest.mark.parametrize("act", [hl.run, hl.stability, hl.transparency])
def test_nothing_but_a_run_in_real_time_moves_hardware(device, act, monkeypatch):
    loaded = Mock(side_effect=AssertionError)
    monkeypatch.setattr(InProcess, "_load", loaded)
    with pytest.raises(hl.InputFault, match="haptic_device: hardware = true: it is moved by runs"):
        act(device)


def test_quantiles_are_within_a_bin_of_those_of_the_numbers():
    numbers = np.random.default_rng(1).lognormal(9.0, 2.0, 4000).astype(int)
    ends = [pace._upper(i) for i in range(pace.BINS)]
    bins = np.bincount(np.searchsorted(ends, numbers), minlength=pace.BINS)
    found = pace.quantiles(bins, numbers.max())
    for name, share in {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}.items():
        exact = np.quantile(numbers, share, method="inverted_cdf") * 1e-9
        assert exact <= found[name] <= exact * (1 + 1 / 64)
    assert found["max"] == numbers.max() * 1e-9


def test_a_schedule_waits_by_the_clock_of_the_machine(tmp_path):
    """A run of 0.1 s does not end before that."""
    began = perf_counter_ns()
    run = simulate("closed-loop-ideal", tmp_path, ["duration=0.11"], real_time=RealTimeRun()).run
    assert perf_counter_ns() - began > 100 * MS
    samples = run["real_time"]["samples"]["graphics"]
    assert samples["taken"] == 3 or (samples["late"] and 1 <= samples["taken"] < 3)


BODY = """
        if self.steps == 3:
            {}
        self.y = time + size"""


def beside_the_loop(folder: Path, body: str, more: str = "", timeout: float = 60.0) -> Path:
    """A scene with an FMU beside an empty haptic loop, of which the third step does something."""
    python_fmu(folder, "Slow", BODY.format(body).strip())
    python_fmu(folder, "One")
    text = fmu_table("one", "One") + fmu_table("slow", "Slow", f"rate = 64\n{more}")
    return scene(folder, f"{text}[faults]\ntimeout = {timeout}\n", 512, 0.2)


def threads() -> list[threading.Thread]:
    return [t for t in threading.enumerate() if t.name == "hapticlink-beside"]


@pytest.mark.parametrize("isolate", ["", ISOLATED])
def test_a_fault_beside_the_loop_ends_the_run_and_its_threads(tmp_path, isolate):
    path = beside_the_loop(tmp_path, "raise ValueError('three')", isolate)
    run = simulate(path, tmp_path / "out", (), real_time=RealTimeRun()).run
    assert run["end"]["reason"] == "fault"
    assert re.search("slow: .*three", run["fault"]["message"], re.S)
    rows = read_table(tmp_path / "out" / "haptics.csv")["time"]
    assert rows[-1] == run["end"]["time"] >= 3 / 64 - 1 / 512
    assert not threads()


def test_an_fmu_that_hangs_beside_the_loop_is_named(tmp_path, monkeypatch):
    """It is in its step when the run ends, and is not called again; the loop went on meanwhile."""
    monkeypatch.setattr(concurrent_fmus, "GRACE", 0.01)
    go = tmp_path / "go"
    hang = f"while not __import__('os').path.exists({str(go)!r}): __import__('time').sleep(0.01)"
    path = beside_the_loop(tmp_path, hang, timeout=0.3)
    try:
        run = simulate(path, tmp_path / "out", (), real_time=RealTimeRun()).run
    finally:
        go.touch()
    assert "slow: has not returned from its step within 0.3 s" in run["fault"]["message"]
    assert run["real_time"]["abandoned"] == ["slow"]
    rows = read_table(tmp_path / "out" / "haptics.csv")["time"]
    assert np.array_equal(rows, np.arange(len(rows)) / 512)
    for thread in threads():
        thread.join(60)
    assert not threads()


def test_a_step_that_is_not_done_at_the_end_is_waited_for(tmp_path):
    clock = WallClock(lambda k: 100 * MS if k == 16 else 0)
    run, _ = made(tmp_path, clock, *FAST)
    samples = read_table(tmp_path / "graphics_samples.csv")
    assert samples["time"][-1] == read_table(tmp_path / "graphics.csv")["time"][-1] == 17 / 60
    assert samples["arrival"][-1] > run["end"]["time"] == 153 / 512


@pytest.mark.parametrize("how", ["interrupted", "stop_when"])
def test_a_run_that_ends_early_leaves_its_rows_and_no_thread(tmp_path, how):
    def turn(simulation, loop):
        if how == "interrupted" and not came:
            came.append(1)
            signal.raise_signal(signal.SIGINT)

    came: list[int] = []
    options = ["duration=0.2"]
    options += ["stop_when='haptic_device.x[1] < 1e9'"] if how == "stop_when" else []
    ended = simulate("closed-loop-ideal", tmp_path, options, real_time=RealTimeRun(turn))
    assert ended.outcome.reason == how
    assert len(ended.results.haptics["time"]) >= 1
    assert (tmp_path / "graphics_samples.csv").exists()
    assert not threads()


def test_the_figure_shows_the_share_of_ticks_above_each_time():
    times, shares = exceedance([(0.0, 1), (2e-3, 2), (5e-3, 1)])
    assert np.allclose(times, [1e-4, 1e-4, 2.0, 5.0])
    assert np.allclose(shares, [1.0, 0.75, 0.25, 0.0])


def test_a_run_says_how_it_has_kept_its_schedule(tmp_path):
    clock = WallClock(lambda k: 25 * MS, {205 * MS: 250 * MS})
    found = simulate("closed-loop-ideal", tmp_path, FAST, real_time=clock.run()).results
    said = [*summary.lines(found)]
    assert "512 Hz in real time: 1 of 154 deadlines missed; largest step time 0 ms" in said[0]
    assert said[1].startswith("warning: the schedule was moved by 0.25 s")
    assert "graphics: " in said[2]
    assert "samples were late, at most by " in said[2]
    assert "real_time" in figures(found)
