"""Which connections carry power: an effort into a plant, and the plant's motion along it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PowerPort:
    """The power into a plant is sign * effort . d(displacement)/dt.

    effort is an input (`fmu.port` or an entry of it, N and N.m), displacement an output of the same
    FMU that its effort works on (m and rad); other units count by their factors (`bonds`).
    """

    effort: str
    displacement: str
    sign: float = 1.0

    @property
    def fmu(self) -> str:
        return self.effort.partition(".")[0]


BLOCKS = (
    PowerPort(effort="virtual_mechanism.F_hand", displacement="virtual_mechanism.x"),
    PowerPort(effort="virtual_mechanism.F_drift", displacement="virtual_mechanism.x", sign=-1.0),
    PowerPort(effort="haptic_device.F_hand", displacement="haptic_device.x_true"),
    PowerPort(effort="haptic_device.F_motor", displacement="haptic_device.x_true"),
)
"""Ports of the report's blocks; F_drift acts on the mechanism as -."""
