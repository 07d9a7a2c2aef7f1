"""Whether the contacts of a scene are too stiff for the steps of an explicit integration method.

With A the mobility of the point of contact, for two bodies the sum of both, a contact that pushes
has the poles of e'' + b A e' + k A e = 0. Beyond |pole| h = 2 a step no longer follows them, and
from 2.79 on (RK4) energy rises with each contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as ca
import numpy as np

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.dynamics.start_mobility import start_mobility
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts, Pair
from hapticlink.components.specs.linkage import Linkage

STABLE = 2.0  # |pole| h


def poles(linkage: Linkage, contacts: Contacts) -> Iterator[tuple[Pair, float]]:
    """Each pair that can touch, and the size (1/s) of its contacts' fastest pole, with the largest
    mobility of the corners of the bodies' shapes at the start pose."""
    points = [(body.name, at) for body in linkage.body for at in body.shape]

    def places(model: LinkageModel) -> ca.SX:
        return ca.vertcat(*(model.frames[body].point(ca.SX(ca.DM(at))) for body, at in points))

    closed, _ = start_mobility(linkage, places)
    mobility = {"ground": 0.0}
    for i, (body, _) in enumerate(points):
        own = closed[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        mobility[body] = max(mobility.get(body, 0.0), float(np.linalg.eigvalsh(own)[-1]))
    for pair in near(linkage, contacts):
        A = mobility[pair.body] + mobility[pair.obstacle if pair.kind == "body" else "ground"]
        half, product = contacts.damping * A / 2, contacts.stiffness * A
        overdamped = half**2 > product
        yield pair, half + math.sqrt(half**2 - product) if overdamped else math.sqrt(product)
