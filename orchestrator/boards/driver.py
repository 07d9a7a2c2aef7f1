"""What a board's protocol has to provide; a plugin registers its own in DRIVERS."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hapticlink.components.registry import no_subclass
from hapticlink.components.specs import driver
from hapticlink.components.specs.driver import DRIVERS as DRIVERS

SIMULATED_BOARD = "simulated-board"
"""The port of a board that is a process of this computer."""
SOCKET = "socket://"
"""What the port of a board behind a socket, `socket://HOST:PORT`, begins with."""


class Silent(Exception):
    """A board does not answer as its protocol says; the text says how, as in `the board ...`."""


@dataclass(frozen=True)
class Wiring:
    """What a board is told of a device. counts: of a turn of each encoder; home: their angles (rad)
    in the pose in which the board is started; motors, encoders: connector (1, 2, ...) and sign of
    each."""

    counts: tuple[float, ...]
    home: tuple[float, ...]
    motors: tuple[tuple[int, int], ...]
    encoders: tuple[tuple[int, int], ...]

    @classmethod
    def of(
        cls, table: driver.Driver, motors: int, resolution: Sequence[float], home: Sequence[float]
    ) -> Wiring:
        """That of a [device.driver] for a number of motors and encoders of a resolution (rad) each,
        with the `home` angles of the device at the start."""
        return cls(
            table.counts or tuple(math.tau / r for r in resolution),
            table.home or tuple(home),
            _ends(table.motor_connectors, table.motor_signs, motors),
            _ends(table.encoder_connectors, table.encoder_signs, len(resolution)),
        )


def find_misfits(table: driver.Driver, motors: int, encoders: int) -> Iterator[tuple[str, str]]:
    """The keys of a [device.driver] that do not fit a device with so many motors and encoders, with
    what to do."""
    numbers = {"motor": motors, "encoder": encoders, "counts": encoders, "home": encoders}
    for key, size in ((k, numbers[k.partition("_")[0]]) for k in _BY_END):
        given = getattr(table, key)
        if not given:
            continue
        what = "motors" if key.startswith("motor") else "encoders"
        if len(given) != size:
            yield key, f"the device has {size} {what}: give {size} numbers"
        elif key.endswith("_signs") and 0 in given:
            yield key, "give 1 or -1 for each"
        elif key.endswith("_connectors") and len(set(given)) < size:
            yield key, "two of them share a connector: give each once"
    if max(motors, encoders) > CONNECTORS:
        yield "port", f"a board has {CONNECTORS} connectors of a motor and an encoder each"


CONNECTORS = 4
_BY_END = (
    *("counts", "home"),
    *("motor_connectors", "motor_signs", "encoder_connectors", "encoder_signs"),
)


def _ends(
    connectors: Sequence[int], signs: Sequence[int], size: int
) -> tuple[tuple[int, int], ...]:
    return tuple(zip(connectors or range(1, size + 1), signs or [1] * size, strict=True))


class DeviceDriver(ABC):
    """A board at a port. Limits, ramp and what counts as a fault are no concern of a driver: it is
    asked to send what may be sent (`safe_torques.py`).

    Every call of `send` is followed by one answer, which `receive` waits for; several answers may
    be under way. Calls come from one thread.
    """

    def __init__(self, port: str, wiring: Wiring) -> None:
        self.port, self.wiring = port, wiring

    @abstractmethod
    def open(self) -> None:
        """Open the port, without torque, and set the board up. Raises Silent or OSError."""

    @abstractmethod
    def send(self, torques: Sequence[float]) -> None:
        """Send the torques (N.m) of all motors. Raises OSError where the port is gone."""

    @abstractmethod
    def receive(self, seconds: float) -> Sequence[float]:
        """The counts of all encoders, of the oldest answer that was not received, within so many
        seconds; of an encoder at its `home` angle they are that angle's. Raises Silent where none
        comes, or one that is not as the protocol says, and OSError."""

    def zero_torque_when_killed(self) -> tuple[int, bytes] | None:
        """The file descriptor of the open port and the message of zero torque, which another
        process writes there if this one is killed; None where that cannot be done."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Close the port; torques are zero by then."""


DRIVERS.misfit = lambda part: no_subclass(part, DeviceDriver)
