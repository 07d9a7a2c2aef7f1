"""Uniform gravity: V = - sum_i m_i g . r_cm,i."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.specs.linkage import Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel


def parameters(linkage: Linkage) -> list[Variable]:
    if linkage.gravity is None:
        return []
    g = linkage.gravity
    return [Variable("gravity", (len(g),), "m/s2", g, "acceleration of gravity")]


def energy(model: LinkageModel) -> ca.SX | None:
    if model.linkage.gravity is None:
        return None
    weights = (
        model.p[f"{b.name}.mass"] * ca.dot(model.lifted(model.p["gravity"]), model.centers[b.name])
        for b in model.linkage.body
    )
    return -sum(weights, start=ca.SX(0))


def efforts(model: LinkageModel) -> ca.SX | None:
    V = energy(model)
    return None if V is None else -ca.gradient(V, model.q)
