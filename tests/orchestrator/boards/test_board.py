"""Runs with a board in the place of the device: what they send to it, and that every fault leaves
it without torque."""

from __future__ import annotations

import math
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.summary import lines
from hapticlink.analysis.fit.log import read_log
from hapticlink.api.runs import with_board
from hapticlink.components.device.models import device_model
from hapticlink.orchestrator.boards import DRIVERS
from hapticlink.orchestrator.boards.safe_torques import SafeTorques
from hapticlink.orchestrator.boards.simulated_board import Firmware
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.run.real_time import RealTimeRun
from tests.orchestrator.boards.kits import Port, Still, kit
from tests.orchestrator.wall_clock import MS, WallClock

SCENE = {**with_board("/dev/kit"), "duration": 0.125, "graphics.rate": 64}
TICKS = 64
SPREAD = 25
"""Ticks at which each fault is tried in the slow test."""


def away(port: Port) -> None:
    """A handle that is 4 mm from the linkage, so that there are torques: two encoders are some
    counts off."""
    port.firmware._plant.angles = [0.03, -0.03, 0.0, 0.0]  # type: ignore[attr-defined]


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[Port]:
    there = Port(Firmware(Still(), limit=0.5))
    monkeypatch.setitem(DRIVERS, "open-kit", kit(there))
    yield there
    there.close()


def ran(port: Port, tmp_path, real_time: RealTimeRun | None = None, **options) -> Experiment:  # type: ignore[no-untyped-def]
    """A run in which the handle is 4 mm off from its second message of torques on."""
    write, begun = port.write, False

    def moved(message: bytes) -> None:
        nonlocal begun
        write(message)
        if not begun and port.firmware.messages:
            begun = True
            away(port)

    port.write = moved  # type: ignore[method-assign]
    options = SCENE | options
    return simulate(
        "closed-loop", tmp_path / "run", options, real_time=real_time or WallClock().run()
    )


def is_at_rest(port: Port) -> bool:
    """Whether there were torques, and none at the end, in each of its three messages."""
    *before, a, b, c = port.torques
    return any(map(any, before)) and not (any(a) or any(b) or any(c)) and port.closed


def test_a_whole_run(port, tmp_path):
    ended = ran(port, tmp_path, **{"device.driver.torque_rate": 1e6})
    assert ended.outcome.fault is None
    assert ended.outcome.reason == "duration"
    assert is_at_rest(port)
    rows = ended.results.haptics
    sent = rows["motor_map.tau"]  # over the step that begins
    assert np.array_equal(rows["haptic_device.tau_applied"][1:], sent[:-1])
    resolution = 0.0015707963267948966
    assert np.array_equal(rows["haptic_device.q"], rows["haptic_device.counts"] * resolution)
    assert rows["haptic_device.sent_at"][1:].tolist() == sorted(rows["haptic_device.sent_at"][1:])
    assert not any(name.startswith("hand.") for name in rows)
    # All that the board has got are those torques, rounded to 32 bits.
    got = [t for t, kind in zip(port.torques, port.sent, strict=True) if kind[0] == 2]
    assert np.allclose(got[1:-3:2], sent[:-1], rtol=1e-6, atol=0)
    assert got[2:-3:2] == got[1:-3:2]  # once more, to ask for the angles


def fault_at(port: Port, kind: str, tick: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """Have a fault come at a tick; returns what is said of it."""
    if kind == "silence":
        port.silent_from = tick
        return "has sent no answer within 50 ms: torques are zero"
    if kind == "lost bytes":
        port.garbled_at = tick
        return "bytes were lost|of 17 bytes"
    if kind == "jump":
        port.jump_at = tick
        return "encoder 1 has jumped by .* rad in .* ms"
    limit, calls, write = SafeTorques.limit, iter(range(10**6)), port.write
    if kind == "nan":

        def poisoned(self: SafeTorques, torques: list[float], step: float) -> list[float]:
            return limit(self, [math.nan, *torques[1:]] if next(calls) == tick else torques, step)

        monkeypatch.setattr(SafeTorques, "limit", poisoned)
        return "torques are .*nan.*: not finite: torques are zero"

    def interrupted(message: bytes) -> None:
        number = next(calls)
        if number == tick + 3 and kind == "signal":
            signal.raise_signal(signal.SIGINT)
        if number == tick + 3 and kind == "gone":
            raise OSError(5, "Input/output error")
        write(message)

    port.write = interrupted  # type: ignore[method-assign]
    return {"signal": "interrupted", "gone": "cannot be reached: .*Input/output error"}[kind]


KINDS = ("silence", "lost bytes", "jump", "nan", "signal", "gone")


@pytest.mark.parametrize("kind", KINDS)
def test_no_torque_after_a_fault(port, tmp_path, monkeypatch, kind):
    check_fault(port, tmp_path, monkeypatch, kind, 20)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tick", random.Random(45).sample(range(8, TICKS - 4), SPREAD))
def test_no_torque_after_a_fault_at_any_tick(port, tmp_path, monkeypatch, kind, tick):
    check_fault(port, tmp_path, monkeypatch, kind, tick)


def check_fault(port, tmp_path, monkeypatch, kind: str, tick: int) -> None:
    said = fault_at(port, kind, tick, monkeypatch)
    ended = ran(port, tmp_path)
    fault = ended.outcome.fault
    assert fault is not None
    assert_matches(said, str(fault))
    assert is_at_rest(port)
    # At most the torques of the tick at which it came were sent after it.
    first = next(i for i in range(len(port.torques)) if not any(map(any, port.torques[i:])))
    assert first <= 2 * tick + 8
    assert len(ended.results.haptics["time"]) >= tick // 2 - 2  # nothing is lost


def assert_matches(pattern: str, text: str) -> None:
    with pytest.raises(ValueError, match=pattern):
        raise ValueError(text)


def test_a_board_that_is_gone_is_not_said_to_be_at_rest(port, tmp_path):
    write = port.write

    def unplugged(message: bytes) -> None:
        if port.firmware.messages > 20:
            raise OSError(5, "Input/output error")
        write(message)

    port.write = unplugged
    told = str(ran(port, tmp_path).outcome.fault)
    assert "Input/output error: torques may be on: switch the motors off" in told


@pytest.mark.parametrize(("limit", "told"), [(1e-3, True), (0.5, False)])
def test_less_torque_than_was_asked_for_is_told(port, tmp_path, limit, told):
    options = {"device.driver.torque_limit": limit, "device.driver.torque_rate": 1e6}
    said = [*lines(ran(port, tmp_path, **options).results)]
    assert any("the board was sent less torque than was asked for" in line for line in said) == told


def test_a_turn_that_fails_leaves_no_torque(port, tmp_path):
    def turn(simulation: object, loop: object) -> None:
        if port.firmware.messages > 20:
            raise hl.InputFault("enough")

    clock = WallClock()
    ended = ran(port, tmp_path, RealTimeRun(turn, clock, clock.wait))
    assert str(ended.outcome.fault) == "enough"
    assert is_at_rest(port)


def test_late_ticks_are_skipped(port, tmp_path):
    ended = ran(port, tmp_path, WallClock(late={41 * MS: 5 * MS}).run())
    assert ended.outcome.fault is None
    told = ended.run["real_time"]
    assert told["skipped"] > 0
    # The first question, two messages a tick that was not skipped, the three at the end
    assert port.firmware.messages == 1 + 2 * (TICKS - told["skipped"]) + 3


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"haptics.rate": 128}, "128 Hz: a board is to be without torque within 5 ms"),
        ({"sensing": "ideal"}, "a board has encoders: take sensing = 'encoders'"),
        ({"device.observer.beside": False}, "a board has no observer in it: take beside = true"),
        ({"device.driver.type": "open"}, "no driver 'open'; there are open-kit"),
    ],
)
def test_boards_that_do_not_fit(options, said):
    with pytest.raises(hl.InputFault, match=said):
        hl.scene("closed-loop", SCENE | options)


def test_wiring_that_does_not_fit(port, tmp_path):
    for options, said in (
        (
            {"device.driver.counts": [4000]},
            r"device.driver.counts: the device has 4 encoders: give 4",
        ),
        ({"device.driver.motor_connectors": [1, 2, 2, 3]}, "two of them share a connector"),
        ({"device.driver.motor_signs": [1, 0, 1, 1]}, "give 1 or -1 for each"),
    ):
        with pytest.raises(hl.InputFault, match=said):
            ran(port, tmp_path, **options)
    assert not port.sent


@pytest.mark.parametrize("act", [hl.run, hl.stability])
def test_nothing_but_a_run_in_real_time_opens_a_port(port, act):
    with pytest.raises(
        hl.InputFault, match=r"device.driver.port: it is moved by runs in real time"
    ):
        act("closed-loop", SCENE)
    assert not port.sent


def test_a_handle_elsewhere_ends_the_run_before_it_begins(port, tmp_path):
    ended = ran(port, tmp_path, **{"device.driver.home": [0.0, 0.0, 0.0, 0.0]})
    assert_matches(
        "rad from where the scene starts: move the handle there", str(ended.outcome.fault)
    )
    assert not any(map(any, port.torques))


@pytest.mark.parametrize("error", [ValueError("no port in ''"), OSError("refused")])
def test_what_a_driver_raises_when_it_opens_is_told(port, tmp_path, monkeypatch, error):
    """A driver whose `close` needs what `open` would have made."""

    class Half(kit(port)):  # type: ignore[misc]
        def open(self) -> None:
            raise error

        def close(self) -> None:
            self.never_made.close()

    monkeypatch.setitem(DRIVERS, "open-kit", Half)
    if isinstance(error, OSError):
        assert "cannot be reached: refused" in str(ran(port, tmp_path).outcome.fault)
    else:
        with pytest.raises(ValueError, match="no port in"):
            ran(port, tmp_path)


def test_limits() -> None:
    safe = SafeTorques(most=0.1, rate=10.0, motors=2)
    assert safe.limit([0.5, -0.25], 2e-3) == pytest.approx([0.02, -0.01])  # the rate; one factor
    assert safe.limit([0.5, -0.25], 2e-3) == pytest.approx([0.04, -0.02])
    assert safe.limit([-0.5, 0.0], 2e-3) == pytest.approx([-0.02, 0.0])  # through zero
    for _ in range(9):
        safe.limit([0.5, 0.5], 2e-3)
    assert safe.limit([0.5, 0.5], 2e-3) == pytest.approx([0.1, 0.1])
    assert safe.limit([0.01, 0.0], 2e-3) == [0.01, 0.0]  # falls at once
    with pytest.raises(ValueError, match="not finite"):
        safe.limit([math.nan, 0.0], 2e-3)
    assert safe.rest() == [0.0, 0.0]


@pytest.mark.skipif(os.name != "posix", reason="file descriptors are passed on")
@pytest.mark.parametrize("killed", [True, False])
def test_a_killed_process_leaves_a_message(killed: bool) -> None:
    reading, writing = os.pipe()
    program = (
        "import os, sys\n"
        "from hapticlink.orchestrator.boards.zero_torque_when_killed import write_if_killed\n"
        "with write_if_killed(int(sys.argv[1]), b'zero'):\n"
        "    os.write(1, b'ready')\n" + ("    os.kill(os.getpid(), 9)\n" if killed else "")
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, str(writing)], stdout=subprocess.PIPE, pass_fds=(writing,)
    ) as process:
        assert process.stdout
        assert process.stdout.read() == b"ready"
    os.close(writing)
    assert os.read(reading, 10) == (b"zero" if killed else b"")
    os.close(reading)


def test_a_pause_leaves_no_torque(port):
    """A paused run sends none, and goes on from there."""
    paused: list[int] = []

    def turn(live: hl.RealTime) -> None:
        port_messages = port.firmware.messages
        if not paused and port_messages > 10:
            away(port)
            live.pause()
            paused.append(port_messages)
        elif live.paused:
            assert not any(port.torques[-1])
            live.resume()

    live = hl.RealTime("closed-loop", SCENE | {"device.driver.silence": 0.05})
    run = live.run(turn, tables=False)
    assert paused
    assert run.fault is None, run.fault


def test_a_key_is_seen_within_a_tick(port):
    """It is asked for at every tick, not every 20 ms."""
    pressed: list[int] = []

    def stop() -> bool:
        away(port)
        if any(port.torques[-1]) and port.firmware.messages > 30:
            pressed.append(len(port.torques))
        return bool(pressed)

    asked: list[int] = []
    run = hl.run("closed-loop", SCENE, real_time=True, stop=lambda: bool(asked.append(0) or stop()))
    assert run.fault is None
    assert run.record.end.reason == "stopped"
    assert len(asked) >= len(run["observer.x"]) - 2
    assert port.torques[pressed[0] :] == [[0.0] * 4] * 3


def moving(port: Port) -> None:
    """A device whose handle is moved along a curve."""

    def advance(seconds: float, torques: list[float]) -> list[float]:
        way = 0.02 * math.sin(40 * seconds)
        return [way, -way, 0.5 * way, 0.0]

    port.firmware._plant.advance = advance  # type: ignore[method-assign,attr-defined]


@pytest.mark.parametrize("late", [{}, {41 * MS: 5 * MS, 90 * MS: 8 * MS}])
def test_a_log_replays_to_the_same_bits(port, tmp_path, late):
    """Every number of every table, of observer, controller and mechanism; late ticks are skipped
    again."""
    moving(port)
    scene = hl.scene("closed-loop", SCENE)
    before = simulate(scene, tmp_path / "before", real_time=WallClock(late=late).run())
    assert before.outcome.fault is None
    told = port.firmware.messages
    assert (before.run["real_time"]["skipped"] > 0) == bool(late)
    after = hl.run(scene, out=tmp_path / "after", figures=False, arrivals=tmp_path / "before")
    assert after.fault is None
    assert port.firmware.messages == told  # no port is opened
    for table in ("haptics.csv", "graphics.csv"):
        one, two = ((tmp_path / run / table).read_bytes() for run in ("before", "after"))
        assert one == two
    again = after.run["real_time"]
    assert again["skipped"] == before.run["real_time"]["skipped"]


def test_a_log_without_what_the_board_measured(port, tmp_path):
    options = SCENE | {"record.signals": ["observer"]}
    simulate("closed-loop", tmp_path / "before", options, real_time=WallClock().run())
    with pytest.raises(hl.InputFault, match=r"haptic_device.q was not recorded"):
        hl.run("closed-loop", options, arrivals=tmp_path / "before")


def test_what_is_said_of_a_board(port, tmp_path):
    """Its handle is the measured one; no energy is told of a hand whose work is not known."""
    moving(port)
    run = hl.run("closed-loop", SCENE, out=tmp_path / "run", figures=False, real_time=True)
    said = str(run)
    assert "the handle is told where the observer sees it" in said
    assert "not passive" not in said
    point, seen = run["virtual_mechanism.x"], run["observer.x"]
    apart = 1e3 * np.hypot(*(point - seen)[:, :2].T)
    assert np.array_equal(run.tracking().distance_mm, apart)
    simulated = hl.run("closed-loop", {"duration": 0.05, "device.observer.beside": True})
    assert "where the observer sees it" not in str(simulated)


def test_a_log_with_skipped_ticks_can_be_fitted(port, tmp_path):
    """The longest stretch without one is read."""
    moving(port)
    clock = WallClock(late={41 * MS: 5 * MS})
    simulate("closed-loop", tmp_path, SCENE | {"duration": 0.7}, real_time=clock.run())
    log = read_log(tmp_path)
    assert log.period == pytest.approx(1 / 512)
    assert 300 < len(log.pose) < 358
    assert log.hand is None


def test_the_linkage_starts_at_the_handle(port, tmp_path):
    """A board that is started in its home pose, and held elsewhere then."""
    kit = SCENE | {"device.extends": "2diy", "controller.bias": "full"}
    device = hl.scene("closed-loop", kit).device
    model = device_model(device)
    y = ca.SX.sym("y", 2)
    angles = ca.Function("angles", [y], [model.angles(y, model.numbers)])
    place = np.array([0.035, 0.02])
    home, there = (np.array(angles(at)).ravel() for at in (model.start_place, place))
    said: list[str] = []

    def ready(what: str) -> None:
        said.append(what)
        if len(said) == 2:
            port.firmware._plant.angles = [*(there - home), 0.0, 0.0]  # type: ignore[attr-defined]

    options = kit | {"device.driver.home": home.tolist()}
    run = hl.run("closed-loop", options, out=tmp_path, figures=False, real_time=True, ready=ready)
    assert run.fault is None
    assert len(said) == 2
    assert run["virtual_mechanism.x"][0, :2] == pytest.approx(place, abs=1e-4)
    assert run["observer.x"][0, :2] == pytest.approx(place, abs=1e-4)
    assert not any(port.torques[-1])


def test_a_handle_that_the_linkage_does_not_reach(port, tmp_path):
    kit = SCENE | {"device.extends": "2diy"}
    model = device_model(hl.scene("closed-loop", kit).device)
    y = ca.SX.sym("y", 2)
    angles = ca.Function("angles", [y], [model.angles(y, model.numbers)])
    home = np.array(angles([0.0, 0.065])).ravel().tolist()
    with pytest.raises(hl.InputFault, match=r"does not reach the handle at .* within"):
        hl.run("closed-loop", kit | {"device.driver.home": home}, real_time=True)
    assert not any(map(any, port.torques))
    assert port.closed
