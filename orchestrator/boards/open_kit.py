"""The serial protocol of the open two-motor teaching kit, by its published firmware
(Haply_Arduino_Firmware, version 1.5.0, for boards of the Arduino Due class): hosts ask, the board
answers one message alone.

    host: 0, id                                                    forget all motors and encoders
    host: 1, id, M, m.., E, e.., S, P, (offset, counts)..          set up
    host: 2, id, torque..                                          set torques
    board: id, angle..                                             answer to 2

Bytes, and little-endian 32-bit floats for offset (degrees), counts (of a turn), torque (N.m) and
angle (degrees). M and E are masks of connectors (bit 0 is connector 1), m and e the direction of
each of them, 0 or 1, in the order of connectors; S and P are numbers of sensors and of free
outputs, which a device has none of. Torques and angles come in the order of connectors. An angle is
360 n / counts of the whole number n of counts, so that n is known.

There is neither a check sum nor a mark of a message's beginning: an answer of another id or length,
or angles that are no whole counts, end the run. The firmware turns motors of connectors 2 and 4 the
other way itself, clips torques at .123 N.m, and has no watchdog.
"""

from __future__ import annotations

import math
import os
import socket
import struct
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.boards.driver import SOCKET, DeviceDriver, Silent, Wiring

if TYPE_CHECKING:
    from serial import Serial

ID = 5
"""Of the device, as in the kit's own examples."""
RESET, SET_UP, TORQUES = 0, 1, 2
SETTLED = 0.05
"""Time (s) after the set-up for which the board is left alone, and bytes are thrown away."""
WHOLE = 0.05
"""Counts by which an angle may differ from a whole number of them: half a thousandth is what a
32-bit float of some turns leaves."""


class OpenKit(DeviceDriver):
    """A board that speaks the kit's protocol."""

    _serial: Serial | None = None

    def __init__(self, port: str, wiring: Wiring) -> None:
        super().__init__(port, wiring)
        self._motors = sorted(range(len(wiring.motors)), key=lambda i: wiring.motors[i][0])
        self._encoders = sorted(range(len(wiring.encoders)), key=lambda i: wiring.encoders[i][0])
        self._torques = struct.Struct(f"<BB{len(wiring.motors)}f")
        self._angles = struct.Struct(f"<B{len(wiring.encoders)}f")

    def set_up(self) -> bytes:
        """The message that sets the board up."""
        wiring, parts = self.wiring, [bytes([SET_UP, ID])]
        for order, ends in ((self._motors, wiring.motors), (self._encoders, wiring.encoders)):
            mask = sum(1 << (connector - 1) for connector, _ in ends)
            parts.append(bytes([mask, *(int(ends[i][1] < 0) for i in order)]))
        parts.append(bytes([0, 0]))
        for i in self._encoders:
            counts = wiring.counts[i]
            home = round(wiring.home[i] * counts / _TURN)
            # The firmware cuts off what is behind the point of offset counts / 360.
            parts.append(
                struct.pack("<2f", (home + math.copysign(0.25, home)) * 360 / counts, counts)
            )
        return b"".join(parts)

    def message(self, torques: Sequence[float]) -> bytes:
        """The message that sets torques."""
        ordered = (torques[i] for i in self._motors)
        return self._torques.pack(TORQUES, ID, *ordered)

    def open(self) -> None:
        try:
            from serial import SerialException, serial_for_url
        except ModuleNotFoundError:
            remedy = install_command("board")
            raise InputFault(f"{self.port}: serial ports need pyserial: {remedy}") from None
        try:
            self._serial = serial_for_url(
                self.port, 115200, timeout=0, write_timeout=0.05, exclusive=True
            )
            if self.port.startswith(SOCKET):
                with socket.fromfd(
                    self._serial.fileno(), socket.AF_INET, socket.SOCK_STREAM
                ) as end:
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (SerialException, ValueError) as error:
            raise OSError(str(error)) from None
        self._write(bytes([RESET, ID]))
        self._write(self.set_up())
        time.sleep(SETTLED)
        self._serial.reset_input_buffer()

    def send(self, torques: Sequence[float]) -> None:
        self._write(self.message(torques))

    def _write(self, message: bytes) -> None:
        assert self._serial
        self._serial.write(message)

    def receive(self, seconds: float) -> Sequence[float]:
        assert self._serial
        size, until = self._angles.size, time.monotonic() + seconds
        answer = b""
        while len(answer) < size:
            if part := self._serial.read(size - len(answer)):
                answer += part
            elif (left := until - time.monotonic()) > 0:
                _wait_readable(self._serial, left)
            else:
                came = f"{len(answer)} of {size} bytes of an answer" if answer else "no answer"
                raise Silent(f"has sent {came} within {1e3 * seconds:.3g} ms")
        return self.counts(answer)

    def counts(self, answer: bytes) -> Sequence[float]:
        """The counts of all encoders of a board's answer. Raises Silent."""
        of, *degrees = self._angles.unpack(answer)
        if of != ID:
            raise Silent(f"has answered for device {of}, not {ID}: bytes were lost")
        found = [0.0] * len(degrees)
        for i, angle in zip(self._encoders, degrees, strict=True):
            count = angle * self.wiring.counts[i] / 360
            if not abs(count - round(count) if abs(count) < 2**31 else 1.0) <= WHOLE:
                what = f"{angle:g} degrees for encoder {i + 1}"
                raise Silent(f"has sent {what}, which are no whole counts: bytes were lost")
            found[i] = float(round(count))
        return found

    def zero_torque_when_killed(self) -> tuple[int, bytes] | None:
        if os.name != "posix" or not self._serial:
            return None
        return self._serial.fileno(), self.message([0.0] * len(self._motors))

    def close(self) -> None:
        if self._serial:
            self._serial.close()
            self._serial = None


_TURN = 6.283185307179586


def _wait_readable(port: Serial, seconds: float) -> None:
    """Wait until the port has bytes, or that long."""
    if os.name == "posix":
        import select

        select.select([port.fileno()], [], [], seconds)
    else:
        time.sleep(min(seconds, 2e-4))
