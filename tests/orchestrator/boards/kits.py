"""A board of the open kit within the process of a test: its firmware behind a port that is no file,
so that messages are counted, not timed."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

from hapticlink.orchestrator.boards.driver import Wiring
from hapticlink.orchestrator.boards.open_kit import OpenKit
from hapticlink.orchestrator.boards.simulated_board import Firmware


class Still:
    """A device that nobody moves, at these angles (rad) of the connectors."""

    def __init__(self, *angles: float) -> None:
        self.angles = [*angles, *[0.0] * (4 - len(angles))]

    def advance(self, seconds: float, torques: Sequence[float]) -> Sequence[float]:
        return self.angles


class Port:
    """A serial port with a firmware behind it. sent: all that was written, message by message;
    fault: called with their number before each is taken, and may change what comes back."""

    def __init__(self, firmware: Firmware) -> None:
        self.firmware = firmware
        self.sent: list[bytes] = []
        self.torques: list[list[float]] = []
        self.silent_from = self.jump_at = math.inf
        self.garbled_at = math.inf
        self.closed = False
        self._answers = b""
        self._now = 0.0
        self._never, self._end = os.pipe()

    def write(self, message: bytes) -> None:
        self.sent.append(message)
        self._now += 1 / 512
        number = self.firmware.messages
        if number >= self.jump_at:
            self.firmware._plant.angles = [a + 1.0 for a in self.firmware._plant.angles]  # type: ignore[attr-defined]
            self.jump_at = math.inf
        answer = self.firmware.take(message, self._now)
        if number >= self.garbled_at:
            answer = answer[1:]
        if number < self.silent_from:
            self._answers += answer
        self.torques.append([*self.firmware.torques])

    def read(self, size: int) -> bytes:
        given, self._answers = self._answers[:size], self._answers[size:]
        return given

    def reset_input_buffer(self) -> None:
        self._answers = b""

    def fileno(self) -> int:
        return self._never

    def close(self) -> None:
        if not self.closed:
            os.close(self._never)
            os.close(self._end)
        self.closed = True


def kit(port: Port) -> type[OpenKit]:
    """The driver of the open kit at that port."""

    class AtPort(OpenKit):
        def open(self) -> None:
            self._serial = port  # type: ignore[assignment]
            self._write(bytes([0, 5]))
            self._write(self.set_up())

        def zero_torque_when_killed(self) -> None:
            return None

    return AtPort


TWO_MOTORS = Wiring(
    counts=(360.0, 360.0),
    home=(math.radians(-90), math.radians(12)),
    motors=((2, -1), (1, 1)),
    encoders=((2, -1), (1, 1)),
)
"""Of motors and encoders whose second is at connector 1."""
