"""The matrices of a hand: what its doStep and its get do to perturbations of its ports and states.

Every hand of a scene is linear in the pose and velocity of the handle, at any of its targets and
wrenches, so that its matrices are those of its component at 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hapticlink.analysis.stability.graph_slopes import GraphSlopes
from hapticlink.components.blocks.hand import hand
from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.hand import Hand
from hapticlink.fmus.fmu_functions import one_pass
from hapticlink.orchestrator.base.arrays import Matrix

INPUTS, OUTPUT = ("x", "v"), "F"
PORTS = 3 * PLANE.size
"""Numbers of the ports of a hand that reads pose and velocity: x, v, F."""


@dataclass(frozen=True, eq=False)
class HandSlopes:
    """step: the slopes (n, n) of ports x, v, F and states by themselves; get: those of (ports,
    states, and the signals of F) by (ports, states)."""

    step: Matrix
    get: Matrix

    @property
    def states(self) -> int:
        return len(self.step) - PORTS


@lru_cache(64)
def hand_slopes(spec: Hand, T: float, space: PortSpace = PLANE) -> HandSlopes:
    """Of a hand at a port that is stepped by T (s)."""
    made = hand(spec, space)
    functions = {f.name(): f for f in one_pass(made).functions}
    graph = GraphSlopes(functions, made.timing == "sampled", made.substeps)
    n = space.size
    own = [n * (*INPUTS, OUTPUT).index(v.name) + i for v in made.inputs for i in range(n)]
    n_y, n_x = n, sum(v.size for v in made.states)
    places = [*own, *range(2 * n, PORTS + n_x)]
    p = np.concatenate([np.ravel(v.start).astype(float) for v in made.parameters])
    rest = np.concatenate([np.zeros(len(own)), p, np.zeros(n_y + n_x)])
    state = np.concatenate([[0.0], rest])
    size = PORTS + n_x
    step, got = np.eye(size), np.eye(size)
    step[2 * n :] = got[2 * n :] = 0.0
    at = np.zeros((1, len(places)))
    for J, (_, slopes) in ((step, graph.step(state, at, T)), (got, graph.get(state, at))):
        J[np.ix_(places, places)] = slopes
    return HandSlopes(step, np.vstack([got, got[2 * n : PORTS]]))
