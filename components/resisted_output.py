"""The outputs Lambda_inv, P_c and n_constraints of a block that knows its mobility."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components import resisted
from hapticlink.components.component import Block
from hapticlink.components.operational_space import OperationalSpace


@dataclass(frozen=True)
class ResistedDirections:
    """n_resisted at the start and after a step, and the outputs."""

    first: ca.SX
    after: ca.SX
    output: dict[str, ca.SX]


def resisted_directions(
    block: Block, space: OperationalSpace, q0: ca.SX, q1: ca.SX
) -> ResistedDirections:
    """For a block with state n_resisted that starts at q0 and steps from q to q1."""
    p, before, q = block.p, block.x["n_resisted"], space.model.q
    S = resisted.scaling(p["length_scale"])
    least = resisted.locked(space.open_mobility, p["length_scale"])
    scaled = ca.Function(
        "scaled", [q, block.u.vector, p.vector], [S @ space.Lambda_inv @ S, least], {"cse": True}
    )
    tolerance, hysteresis = p["rank_tolerance"], p["hysteresis"]

    def number(at: ca.SX, before: ca.SX) -> ca.SX:
        mobility, least = scaled(at, block.u.vector, p.vector)
        return resisted.count(resisted.eigen(mobility)[0], before, tolerance, hysteresis, least)

    now, vectors = resisted.eigen(scaled(q, block.u.vector, p.vector)[0])
    return ResistedDirections(
        first=number(q0, ca.SX(0)),
        after=number(q1, before),
        output={
            "P_c": resisted.projector(now, vectors, before),
            "n_constraints": before,
        },
    )
