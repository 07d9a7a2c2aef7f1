"""Finds a dyad for each loop of a linkage, if there is one.

A loop that contains a dyad at its cut joint is a four-bar (with one independent coordinate) or a
five-bar (with two), sliders included. The cut joint is the dyad's middle joint (the links of its
two bodies meet there), or an end (a body and its parent reach for the cut's other body).
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from hapticlink.components.formulations.dyads import Arm, Dyad, ThreePivots, TwoPivotsAndSlide
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import loop_name
from hapticlink.components.specs.linkage import Joint, Linkage

Candidate = tuple[Dyad, list[str]]
OTHERS = 'take mechanism.formulation = "partitioning" or "multipliers"'


def find_dyads(model: LinkageModel, start: np.ndarray) -> list[Dyad]:
    """A dyad for each loop in turn, at the start (q, p). Of several, one that can never fold (all
    links in line, where its branches meet) is preferred, and of these the one farthest from folding
    at the start.

    A dyad may depend on those of earlier loops. Raises ValueError for a loop without a dyad, with
    the reason for each candidate.
    """
    linkage, n = model.linkage, model.q.numel()
    if linkage.gear:
        raise ValueError(f"gears have no dyad, and with them no closed form: {OTHERS}")
    taken: dict[str, str] = {}
    found: list[Dyad] = []
    for i, loop in enumerate(linkage.loop):
        name = loop_name(linkage, i)
        if loop.type != "revolute":
            raise ValueError(f"loop `{name}`: a {loop.type} cut has no closed form; {OTHERS}")
        fit: list[tuple[bool, float, Candidate]] = []
        reasons: list[str] = []
        for dyad, known in _candidates(linkage, i):
            why = _unfit(dyad, known, taken)
            if why:
                reasons.append(why)
                continue
            side = ca.Function("side", [model.q, model.p.vector], [dyad.side(model)])
            share = abs(float(side(start[:n], start[n:])))
            fit.append((_never_folds(model, start, i, dyad), share, (dyad, known)))
        if not fit:
            why = "; ".join(dict.fromkeys(reasons)) or "it joins one body to the ground"
            raise ValueError(
                f"loop `{name}` ({loop.bodies[0]} to {loop.bodies[1]}) has no closed form, as no "
                f"two links at its cut joint form a dyad: {why}; {OTHERS}"
            )
        dyad, known = max(fit, key=lambda each: each[:2])[2]
        taken = {j: f"loop `{name}` stands on it" for j in known} | taken
        taken |= {j.name: f"loop `{name}` sets it" for j in dyad.joints}
        found.append(dyad)
    return found


def _never_folds(model: LinkageModel, start: np.ndarray, index: int, dyad: Dyad) -> bool:
    """Whether the loop's other links, of lengths r, keep the dyad's ends at a distance that lies
    inside (|l1 - l2|, l1 + l2): theirs is at most sum r, at least 2 max r - sum r.

    False where a joint that slides changes a length."""
    loop, n = model.linkage.loop[index], model.q.numel()
    chains = [_chain(model.linkage, body) for body in loop.bodies]
    own = [[j for j in a if j not in b] for a, b in (chains, chains[::-1])]
    around = [*own[0], *reversed(own[1])]
    if not isinstance(dyad, ThreePivots) or any(j.type != "revolute" for j in around):
        return False
    cut = model.frames[loop.bodies[0]].point(model.p[f"{loop_name(model.linkage, index)}.at1"])
    points = ca.horzcat(cut, *(model.twists(j)[0] for j in around))
    values = np.array(ca.Function("p", [model.q, model.p.vector], [points])(start[:n], start[n:]))
    lengths = np.linalg.norm(np.roll(values, -1, axis=1) - values, axis=0)
    middle = 0 if dyad.target is None else 1 + around.index(dyad.second.joint)
    r = np.delete(lengths, [middle - 1, middle])
    l1, l2 = lengths[middle - 1], lengths[middle]
    return bool(l1 + l2 > r.sum() and abs(l1 - l2) < 2 * r.max() - r.sum())


def _chain(linkage: Linkage, body: str) -> list[Joint]:
    """Joints from a body down to the ground."""
    carrier = {j.child: j for j in linkage.joint}
    found = []
    while body in carrier:
        found.append(carrier[body])
        body = carrier[body].parent
    return found


def _candidates(linkage: Linkage, index: int) -> Iterator[Candidate]:
    """Candidate dyads of a loop, with the joints that each depends on."""
    name, bodies = loop_name(linkage, index), linkage.loop[index].bodies
    chains = [_chain(linkage, body) for body in bodies]
    ends = [f"{name}.at1", f"{name}.at2"]
    if all(chains):
        arms = [Arm(chain[0], end) for chain, end in zip(chains, ends, strict=True)]
        # A slide is the second joint; two slides are rejected by `_unfit`.
        first, second = sorted(arms, key=lambda arm: arm.joint.type == "prismatic")
        slides = second.joint.type == "prismatic"
        dyad = TwoPivotsAndSlide(first, second) if slides else ThreePivots(first, second, None)
        yield dyad, [j.name for chain in chains for j in chain[1:]]
    for k in (0, 1):
        if len(chains[k]) > 1:
            inner, outer, *rest = chains[k]
            first, second = Arm(outer, f"{inner.name}.at_parent"), Arm(inner, ends[k])
            target = bodies[1 - k], ends[1 - k]
            yield ThreePivots(first, second, target), [j.name for j in (*rest, *chains[1 - k])]


def _unfit(dyad: Dyad, known: list[str], taken: dict[str, str]) -> str | None:
    for joint in dyad.joints:
        slides = isinstance(dyad, TwoPivotsAndSlide) and joint is dyad.second.joint
        if joint.type != ("prismatic" if slides else "revolute"):
            return f"joint `{joint.name}` is {joint.type}"
        if joint.name in taken:
            return f"joint `{joint.name}`: {taken[joint.name]}"
        if joint.name in known:
            return f"joint `{joint.name}` carries the dyad's other end"
    return None
