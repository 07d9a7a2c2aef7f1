"""Which outputs of a scene a frame shows, on the live page and in replays."""

from __future__ import annotations

from hapticlink.orchestrator.base.loop_names import (
    CLOSURE_ERROR,
    CONSTRAINT_COUNTS,
    CONTACT_GAP,
    COPY_BRANCH_OK,
    COPY_JOINT_COORDINATES,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    HANDLE_POSE,
    JOINT_COORDINATES,
    MEASURED_HANDLE_POSE,
    MOTOR_WRENCH,
    MULTIPLIERS,
    POINT_POSE,
    PROJECTORS,
    TOPOLOGY_WRENCH,
    WORKSPACE_MARGIN,
    signal_of_user,
)

SHOWN = {
    "q": (JOINT_COORDINATES,),
    "ghost": (COPY_JOINT_COORDINATES,),
    "lambda": (MULTIPLIERS,),
    "closure_error": (CLOSURE_ERROR,),
    "gap": (CONTACT_GAP,),
    "branch_ok": (COPY_BRANCH_OK,),
}
"""By name in a frame, the output that it is, the first that the scene has."""
OF_USER = {
    "x": (POINT_POSE,),
    "handle": (HANDLE_POSE, POINT_POSE),
    "F_hand": (HAND_WRENCH,),
    "F_drift": (DRIFT_WRENCH,),
    "F_constraint": (TOPOLOGY_WRENCH,),
    "F_env": (ENVIRONMENT_WRENCH,),
    "n": CONSTRAINT_COUNTS,
    "P_c": PROJECTORS,
    "margin": (WORKSPACE_MARGIN,),
    "F_motor": (MOTOR_WRENCH,),
    "measured": (MEASURED_HANDLE_POSE,),
}
"""The same of each user; what further ones have is in `others` of a frame, by their points."""


def shown() -> dict[str, tuple[str, ...]]:
    """What a frame shows of a scene and of its first user, without `others`."""
    return SHOWN | shown_of_user("")


def shown_of_user(user: str) -> dict[str, tuple[str, ...]]:
    """What a frame shows of a user, whose name is that of the point, "" for the first one's."""
    return {k: tuple(signal_of_user(n, user) for n in names) for k, names in OF_USER.items()}
