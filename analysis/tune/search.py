"""The search for the largest gains: the largest coupling that holds, each with the stiffness of the
topology controller that makes the constraint feel like the contact; without a contact the largest
stiffness of the topology controller, and then of the coupling."""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.analysis.stability.bisection import DOUBLINGS, largest
from hapticlink.analysis.tune.felt_stiffness import Feel
from hapticlink.orchestrator.base.errors import InputFault

COARSE = 0.05
"""Of the logarithm of a scale, how well the largest is found."""
Scales = dict[str, float]


def search(scales: Scales, feel: Feel, require: Callable[[Scales], None]) -> tuple[Scales, str]:
    """The largest scales that hold, by law, from given ones on, and why larger ones do not.
    `require` raises InputFault with the reason, and so does this where none hold."""
    if {"drift", "topology"} <= {*scales} and {"constraint", "contact"} <= {*feel.along}:
        return _raised("drift", scales, feel.alike, require)
    why = []
    for law in ("topology", "drift"):
        if law in scales:
            scales, limit = _raised(law, scales, dict, require)
            why.append(f"{limit} ({law})")
    return scales, "; ".join(why)


def _raised(
    law: str,
    scales: Scales,
    completed: Callable[[Scales], Scales],
    require: Callable[[Scales], None],
) -> tuple[Scales, str]:
    """The scales, `completed`, with the largest one of a law."""
    why = f"nothing up to {2**DOUBLINGS} times the scene's"

    def at(times: float) -> Scales:
        return completed({**scales, law: times * scales[law]})

    def holds(times: float) -> bool:
        nonlocal why
        try:
            require(at(times))
        except InputFault as fault:
            why = str(fault)
            return False
        return True

    try:
        return at(largest(holds, COARSE)), why
    except InputFault as fault:
        raise InputFault(f"limited by {why}: {fault}") from None
