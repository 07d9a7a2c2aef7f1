"""What a new frame of contacts changes at a pose: the energy of the contacts' springs, which nobody
puts in, and F_env (2.18). Both jump, since the mechanism is where it was. Springs of friction are
left out: they keep their deflections."""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Signals
from hapticlink.components.contact.contact_forces import (
    ContactForces,
    contact_parameters,
    contact_port,
    held_contacts,
)
from hapticlink.components.dynamics.equivalent_wrench import equivalent_wrench
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import length_parameter, parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage


def frame_change(linkage: Linkage, contacts: Contacts, length_scale: float | None) -> ca.Function:
    """(q, qd, rows, rows') -> (E' - E (J), F' - F (N, N, N.m)), for flat rows of the `contacts`
    port before and after."""
    length = length_parameter(linkage, length_scale)
    declared = [*parameters(linkage), *contact_parameters(linkage, contacts), length]
    p = Signals("p", declared)
    model = LinkageModel.symbolic(linkage, p)
    space = OperationalSpace(model)
    port, found = contact_port(linkage, contacts), list[tuple[ca.SX, ca.SX]]()
    rows = [ca.SX.sym(name, port.size) for name in ("before", "after")]
    for flat in rows:
        held = held_contacts(model, contacts, ca.reshape(flat, *port.shape[::-1]).T)
        forces = ContactForces(model, contacts, p, held)
        found.append((forces.energy, forces.efforts()))
    (E0, Q0), (E1, Q1) = found
    J_h = space.terms.J_h
    acceleration = J_h @ space.response(Q1 - Q0)[0]
    mobilities = space.Lambda_inv, space.open_mobility(J_h)
    F = equivalent_wrench(linkage.space, *mobilities, acceleration, p["length_scale"])
    change = ca.Function("change", [model.q, model.qd, *rows, p.vector], [E1 - E0, F])
    arguments = change.sx_in()[:-1]
    results = change.call([*arguments, ca.SX(ca.DM(p.starts))])
    return ca.Function("frame_change", arguments, results, {"cse": True})
