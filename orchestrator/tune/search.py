"""The search for the largest gains: the largest coupling that holds, each with the stiffness of the
topology controller that makes the constraint feel like the contact; without a contact the largest
stiffness of the topology controller, and then of the coupling."""

from __future__ import annotations

from collections.abc import Callable

from hapticlink.orchestrator.tune.feel import Feel
from hapticlink.orchestrator.tune.largest import largest

COARSE = 0.05
"""Of the logarithm of a scale, how well the largest is found."""
Scales = dict[str, float]


def search(scales: Scales, feel: Feel, holds: Callable[[Scales], bool]) -> Scales:
    """The largest scales that hold, by law, from given ones on. Raises InputFault where none do."""
    if {"drift", "topology"} <= {*scales} and {"constraint", "contact"} <= {*feel.along}:
        return _raised("drift", scales, feel.alike, holds)
    for law in ("topology", "drift"):
        if law in scales:
            scales = _raised(law, scales, dict, holds)
    return scales


def _raised(
    law: str,
    scales: Scales,
    completed: Callable[[Scales], Scales],
    holds: Callable[[Scales], bool],
) -> Scales:
    """The scales, `completed`, with the largest one of a law."""

    def at(times: float) -> Scales:
        return completed({**scales, law: times * scales[law]})

    return at(largest(lambda times: holds(at(times)), COARSE))
