"""Which linkages the converters for Drake and Pinocchio know."""

from __future__ import annotations

from hapticlink.components.specs.linkage import Linkage


def require_comparable(linkage: Linkage) -> None:
    """Raises ValueError for what these would leave out or take for something else."""
    if linkage.dimension > 2:
        raise ValueError("linkages in the plane are compared")
    if linkage.sprung or linkage.driven or linkage.rubbing or linkage.limited:
        raise ValueError("forces of joints and springs are not compared")
    if linkage.gear or any(loop.type != "revolute" for loop in linkage.loop):
        raise ValueError("loops are compared that are closed by pins")
    for joint in linkage.joint:
        if not all(freedom.pure for freedom in joint.kind.freedoms):
            raise ValueError(f"{joint.name}: a {joint.type} joint is not compared")
