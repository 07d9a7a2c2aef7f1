"""Applied forces of a linkage, one kind a file; a kind that a scene lacks adds no term.

A kind is a module with
    parameters(linkage) -> list[Variable]
    efforts(model)      -> generalised forces (n x 1), or None
    energy(model)       -> potential energy (J), or None
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.forces import drives, gravity, joints, springs
from hapticlink.components.specs.linkage import Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel

KINDS = (gravity, springs, joints, drives)


def parameters(linkage: Linkage) -> list[Variable]:
    """Those of the forces alone."""
    return [v for kind in KINDS for v in kind.parameters(linkage)]


def efforts(model: LinkageModel) -> ca.SX:
    """Sum of all generalised forces, n x 1: gravity (-g of (2.3)), springs, friction, drives."""
    found = [Q for kind in KINDS if (Q := kind.efforts(model)) is not None]
    return sum(found, start=ca.SX(model.q.numel(), 1))


def energy(model: LinkageModel) -> ca.SX:
    """Sum of all potential energies, J."""
    return sum((V for kind in KINDS if (V := kind.energy(model)) is not None), start=ca.SX(0))
