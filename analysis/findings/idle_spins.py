"""A warning of a body that turns idly about the line through its two balls.

Nothing but its own inertia resists that turn, which is small. Constrained directions are those
whose mobility is small beside the largest one (constrained_directions.py): at a point of the body
beside the line, the idle turn makes that mobility so large that motions of the linkage count as
constrained. With v the joint rates of the turn alone, D the mass matrix and J the point's Jacobian,

    Lambda^-1 = Lambda^-1 of all other motions + J v (v' D v)^-1 v' J'

since in the metric of D the null space of W is v and its orthogonal complement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.tracking import count_constrained, of_block
from hapticlink.components.component import Signals
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Directions, Linkage
from hapticlink.components.specs.quantities import Place
from hapticlink.orchestrator.base.signal_names import JOINT_COORDINATES
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.recorded_scene import scene_part

ALONE = 1e-9
"""Of the largest singular value of the other bodies' motion, below which there is none."""

Matrix = NDArray[np.float64]


def spinning(linkage: Linkage) -> list[str]:
    """The bodies that nothing holds but two balls, in the tree or cut, or rods at their points."""
    return [body.name for body in linkage.body if _hangs_on_two_balls(linkage, body.name)]


def _hangs_on_two_balls(linkage: Linkage, body: str) -> bool:
    held: list[tuple[str, Place | None]] = []
    held += [(joint.type, joint.at_child) for joint in linkage.joint if joint.child == body]
    held += [(joint.type, joint.at_parent) for joint in linkage.joint if joint.parent == body]
    for loop in linkage.loop:
        ends = zip(loop.bodies, loop.at, strict=True)
        held += [(loop.type, at) for name, at in ends if name == body]
    places = {(*(at or (0.0, 0.0)), 0.0)[:3] for _, at in held}
    return len(places) == 2 and {kind for kind, _ in held} <= {"spherical", "rod"}


def warn_of_idle_spins(results: Results) -> Iterator[str]:
    """Lines of `find_idle_spins` at the start of a run that finds constrained directions."""
    linkage = scene_part(results, "linkage", Linkage)
    directions = scene_part(results, "directions", Directions)
    table = of_block(results, JOINT_COORDINATES, len(linkage.coordinate_units))
    if count_constrained(results) and table and len(table["time"]):
        yield from find_idle_spins(linkage, directions, table[JOINT_COORDINATES][0])


def find_idle_spins(
    linkage: Linkage, directions: Directions, q: Sequence[float] | Matrix
) -> Iterator[str]:
    """A line for a body whose idle turn hides motions of the operational point at coordinates q."""
    for body in spinning(linkage):
        mobility, turned = _mobilities(linkage, body, np.asarray(q, float))
        most = float(np.linalg.eigvalsh(mobility)[-1])
        others = np.linalg.eigvalsh(mobility - turned)
        least = directions.rank_tolerance
        hidden = int(np.sum((others >= least * others[-1]) & (others < least * most)))
        if hidden and others[-1] > ALONE * most:
            yield (
                f"warning: {body} turns idly about the line through its two balls, which moves "
                f"the operational point {short(most / others[-1])} times as easily as all else: "
                f"rank_tolerance = {least:g} takes {hidden} of the linkage's own motions for "
                "constrained; hold a point on that line, or of another body"
            )


def _mobilities(linkage: Linkage, body: str, q: Matrix) -> tuple[Matrix, Matrix]:
    """Lambda^-1 at the operational point, and the part of it that is the turn of a body alone."""
    p = Signals("p", parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    frames = (frame for name, frame in model.frames.items() if name not in ("ground", body))
    still = ca.vertcat(model.h, *(ca.vertcat(f.origin, ca.vec(f.rotation)) for f in frames))
    moved = ca.jacobian(still, model.q)
    wanted = [OperationalSpace(model).Lambda_inv, moved, model.J_h, model.D]
    found = ca.Function("mobilities", [model.q, p.vector], wanted)(q, p.starts)
    mobility, others, J, D = (np.array(each) for each in found)
    _, sizes, ways = np.linalg.svd(others)
    V = ways[np.sum(sizes > ALONE * sizes[0]) :].T  # joint rates that move this body alone
    return mobility, J @ V @ np.linalg.solve(V.T @ D @ V, V.T @ J.T)
