"""The message for a scene that starts outside the device's workspace."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.components.port_space import PortSpace


def describe_start_outside(space: PortSpace, pose: Sequence[float], margin: float) -> str:
    """The message for a start pose outside the device's workspace, by -`margin` (m)."""
    numbers = ", ".join(f"{value:.4g}" for value in pose)
    entries = ", ".join(map(" ".join, zip(space.names, space.pose.units, strict=True)))
    return (
        f"the start pose ({entries}) = ({numbers}) is outside the device's workspace by "
        f"{-margin:.3g} m (lengths are in m: move linkage.operational_point or linkage.start, or "
        "change [device])"
    )
