"""Matrices of the copy at coordinates that it predicts, with their gradients there: what the hold
`model` goes on from at the coordinates of the moment.

What is read at t_n is known at t_n + h and used until t_n + 2 h. In the middle of that time the
mechanism is, to first order, at

    q_predicted = q + 3/2 h qd

The gradient of the projector P on the eigenvectors v_i of the small eigenvalues l_i of A, by those
of A (Kato, Perturbation Theory for Linear Operators, section II.2):

    dP = sum over i in P, j not in P of (v_i v_j' + v_j v_i') (v_j' dA v_i) / (l_i - l_j)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import casadi as ca

from hapticlink.components.component import Block, Variable
from hapticlink.components.dynamics.constrained_directions import (
    ConstrainedDirections,
    is_among_smallest,
)
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


def of_matrix(name: str, matrix: ca.SX, q: ca.SX) -> dict[str, ca.SX]:
    """The gradient of an output that is an expression of the symbols q."""
    return {_name(name): ca.jacobian(ca.vec(matrix.T), q)}


def of_projector(name: str, found: ConstrainedDirections, q: ca.SX) -> dict[str, ca.SX]:
    """That of the projector on constrained directions, which are expressions of the symbols q."""
    A, values, vectors = found.scaled, found.values, found.vectors
    n, chosen = A.shape[0], is_among_smallest(values, found.number)
    turned = [
        vectors.T @ ca.reshape(column, n, n) @ vectors
        for column in ca.horzsplit(ca.jacobian(ca.vec(A), q))
    ]
    columns = []
    for rate in turned:
        mixed = ca.SX(n, n)
        for i in range(n):
            for j in range(n):
                parts = chosen[i] * (1 - chosen[j])
                gap = ca.if_else(parts, values[i] - values[j], 1)
                mixed[i, j] = parts * rate[j, i] / gap
        columns.append(ca.vec((vectors @ (mixed + mixed.T) @ vectors.T).T))
    return {_name(name): ca.horzcat(*columns)}


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
