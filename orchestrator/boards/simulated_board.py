"""A board that is a process: the firmware of the open teaching kit on a pseudo-terminal, with a
device and a hand that are simulated beside it. It shares nothing with the driver of that protocol.

`simulated_plant.py` has it in a process. The firmware is that of
version 1.5.0 (docs/your-device.md), with two things that a board should have: motors are without
torque WATCHDOG after the last torques, and while a torque is not finite.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Protocol

WATCHDOG = 0.04
"""Time (s) after the last torques, from which on there are none."""
KIT_LIMIT = 0.123
"""Torque (N.m) at which the firmware clips, MAX_TORQUE: that of the kit's motors."""
CONNECTORS = 4


class Plant(Protocol):
    """What motors and encoders are fixed to."""

    def advance(self, seconds: float, torques: Sequence[float]) -> Sequence[float]:
        """Go on to a time (s) with the torques (N.m) of the connectors held, and return the angles
        (rad) of the encoders there."""


class Firmware:
    """What the board does with bytes. watchdog: whether it has one; limit: of a
    torque (N.m)."""

    def __init__(self, plant: Plant, watchdog: bool = True, limit: float = KIT_LIMIT) -> None:
        self._plant, self._watchdog, self._limit = plant, watchdog, limit
        self._bytes = b""
        self._motors: list[int] = []
        self._reversed: dict[int, bool] = {}
        self._encoders: dict[int, tuple[bool, int, float]] = {}
        """By connector: whether it counts backwards, its counts at the set-up less those of its
        angle then, and its counts of a turn."""
        self._fresh = -math.inf
        self.torques = [0.0] * CONNECTORS
        self.angles = list(plant.advance(0.0, self.torques))
        self.messages = 0
        """Messages of torques since the set-up."""

    def at(self, now: float) -> None:
        """What happens by a time (s) on its own: the device moves, the watchdog acts."""
        expired = self._fresh + WATCHDOG
        if self._watchdog and expired <= now and any(self.torques):
            self.angles = list(self._plant.advance(expired, self.torques))
            self.torques = [0.0] * CONNECTORS
        self.angles = list(self._plant.advance(now, self.torques))

    def take(self, received: bytes, now: float) -> bytes:
        """What the board answers to bytes that come at a time (s)."""
        self.at(now)
        self._bytes += received
        answers = b""
        while (size := self._size()) and len(self._bytes) >= size:
            message, self._bytes = self._bytes[:size], self._bytes[size:]
            answers += self._obey(message, now)
        return answers

    def _size(self) -> int:
        """The number of bytes of the message that has begun, 0 where that is not known yet."""
        given = self._bytes
        if not given:
            return 0
        kind = given[0]
        if kind == 0:
            return 2
        if kind == 2:
            return 2 + 4 * len(self._motors)
        if kind != 1:
            return 1  # the firmware reads on, byte by byte
        at, encoders = 2, 0
        for _which in range(2):
            if len(given) <= at:
                return 0
            encoders = bin(given[at] & 0b1111).count("1")
            at += 1 + encoders
        for _ in range(2):  # sensors, free outputs
            if len(given) <= at:
                return 0
            at += 1 + given[at]
        return at + 8 * encoders

    def _obey(self, message: bytes, now: float) -> bytes:
        kind = message[0]
        if kind == 0:
            self._motors, self._encoders = [], {}
            self.torques = [0.0] * CONNECTORS
        elif kind == 1:
            self._set_up(message)
        elif kind == 2:
            return self._drive(message, now)
        return b""

    def _set_up(self, message: bytes) -> None:
        at, found = 2, list[list[tuple[int, int]]]()
        for _ in range(2):
            mask = message[at]
            connectors = [i for i in range(CONNECTORS) if mask >> i & 1]
            turned = message[at + 1 : at + 1 + len(connectors)]
            found.append([*zip(connectors, turned, strict=True)])
            at += 1 + len(connectors)
        at += 1 + message[at]
        at += 1 + message[at]
        self._motors = [connector for connector, _ in found[0]]
        self._reversed = {connector: turned == 1 for connector, turned in found[0]}
        self._encoders, self.messages = {}, 0
        for connector, direction in found[1]:
            offset, counts = struct.unpack_from("<ff", message, at)
            at += 8
            start = int(offset * counts / 360)  # which cuts off
            zero = self._counted(connector, direction == 1, counts) - start
            self._encoders[connector] = direction == 1, zero, counts

    def _counted(self, connector: int, turned: bool, counts: float) -> int:
        turns = self.angles[connector] / math.tau
        return round((-turns if turned else turns) * counts)

    def _drive(self, message: bytes, now: float) -> bytes:
        asked = struct.unpack_from(f"<{len(self._motors)}f", message, 2)
        if not all(map(math.isfinite, asked)):
            asked = (0.0,) * len(asked)
        for connector, torque in zip(self._motors, asked, strict=True):
            clipped = math.copysign(min(abs(torque), self._limit), torque)
            self.torques[connector] = -clipped if self._reversed[connector] else clipped
        self._fresh = now
        self.messages += 1
        angles = (
            360.0 * (self._counted(connector, turned, counts) - zero) / counts
            for connector, (turned, zero, counts) in sorted(self._encoders.items())
        )
        return struct.pack(f"<B{len(self._encoders)}f", message[1], *angles)
