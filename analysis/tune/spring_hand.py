"""The hands in which gains are judged: springs that press on a handle at rest."""

from __future__ import annotations

from collections.abc import Sequence

HANDS = (100.0, 1000.0)
"""Stiffnesses (N/m): a light touch and a firm grip."""
FIRM = HANDS[-1]
LEVER = 1 / 300
"""Rotational stiffness (N.m/rad) over that of translations (N/m)."""
DAMPING = (5.0, 5.0, 0.01)
"""(N.s/m, N.m.s/rad)."""


def spring(pose: Sequence[float], wrench: Sequence[float], stiffness: float) -> dict[str, object]:
    """The [hand] table of a spring that presses with `wrench` on a handle at `pose`."""
    stiff = [stiffness, stiffness, stiffness * LEVER]
    target = [float(x + F / k) for x, F, k in zip(pose, wrench, stiff, strict=True)]
    return {
        "type": "spring",
        "stiffness": stiff,
        "damping": list(DAMPING),
        "target": [[0.0, *target]],
    }
