"""The protocol of the open kit, driver and firmware each against byte traces that were written from
the firmware's source (Haply_Arduino_Firmware 1.5.0, setup_device, write_states, read_states)."""

from __future__ import annotations

import math
import os
import socket
import sys
import threading

import pytest

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.driver import SOCKET, Silent
from hapticlink.orchestrator.boards.open_kit import OpenKit
from hapticlink.orchestrator.boards.simulated_board import WATCHDOG, Firmware
from tests.orchestrator.boards.kits import TWO_MOTORS, Port, Still, kit

RESET = bytes.fromhex("00 05")
SET_UP = bytes.fromhex(
    "01 05"
    "03 00 01"  # motors at connectors 1 and 2: direction 0 and 1
    "03 00 01"  # encoders likewise
    "00 00"  # no sensors, no free outputs
    "00 00 44 41  00 00 b4 43"  # connector 1: offset 12.25 degrees (12 counts and a quarter), 360
    "00 80 b4 c2  00 00 b4 43"  # connector 2: -90.25, 360
)
TORQUES = bytes.fromhex("02 05  cd cc 4c bd  cd cc cc 3d")  # connector 1: -.05, 2: .1 N.m
ANSWER = bytes.fromhex("05  00 00 40 41  00 00 b4 c2")  # 12 and -90 degrees


def test_what_the_driver_sends() -> None:
    driver = OpenKit("port", TWO_MOTORS)
    assert driver.set_up() == SET_UP
    assert driver.message([0.1, -0.05]) == TORQUES  # in the order of the device's motors


def test_what_the_driver_reads() -> None:
    assert OpenKit("port", TWO_MOTORS).counts(ANSWER) == [-90.0, 12.0]


def test_what_the_firmware_does() -> None:
    plant = Still(0.3, -0.7)  # wherever the device is when it is set up
    board = Firmware(plant)
    assert board.take(RESET, 0.0) == board.take(SET_UP, 0.1) == b""
    assert board.take(TORQUES, 0.2) == ANSWER
    assert board.torques[:2] == pytest.approx([-0.05, -0.1], abs=1e-8)  # the second is turned
    plant.angles = [0.3 + math.radians(3), -0.7 + math.radians(2), 0, 0]
    answer = OpenKit("port", TWO_MOTORS).counts(board.take(TORQUES, 0.3))
    assert answer == [-92.0, 15.0]  # turned likewise


@pytest.mark.parametrize("cut", range(1, len(RESET + SET_UP + TORQUES)))
def test_the_firmware_takes_messages_in_parts(cut: int) -> None:
    whole, board = RESET + SET_UP + TORQUES, Firmware(Still())
    assert board.take(whole[:cut], 0.0) + board.take(whole[cut:], 0.0) == ANSWER


def test_the_firmware_clips_and_takes_no_nan() -> None:
    board = Firmware(Still())
    board.take(RESET + SET_UP, 0.0)
    board.take(bytes.fromhex("02 05  00 00 80 3f  00 00 80 bf"), 0.0)
    assert board.torques[:2] == [0.123, 0.123]
    board.take(bytes.fromhex("02 05  00 00 c0 7f  00 00 80 3f"), 0.0)  # NaN for connector 1
    assert board.torques[:2] == [0.0, 0.0]


@pytest.mark.parametrize("watchdog", [True, False])
def test_the_watchdog_takes_the_torque_away(watchdog: bool) -> None:
    board = Firmware(Still(), watchdog)
    board.take(RESET + SET_UP + TORQUES, 1.0)
    board.at(1.0 + WATCHDOG - 1e-4)
    assert any(board.torques)
    board.at(1.0 + WATCHDOG + 1e-4)
    assert any(board.torques) != watchdog
    assert WATCHDOG <= 0.05


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("07  00 00 40 41  00 00 b4 c2", "has answered for device 7, not 5"),
        ("05  00 00 20 41  00 00 b4 40", "5.625 degrees for encoder 1, which are no whole counts"),
        ("05  00 00 c0 7f  00 00 b4 c2", "nan degrees for encoder 2"),
        ("05  00 00 80 7f  00 00 b4 c2", "inf degrees for encoder 2"),
    ],
)
def test_answers_that_make_no_sense(answer: str, said: str) -> None:
    with pytest.raises(Silent, match=said):
        OpenKit("port", TWO_MOTORS).counts(bytes.fromhex(answer))


def test_an_answer_that_is_not_whole() -> None:
    port = Port(Firmware(Still()))
    driver = kit(port)("port", TWO_MOTORS)
    driver.open()
    with pytest.raises(Silent, match="has sent no answer within 1 ms"):
        driver.receive(1e-3)
    port.garbled_at = 0
    driver.send([0.0, 0.0])
    with pytest.raises(Silent, match="has sent 8 of 9 bytes of an answer"):
        driver.receive(1e-3)


def test_a_board_that_lost_bytes_takes_three_messages_of_zero_as_no_torque() -> None:
    zero = OpenKit("port", TWO_MOTORS).message([0.0, 0.0])
    for cut in range(1, len(TORQUES)):
        board = Firmware(Still())
        board.take(RESET + SET_UP + TORQUES + TORQUES[cut:] + 3 * zero, 0.0)
        assert max(map(abs, board.torques)) < 1e-30, cut


@pytest.mark.skipif(os.name != "posix", reason="a pseudo-terminal stands for the serial port")
@pytest.mark.parametrize("kind", ["terminal", "socket"])
def test_a_port_of_this_computer(kind: str) -> None:
    """Serial ports, and boards behind a socket, by the bytes that come out of them."""
    if kind == "terminal":
        board, other = os.openpty()
        port = os.ttyname(other)
    else:
        server = socket.create_server(("127.0.0.1", 0))
        port = f"{SOCKET}127.0.0.1:{server.getsockname()[1]}"
    firmware = Firmware(Still())

    def serve() -> None:
        end = server.accept()[0].detach() if kind == "socket" else board
        while firmware.messages < 2:
            os.write(end, firmware.take(os.read(end, 100), 0.0))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    driver = OpenKit(port, TWO_MOTORS)
    driver.open()
    if kind == "terminal":
        with pytest.raises(OSError, match="exclusively lock port"):  # it has one host at a time
            OpenKit(port, TWO_MOTORS).open()
    for torques in ([0.1, -0.05], [0.0, 0.0]):
        driver.send(torques)
        assert driver.receive(5.0) == [-90.0, 12.0]
    thread.join()
    driver.close()
    assert not any(firmware.torques)


def test_a_port_that_is_not_there_and_a_missing_package(monkeypatch) -> None:
    with pytest.raises(OSError, match="/dev/nothing"):
        OpenKit("/dev/nothing", TWO_MOTORS).open()
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(
        InputFault, match=r'serial ports need pyserial: pip install "hapticlink\[board\]"'
    ):
        OpenKit("/dev/nothing", TWO_MOTORS).open()
