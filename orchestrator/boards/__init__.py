"""Boards in the place of simulated devices: protocols, what is sent to motors, and a board that is
simulated itself."""

from hapticlink.orchestrator.boards.driver import DRIVERS as DRIVERS
from hapticlink.orchestrator.boards.driver import DeviceDriver as DeviceDriver
from hapticlink.orchestrator.boards.open_kit import OpenKit

DRIVERS |= {"open-kit": OpenKit}
