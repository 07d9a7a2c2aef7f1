"""Matrices of the graphics copy of the mechanism at coordinates that it predicts, with their
gradients there: what the hold `model` goes on from at the coordinates of the moment.

What is read at t_n, where a frame of length h begins, is known at t_n + h and used until t_n + 2 h.
In the middle of that time the mechanism is, to first order, at

    q_predicted = q + 3/2 h qd

With the inertia matrix D, the Jacobians J of the operational point and W of the closures, and
a = D^-1 (J' + W' lambda), where lambda makes W a = 0, the mobility is J a. Its gradient is that of

    J a + (J a)' + lambda' W a + (lambda' W a)' - a' D a

with a and lambda held: no factor is differentiated, which has no derivative where closures are
redundant (there it holds along the closures).

The gradient of the projector P on the eigenvectors v_i of the small eigenvalues l_i of A, by those
of A (Kato, Perturbation Theory for Linear Operators, section II.2):

    dP = sum over i in P, j not in P of (v_i v_j' + v_j v_i') (v_j' dA v_i) / (l_i - l_j)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import casadi as ca

from hapticlink.components.component import Block, Variable
from hapticlink.components.dynamics import further_points
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.constrained_directions import (
    ConstrainedDirections,
    is_among_smallest,
)
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.ports import Gradient
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.linkage import Linkage

PREDICTED = "q_predicted"
LEAD = 1.5
"""From the beginning of a frame, in frames."""


def states(linkage: Linkage) -> list[Variable]:
    units = linkage.coordinate_units
    return [Variable(PREDICTED, (len(units),), units)]


def outputs(linkage: Linkage, matrices: Iterable[Variable]) -> Iterator[Variable]:
    """The coordinates at which the matrices are computed, and the gradient of each, with a row for
    each of its entries."""
    units = linkage.coordinate_units
    text = "coordinates at which the matrices are computed"
    yield Variable(PREDICTED, (len(units),), units, description=text)
    for v in matrices:
        of = tuple(_per(unit, by) for unit in v.units for by in units)
        yield Variable(
            _name(v.name), (v.size, len(units)), of, description=f"gradient of {v.name} in q",
            gradient=Gradient(v.name, PREDICTED, "q_ref"),
        )  # fmt: skip


def predict(block: Block, q: ca.SX, qd: ca.SX) -> ca.SX:
    """The coordinates in the middle of the frame in which what is read now is used."""
    return q + LEAD * block.h * qd


def values(
    space: OperationalSpace,
    users: further_points.Users,
    found: Mapping[str, ConstrainedDirections],
    *,
    mobility: bool,
) -> Iterator[tuple[str, ca.SX]]:
    """The gradients by output: of the mobilities, if asked for, and of the projectors on the
    constrained directions that are `found`, by state."""
    jacobians = further_points.jacobians(space.model, users)
    own = {"": space.terms.J_h} | {f"{name}.": J for name, J in jacobians.items()}
    for prefix, J in own.items():
        slope = of_mobility(space, J)
        if mobility:
            yield _name(f"{prefix}Lambda_inv"), slope
        if directed := found.get(f"{prefix}n_constrained"):
            yield _name(f"{prefix}P_c"), of_projector(directed, slope)


def of_mobility(space: OperationalSpace, J: ca.SX) -> ca.SX:
    """The gradient (k^2 x n) of the mobility (k x k) of points with Jacobian J (k x n), which is an
    expression of the model's symbols q."""
    model = space.model
    solved = space.solver.solve(J.T, ca.SX(space.solver.m, J.shape[0]))
    a, multipliers = held = [ca.SX.sym("held", part.sparsity()) for part in solved]
    half = J @ a + multipliers.T @ (model.W @ a)
    mobility = half + half.T - a.T @ TreeInertia(model).apply(a)
    slope = ca.jacobian(ca.vec(mobility), model.q)
    return ca.substitute([slope], held, [*solved])[0]


def of_projector(found: ConstrainedDirections, slope: ca.SX) -> ca.SX:
    """That of the projector on constrained directions, from that of the mobility; without the part
    between two equal eigenvalues, where there is none. That of R Lambda^-1 R' is R dLambda^-1 R',
    by R Lambda^-1 t = 0."""
    SR, values, vectors = found.scaled_by, found.values, found.vectors
    (n, entries), chosen = SR.shape, is_among_smallest(values, found.number)
    turned = [
        vectors.T @ SR @ ca.reshape(column, entries, entries) @ SR.T @ vectors
        for column in ca.horzsplit(slope)
    ]
    columns = []
    for rate in turned:
        mixed = ca.SX(n, n)
        for i in range(n):
            for j in range(n):
                gap = ca.if_else(values[i] == values[j], ca.inf, values[i] - values[j])
                mixed[i, j] = chosen[i] * (1 - chosen[j]) * rate[j, i] / gap
        own = vectors @ (mixed + mixed.T) @ vectors.T
        columns.append(ca.vec(found.rendered.put_matrix(own).T))
    return ca.horzcat(*columns)


def part(outputs: Iterable[str]) -> BlockPart:
    """The part of a block with these outputs that predicts, and puts gradients out."""
    law = r"$q_{predicted} = q + \frac{3}{2} h \dot{q},\ \partial / \partial q$"
    gives = (name for name in outputs if name == PREDICTED or name.endswith(_name("")))
    return BlockPart("prediction", law, "", ("q", "qd"), tuple(gives))


def _name(matrix: str) -> str:
    return f"{matrix}_gradient"


def _per(unit: str, by: str) -> str:
    """The unit of a gradient: 1/(kg.m) by rad is 1/(kg.m.rad)."""
    top, _, low = unit.partition("/")
    factors = [*filter(None, low.strip("()").split(".")), by]
    return f"{top}/({'.'.join(factors)})" if len(factors) > 1 else f"{top}/{by}"
