"""Applied forces of a linkage, one kind a file; a kind that a scene does not use adds no term.

Forces of the linkage's own keys are modules with
    parameters(linkage) -> list[Variable]
    efforts(model)      -> generalised forces (n x 1), or None
    energy(model)       -> potential energy (J), or None
of which friction.py has states as well;
and forces that [[linkage.force]] selects by its `type` are classes in `FORCES`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.forces import drives, friction, gravity, joints, springs
from hapticlink.components.forces.base import Force
from hapticlink.components.registry import Registry, no_subclass
from hapticlink.components.specs.linkage import Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel

KINDS = (gravity, springs, joints, friction, drives)
FORCES: Registry[type[Force]] = Registry("force", {}, lambda part: no_subclass(part, Force))


def make_forces(linkage: Linkage) -> tuple[Force, ...]:
    """The forces of [[linkage.force]]. Raises ValueError for an entry that is no `Force`."""
    for force in linkage.force:
        if not isinstance(force, Force):
            raise ValueError(f"`linkage.force`: {force!r} is no record of a force")
    return linkage.force


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of all forces."""
    own = [v for kind in KINDS for v in kind.parameters(linkage)]
    return own + [v for force in make_forces(linkage) for v in force.parameters()]


def efforts(model: LinkageModel, *, weight: bool = True) -> ca.SX:
    """Sum of all generalised forces (n x 1): gravity (-g of (2.3)), springs, friction, drives, and
    those of [[linkage.force]]; without gravity unless `weight`. Raises ValueError for a force of
    another size, or one that refers to a frame, joint or parameter that the linkage does not
    have."""
    kinds = [kind for kind in KINDS if weight or kind is not gravity]
    parts = [Q for kind in kinds if (Q := kind.efforts(model)) is not None]
    n = model.q.numel()
    for force in make_forces(model.linkage):
        try:
            Q = ca.SX(force.efforts(model))
        except KeyError as error:  # of frames, joints or parameters
            raise ValueError(f"force `{force.name}`: the linkage has no {error}") from error
        except NotImplementedError as error:  # CasADi's, of what is no expression
            raise ValueError(f"force `{force.name}`: efforts are no expression") from error
        if Q.shape != (n, 1):
            raise ValueError(f"force `{force.name}`: efforts of {Q.shape}, not {(n, 1)}")
        parts.append(Q)
    return sum(parts, start=ca.SX(n, 1))


def sources(model: LinkageModel) -> ca.SX:
    """The generalised forces (n x 1) that may put energy in: those of drives, and those of
    [[linkage.force]] apart from their potentials."""
    driven = drives.efforts(model)
    parts = [] if driven is None else [driven]
    for force in make_forces(model.linkage):
        parts.append(ca.SX(force.efforts(model)) + ca.gradient(force.energy(model), model.q))
    return sum(parts, start=ca.SX(model.q.numel(), 1))


def energy(model: LinkageModel) -> ca.SX:
    """Sum of all potential energies (J)."""
    parts = [V for kind in KINDS if (V := kind.energy(model)) is not None]
    return sum([*parts, *(f.energy(model) for f in make_forces(model.linkage))], start=ca.SX(0))
