"""Whether the contacts of a scene are too stiff for the steps of an explicit integration method.

With A the mobility of the point of contact, for two bodies the sum of both, a contact that pushes
has the poles of e'' + b A e' + k A e = 0. Beyond |pole| h = 2 a step no longer follows them, and
from 2.79 on (RK4) energy rises with each contact. One that sticks has those with b = k tau along
the surface, where A contains the turning of rounded shapes: beyond, it chatters and creeps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as ca
import numpy as np

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.dynamics.linkage_values import start_mobility
from hapticlink.components.forces import friction
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts, Pair
from hapticlink.components.specs.linkage import Linkage

STABLE = 2.0  # |pole| h


def poles(linkage: Linkage, contacts: Contacts) -> Iterator[tuple[Pair, float]]:
    """Each pair that can touch, and the size (1/s) of its contacts' fastest pole, with the largest
    mobility of the corners of the bodies' shapes at the start pose."""
    yield from _poles(linkage, contacts, contacts.damping, False)


def sticking_poles(linkage: Linkage, contacts: Contacts, h: float) -> Iterator[tuple[Pair, float]]:
    """The same along the surface for contacts that stick, at steps of h (s); none without
    friction."""
    if contacts.friction:
        damping = contacts.stiffness * friction.LAG * h
        yield from _poles(linkage, contacts, damping, True)


def _poles(
    linkage: Linkage, contacts: Contacts, damping: float, along: bool
) -> Iterator[tuple[Pair, float]]:
    mobility = _mobilities(linkage, along)
    for pair in near(linkage, contacts):
        A = mobility[pair.body] + mobility[pair.obstacle if pair.kind == "body" else "ground"]
        half, product = damping * A / 2, contacts.stiffness * A
        overdamped = half**2 > product
        yield pair, half + math.sqrt(half**2 - product) if overdamped else math.sqrt(product)


def _mobilities(linkage: Linkage, along: bool) -> dict[str, float]:
    """The largest mobility of each body's corners in any direction, or of points of its surface
    `along` it, at the radius r from a corner: u' A u, u = (cos, sin, r), in 64 directions."""
    corners = [(body, corner) for body in linkage.body for corner in body.shape]

    def places(model: LinkageModel) -> ca.SX:
        placed = ((model.frames[body.name], ca.SX(ca.DM(corner))) for body, corner in corners)
        return ca.vertcat(*(ca.vertcat(f.point(corner), f.angle) for f, corner in placed))

    closed, _ = start_mobility(linkage, places)
    mobilities = {"ground": 0.0}
    angles = np.arange(64) * math.pi / 32
    for i, (body, _) in enumerate(corners):
        own = closed[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        u = np.stack([np.cos(angles), np.sin(angles), np.full(64, body.radius or 0.0)])
        most = np.max(np.sum(u * (own @ u), 0)) if along else np.linalg.eigvalsh(own[:2, :2])[-1]
        mobilities[body.name] = max(mobilities.get(body.name, 0.0), float(most))
    return mobilities
