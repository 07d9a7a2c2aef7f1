"""What a growing mode is to the hand that feels it.

A *drift* is slow: below 1 Hz, and by less than 0.2 1/s, which a person corrects without noticing.
Above that an *oscillation* grows, from 40 Hz on a *vibration*, which skin and hand no longer feel
as motion (flutter and vibration: Talbot, Darian-Smith, Kornhuber, Mountcastle, J. Neurophysiology
31 (1968), 301). A *divergence* grows faster than a drift, at less than its frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

VIBRATION = 40.0
"""Frequency (Hz) from which on a mode is a vibration."""


@dataclass(frozen=True)
class Bounds:
    """Up to which frequency (Hz) and growth rate (1/s) a growing mode is a drift."""

    hertz: float = 1.0
    growth: float = 0.2


DRIFT = Bounds()


def kind(growth: float, hertz: float, bounds: Bounds) -> str:
    """drift, divergence, oscillation or vibration."""
    if hertz < bounds.hertz:
        return "drift" if growth < bounds.growth else "divergence"
    return "oscillation" if hertz < VIBRATION else "vibration"
