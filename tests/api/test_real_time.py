"""`hl.RealTime`: a scene is read and changed while it runs, by a clock that goes on only while
somebody waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run.real_time import RealTimeRun
from tests.little_fmus import python_fmu
from tests.orchestrator.foreign_scenes import scene
from tests.orchestrator.wall_clock import MS, WallClock

Turn = Callable[[hl.RealTime], object]


def ran(name: str, turn: Turn, *options: str, clock: WallClock | None = None) -> hl.Run:
    live, by = hl.RealTime(name, options), clock or WallClock()

    def schedule(turn: Callable[..., object]) -> RealTimeRun:
        by.time = 0
        return by.run(turn)

    live._schedule = schedule
    return live.run(turn)


def once(at: float, change: Turn) -> Turn:
    """A turn that changes the scene at the first turn at or after a time (s)."""
    done: list[float] = []

    def turn(live: hl.RealTime) -> None:
        if live.time >= at and not done:
            done.append(live.time)
            change(live)

    return turn


def trying(*asked: Turn) -> tuple[Turn, list[str]]:
    """A turn that asks for each and ends the run, and the messages of what is refused."""
    refused: list[str] = []

    def turn(live: hl.RealTime) -> None:
        for ask in asked:
            try:
                ask(live)
            except InputFault as fault:
                refused.append(str(fault))
        live.stop()

    return turn, refused


NUMBERS = (-1.0, -1, float("nan"), float("inf"), -float("inf"), 1e30, "x", None, True, [1], 2**70)


def changes(value: Any) -> Iterator[tuple[str, Turn]]:
    """What is asked with a number that none of it may have, and the word by which it is refused."""
    if value is not None:  # which leaves a delay, and brings back the rate of the scene
        yield "delay", lambda live: live.hold("virtual_environment.Lambda_inv", None, value)
        yield "rate", lambda live: live.rate("graphics", value)
    yield "jitter", lambda live: live.rate("graphics", 20, value)
    yield "seed", lambda live: live.rate("graphics", 20, 0.1, value)
    yield "ticks", lambda live: live.step(value)
    yield "hand.wrench", lambda live: live.set("hand.wrench", value)


def unknown(value: Any) -> Iterator[tuple[str, Turn]]:
    """The same with a name that there is not."""
    yield "", lambda live: live[value]
    yield "", lambda live: live.set(value, 1.0)
    yield "", lambda live: live.hold(value, "zoh")
    yield "", lambda live: live.hold("virtual_environment.Lambda_inv", value or 0)  # None leaves it
    yield "", lambda live: live.rate(value, 20.0)


REFUSED: list[tuple[str, Turn]] = [
    ("give 3 finite numbers", lambda live: live.set("hand.wrench", (1.0, 2.0))),
    ("give 3 finite numbers", lambda live: live.set("hand.wrench", (1.0, 2.0, np.nan))),
    ("no input or parameter 'wrong'", lambda live: live.set("hand.wrong", 1.0)),
    ("is fed by a connection", lambda live: live.set("controller.x_D", np.zeros(3))),
    ("is not tunable", lambda live: live.set("haptic_device.x_start", np.zeros(3))),
    ("did you mean 'hand'", lambda live: live["hands.F"]),
    ("did you mean 'zoh'", lambda live: live.hold("virtual_environment.P_c", "zohh")),
    ("spring", lambda live: live.hold("virtual_environment.P_c", "pspm")),
    ("connection with a hold", lambda live: live.hold("hand.F", "foh")),
    ("clock 'haptics'", lambda live: live.rate("haptics", 100.0)),
    ("up to that of the haptics", lambda live: live.rate("graphics", 600.0)),
    ("at 256 Hz give 0 to 0.5", lambda live: live.rate("graphics", 256.0, 0.6)),
    *(asked for value in NUMBERS for asked in changes(value)),
    *(asked for value in (None, 7, b"x", {"x": 1}, ["hand.F"], "x") for asked in unknown(value)),
]
"""What cannot be while a scene runs, by a part of the message."""


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    turn, refused = trying(*(ask for _, ask in REFUSED))
    made = ran("closed-loop-ideal", turn, "duration=0.2")
    assert len(refused) == len(REFUSED)
    assert [each for each in zip(REFUSED, refused, strict=True) if each[0][0] not in each[1]] == []
    assert made.fault is None
    assert made.run["end"]["reason"] == "stopped"
    assert made.run["real_time"]["changes"] == []


@pytest.mark.parametrize("every", [float("nan"), -1.0, "x"])
def test_turns_come_after_a_time(every: Any) -> None:
    with pytest.raises(InputFault, match="every"):
        hl.RealTime("pendulum").run(lambda live: None, every=every)


def test_before_a_run_there_is_nothing_to_read_or_change() -> None:
    live = hl.RealTime("closed-loop-ideal")
    asked: tuple[Callable[[], object], ...] = (
        lambda: live.time,
        lambda: live["hand.F"],
        live.energies,
        live.report,
        live.holds,
        live.reset,
        live.stop,
        live.step,
        lambda: live.system,
        lambda: live.rate("graphics", 10),
        lambda: live.hold("hand.F", "zoh"),
        lambda: live.set("hand.wrench", 0),
    )
    for ask in asked:
        with pytest.raises(InputFault, match="the scene does not run yet"):
            ask()


def test_outputs_are_read_and_a_parameter_is_set_from_the_next_step_on() -> None:
    read: dict[float, np.ndarray] = {}
    change = once(0.1, lambda live: live.set("hand.wrench", (1.0, 2.0, 0.5)))

    def turn(live: hl.RealTime) -> None:
        read[live.time] = live["hand.F"]
        change(live)

    made = ran("closed-loop-ideal", turn, "duration=0.2")
    wrench, times = made["hand.F"], made.time("hand.F")
    for time, value in read.items():
        assert np.array_equal(wrench[times == time][0], value)
    after = times > min(t for t in read if t >= 0.1)
    assert np.array_equal(np.unique(wrench[after], axis=0), [[1.0, 2.0, 0.5]])
    assert not (wrench[~after] == [1.0, 2.0, 0.5]).all(axis=1).any()


def test_a_spring_hand_pulls_to_where_it_is_moved() -> None:
    """F = K (target - x), as whoever holds a mouse has it."""
    hand = "hand={ type = 'spring', stiffness = [50.0, 50.0, 0.1], target = [[0, 0.1, 0, 0]] }"
    change = once(0.1, lambda live: live.set("hand.target", (0.3, 0.1, 0.0)))
    made = ran("closed-loop-ideal", change, hand, "duration=0.2")
    pull = made["hand.F"] / [50.0, 50.0, 0.1] + made["haptic_device.x_true"]
    moved = np.abs(pull[:, 0] - 0.3) < 1e-9
    assert np.allclose(pull[~moved], [0.1, 0.0, 0.0], rtol=0, atol=1e-12)
    assert np.allclose(pull[moved], [0.3, 0.1, 0.0], rtol=0, atol=1e-12)
    assert moved.sum() > 40


def test_an_input_of_an_fmu_beside_the_loop_is_set_before_its_next_step(tmp_path: Path) -> None:
    one, two = python_fmu(tmp_path, "One"), python_fmu(tmp_path, "Two", "self.y = self.u")
    text = '[[fmu]]\nname = "{}"\npath = "{}"\n'
    text = text.format("one", one) + text.format("two", two) + "rate = 32\n"
    path = scene(tmp_path, text, 512, 0.25)
    made = ran(str(path), once(0.07, lambda live: live.set("two.u", 3.0)))
    found = dict(zip(made.time("two.y"), made["two.y"], strict=True))
    assert found == {k / 32: 0.0 if k < 4 else 3.0 for k in range(9)}


def test_a_hold_is_changed_and_begins_with_the_newest_sample() -> None:
    """From the change on, the controller gets what a run with the other hold gives it: here the
    pose of a mechanism at the graphics rate, held and delayed by interpolation."""
    change = once(0.5, lambda live: live.hold("virtual_mechanism.x", "foh", delay=0.0))
    options = ("duration=1.0", "hold=zoh", "graphics.rate=32")
    made = ran("closed-loop-direct", change, *options)
    zoh = ran("closed-loop-direct", lambda live: None, *options)
    ((time, text),) = made.run["real_time"]["changes"]
    assert (0.5 <= time < 0.55, text) == (True, "hold of virtual_mechanism.x: foh, delay 0 s")
    same = (made["controller.F_drift"] == zoh["controller.F_drift"]).all(axis=1)
    frames = np.arange(0, 1.0, 1 / 32)
    second = frames[frames > time][0]  # until then foh has only one sample
    times = made.time("controller.F_drift")
    assert same[times <= second].all()
    assert not same[times > second].all()


def test_a_rate_is_changed_from_the_end_of_the_step_on() -> None:
    made = ran("closed-loop-ideal", once(0.1, lambda live: live.rate("graphics", 64.0)),
               "duration=0.3", "graphics.rate=32")  # fmt: skip
    want = [*(k / 32 for k in range(4)), *(k / 64 for k in range(8, 20))]
    assert made.graphics["time"].tolist() == want
    assert made.run["real_time"]["samples"]["graphics"]["late"] == 0


def test_a_rate_is_changed_as_by_a_scene_that_has_it_then() -> None:
    """A rate whose periods are no whole ticks, of which each end is the first tick after it."""
    made = ran("closed-loop-ideal", once(0.1, lambda live: live.rate("graphics", 37.3)),
               "duration=1.0", "graphics.rate=32")  # fmt: skip
    at = [{"time": 4 / 32, "set": {"graphics.rate": 37.3}}]
    again = hl.run("closed-loop-ideal", {"duration": 1.0, "graphics.rate": 32, "at": at})
    assert np.array_equal(made.graphics["time"], again.graphics["time"])


def test_a_rate_of_none_brings_back_the_steps_of_the_scene() -> None:
    """30 Hz, whose periods are no whole haptic ticks; the first is at least one such tick long."""
    turns = [once(0.1, lambda live: live.rate("graphics", 64.0)),
             once(0.2, lambda live: live.rate("graphics", None))]  # fmt: skip
    made = ran("closed-loop-ideal", lambda live: [turn(live) for turn in turns], "duration=0.35",
               "graphics.rate=30")  # fmt: skip
    time = made.graphics["time"]
    again = time[time > 0.23]
    assert np.array_equal(again, np.arange(7, 11) / 30)
    assert "rate of graphics: that of the scene" in made.run["real_time"]["changes"][1][1]


def test_jitter_moves_each_end_by_up_to_half_its_share_of_a_period() -> None:
    """Around the ends of a steady rate, on ticks, without drift, as NumPy draws them."""
    ends = {}
    for seed in (0, 0, 1):
        change = once(0.1, lambda live, s=seed: live.rate("graphics", 20.0, 0.5, s))
        made = ran("closed-loop-ideal", change, "duration=4.0", "graphics.rate=32")
        time = made.graphics["time"]
        off = 20 * (time[5:] - time[4] - np.arange(1, len(time) - 4) / 20)
        assert np.abs(off).max() < 0.25 + 20 / 512
        assert 0.12 < off.std() < 0.17  # uniform: 0.5 / sqrt(12) = 0.144
        drawn = np.random.Generator(np.random.PCG64(seed)).random(len(time) - 5)
        ends_in_ticks = 25.6 * (np.arange(1, len(time) - 4) + 0.5 * (drawn - 0.5))
        assert np.array_equal(time[5:] * 512, time[4] * 512 + np.ceil(ends_in_ticks))
        assert ends.setdefault(seed, time.tolist()) == time.tolist()
        assert "jitter 0.5" in made.run["real_time"]["changes"][0][1]
    assert ends[0] != ends[1]


def test_time_stands_still_in_a_pause_and_goes_on_by_steps() -> None:
    seen: list[float] = []
    clock = WallClock()

    def turn(live: hl.RealTime) -> None:
        seen.append(live.time)
        if len(seen) == 2:
            live.pause()
        if 5 <= len(seen) < 8:
            live.step(3)
        if len(seen) == 10:
            live.resume()

    made = ran("closed-loop-ideal", turn, "duration=0.2", clock=clock)
    ticks = np.array(seen) * 512
    assert (ticks[1:5] == ticks[1]).all()
    assert np.array_equal(np.diff(ticks[4:10]), [3, 3, 3, 0, 0])
    assert made.run["real_time"]["deadlines_missed"] == 0
    assert clock.time >= int(102e9 / 512) + 5 * 20 * MS
    assert np.array_equal(made.haptics["time"], np.arange(103) / 512)


def test_the_rate_of_a_spring_whose_energy_is_limited_is_not_changed(tmp_path: Path) -> None:
    """The tank would count with the period of the start."""
    varies = {"canHandleVariableCommunicationStepSize": "true"}
    body = python_fmu(tmp_path, "Body", "self.y = time + size")
    near = python_fmu(tmp_path, "Near", "self.y = self.u", **varies)  # type: ignore[arg-type]
    text = f"""
connection = [{{ from = "body.y", to = "near.u" }}]
spring = [{{ set_position = "near.u", position = "near.y", stiffness = [100.0] }}]
fmu = [
  {{ name = "body", path = "{body.name}" }},
  {{ name = "near", path = "{near.name}", rate = 64 }},
]
"""
    path = str(scene(tmp_path, text, 512, 0.25))
    turn, refused = trying(
        lambda live: live.rate(next(c.name for c in live.system.timeline.clocks[1:]), 32)
    )
    ran(path, turn)
    assert not refused
    ran(path, turn, "holds.near.u=pspm")
    (said,) = refused
    assert "`pspm` limits the energy of a spring of near" in said


def test_a_reset_begins_anew_with_changed_options() -> None:
    turn = once(0.05, lambda live: live.reset({"hold": "foh"}))
    made = ran("closed-loop-ideal", turn, "duration=0.1")
    assert made.run["end"]["reason"] == "duration"
    assert np.array_equal(made.haptics["time"], np.arange(52) / 512)
    assert "foh" in made.run["holds"].values()


ENERGY = (
    "holds.virtual_mechanism.F_drift=passive",
    *(f"holds.controller.{end}=pspm" for end in ("x_S", "v_S")),
)


def test_the_hold_of_a_force_whose_energy_another_hold_shares_is_not_changed() -> None:
    turn, refused = trying(lambda live: live.hold("virtual_mechanism.F_drift", "zoh"))
    ran("closed-loop-direct", turn, *ENERGY)
    (said,) = refused
    assert "share its energy" in said


def test_a_gain_of_the_spring_whose_energy_is_limited_is_not_changed() -> None:
    """The tank would count the force of the gain before it. Where nothing is limited it is."""
    stiff = (3000.0, 3000.0, 3.0)
    turn, refused = trying(
        lambda live: live.set("controller.K_pc", stiff),
        lambda live: live.set("controller.B_pc", stiff),
        lambda live: live.set("controller.k_j", 100.0),
    )
    ran("closed-loop-direct", turn)
    assert not refused
    ran("closed-loop-direct", turn, *ENERGY)
    assert ["whose energy `pspm` limits" in said for said in refused] == [True, True]


def due(time: float) -> int:
    return round(1e9 * time)


@pytest.mark.parametrize("speed", [0.25, 1.0, 8.0])
def test_a_run_takes_its_duration_over_the_speed(bar, tmp_path, speed):
    clock = WallClock()
    run = simulate(str(bar), tmp_path, real_time=clock.run(speed=speed)).run
    assert run["fault"] is None
    assert clock.time == due(run["end"]["time"] / speed)
    assert (run["real_time"]["speed"], run["real_time"]["deadlines_missed"]) == (speed, 0)
    said = summary.deadlines(run["real_time"])
    assert ("512 Hz in real time" in said) == (speed == 1.0)
    assert (f"at {speed:g} times real time" in said) == (speed != 1.0)


def test_the_speed_changes_from_now_on(bar):
    changed: list[float] = []

    def slow(live: hl.RealTime) -> None:
        changed.append(live.time)
        live.speed = 0.5

    clock = WallClock()
    run = ran(str(bar), once(0.1, slow), clock=clock)
    end = run.run["end"]["time"]
    assert clock.time == pytest.approx(due(changed[0] + (end - changed[0]) / 0.5), abs=1)
    assert run.run["real_time"]["changes"] == [(changed[0], "speed: 0.5")]


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), 1e4, True])
def test_a_speed_that_is_none(bar, speed):
    with pytest.raises(InputFault, match=r"speed = .*: give a number"):
        hl.RealTime(bar, speed=speed)


def test_a_speed_needs_real_time_and_no_hardware(bar, tmp_path):
    with pytest.raises(InputFault, match="add real_time"):
        hl.run(bar, speed=0.5)
    python_fmu(tmp_path, "Drives")
    path = scene(tmp_path, '[[fmu]]\nname = "board"\npath = "Drives.fmu"\nhardware = true\n')
    found = hl.run(path, real_time=True, speed=0.5)
    assert "speed = 0.5: board drives hardware, whose time is the clock's: take 1" in found.fault
