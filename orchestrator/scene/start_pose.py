"""The message for a scene that starts outside the device's workspace."""

from __future__ import annotations

from collections.abc import Sequence


def describe_start_outside(pose: Sequence[float], margin: float) -> str:
    """The message for a start pose (m, m, rad) outside the device's workspace, by -`margin` (m)."""
    numbers = ", ".join(f"{value:.4g}" for value in pose)
    return (
        f"the start pose (x m, y m, theta rad) = ({numbers}) is outside the device's workspace by "
        f"{-margin:.3g} m (lengths are in m: move linkage.operational_point or linkage.start, or "
        "change [device])"
    )
