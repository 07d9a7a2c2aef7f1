"""[device.driver]: the board that drives a device's motors and reads its encoders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from hapticlink.components.registry import Registry
from hapticlink.components.specs.quantities import Quantity

DRIVERS: Registry[Any] = Registry("driver", {})
"""The protocols of boards, registered by the room that speaks them."""

_Angle = Annotated[float, Quantity("rad")]
_Count = Annotated[float, Quantity("1", gt=0)]
_Connector = Annotated[int, Quantity("1", ge=1, le=4)]


@dataclass(frozen=True, kw_only=True)
class Driver:
    """A board with the motors and encoders of a device. In a run in real time it takes the place of
    the simulated device as soon as it has a port ([your device](your-device.md))."""

    type: Annotated[str, DRIVERS.names()] = "open-kit"
    """The protocol: open-kit, the serial protocol of the open two-motor teaching kit."""
    port: str = ""
    """The serial port (`/dev/ttyACM0`, `COM3`), the socket of a board elsewhere
    (`socket://HOST:PORT`), or `simulated-board`: a board that is a process of this computer, with
    the device and the hand of the scene. Without one, or with `none`, the device is simulated.
    `--device PORT` gives it, too."""
    counts: tuple[_Count, ...] = ()
    """Counts of each encoder in a turn; by default those of the device's encoders."""
    home: tuple[_Angle, ...] = ()
    """Angles of the encoders in the pose in which the board is started; by default those of the
    device where the scene starts."""
    motor_connectors: tuple[_Connector, ...] = ()
    """The board's connector of each motor; by default 1, 2, ..."""
    motor_signs: tuple[Annotated[int, Quantity("1", ge=-1, le=1)], ...] = ()
    """1, or -1 for each motor that turns the other way; by default 1."""
    encoder_connectors: tuple[_Connector, ...] = ()
    """The board's connector of each encoder; by default 1, 2, ..."""
    encoder_signs: tuple[Annotated[int, Quantity("1", ge=-1, le=1)], ...] = ()
    """1, or -1 for each encoder that counts the other way; by default 1."""
    torque_limit: Annotated[float, Quantity("N.m", gt=0)] | None = None
    """Largest torque of a motor that is sent, whatever the scene asks for; by default the device's
    own."""
    torque_rate: Annotated[float, Quantity("N.m/s", gt=0)] | None = None
    """Largest rate at which the magnitude of a torque that is sent grows; it falls at any. By
    default the limit is reached in 5 ms."""
    ramp: Annotated[float, Quantity("s", ge=0, le=10)] = 0.2
    """Time over which the virtual coupling grows at the start, on both of its sides."""
    speed_limit: Annotated[float, Quantity("rad/s", gt=0)] = 60.0
    """Rate of an encoder above which its angle counts as a fault."""
    silence: Annotated[float, Quantity("s", gt=0, le=0.05)] = 0.05
    """Time without an answer that counts as a fault."""

    @property
    def active(self) -> bool:
        """Whether the board is there, in the place of the simulated device."""
        return self.port not in ("", "none")
