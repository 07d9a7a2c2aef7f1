"""Which outputs of a scene a frame shows, of a scene that runs and in replays."""

from __future__ import annotations

from collections.abc import Mapping

from hapticlink.orchestrator.base.signal_names import (
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
    MEASURED_HANDLE_POSES,
    MOTOR_WRENCH,
    MULTIPLIERS,
    POINT_POSE,
    PROJECTORS,
    TOPOLOGY_WRENCH,
    WORKSPACE_MARGIN,
    signal_of_user,
)
from hapticlink.orchestrator.system.system import Fmu

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
    "handle": (HANDLE_POSE, *MEASURED_HANDLE_POSES, POINT_POSE),
    "F_hand": (HAND_WRENCH,),
    "F_drift": (DRIFT_WRENCH,),
    "F_constraint": (TOPOLOGY_WRENCH,),
    "F_env": (ENVIRONMENT_WRENCH,),
    "n": CONSTRAINT_COUNTS,
    "P_c": PROJECTORS,
    "margin": (WORKSPACE_MARGIN,),
    "F_motor": (MOTOR_WRENCH,),
    "measured": MEASURED_HANDLE_POSES,
}
"""The same of each user; what further ones have is in `others` of a frame, by their points."""


def candidates(user: str = "") -> dict[str, tuple[str, ...]]:
    """By name in a frame, the outputs of a user that it may be, the first that a scene has. The
    name of a user is that of the point; that of the first one, whose frame has what is not of a
    user too, is empty."""
    of_user = {k: tuple(signal_of_user(n, user) for n in names) for k, names in OF_USER.items()}
    return of_user if user else SHOWN | of_user


def outputs(fmus: Mapping[str, Fmu], user: str = "") -> dict[str, str]:
    """By name in a frame of a user, the output of the FMUs that it is, as far as they have one."""
    signals = {}
    for key, names in candidates(user).items():
        if name := next((name for name in names if _is_output(fmus, name)), None):
            signals[key] = name
    return signals


def _is_output(fmus: Mapping[str, Fmu], name: str) -> bool:
    fmu, _, port = name.partition(".")
    return fmu in fmus and bool(fmus[fmu].description.port(port, "output"))
