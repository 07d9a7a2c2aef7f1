"""The message for a scene that starts outside the device's workspace."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.components.port_space import PortSpace


def describe_start_outside(space: PortSpace, pose: Sequence[float]) -> str:
    """The message for a start pose outside the device's workspace. How far is not told: margins are
    distances to one stop each, and to first order, while a way back may meet several."""
    numbers = ", ".join(f"{value:.4g}" for value in pose)
    entries = ", ".join(map(" ".join, zip(space.names, space.pose.units, strict=True)))
    return (
        f"the start pose ({entries}) = ({numbers}) is outside the device's workspace, or too far "
        "from the device's own start for its joints to be found there (lengths are in m: move "
        "linkage.operational_point or linkage.start, or change [device] or its `start`)"
    )
