"""Drake: relative joints, loops as ball constraints of its discrete plant.

Ball constraints exist in the discrete plant with the solver SAP alone (documentation of
MultibodyPlant::AddBallConstraint), whose step is of first order. All steps of a run are one call
into its C++ library.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody import plant as plants
from pydrake.multibody import tree
from pydrake.multibody.math import SpatialForce
from pydrake.systems.analysis import Simulator

from benchmarks.peers.comparable import require_comparable
from hapticlink.components.specs.linkage import Joint, Linkage
from hapticlink.components.specs.quantities import Place, in_plane

NAME = "Drake"
METHODS = ("discrete, SAP",)


def _place(point: Place | None) -> np.ndarray:
    return np.array([*in_plane(point), 0.0])


def _plant(linkage: Linkage, h: float) -> Any:
    """The linkage as a plant. Raises ValueError for what is not compared."""
    require_comparable(linkage)
    plant = plants.MultibodyPlant(h)
    plant.set_discrete_contact_approximation(plants.DiscreteContactApproximation.kSap)
    plant.mutable_gravity_field().set_gravity_vector(_place(linkage.gravity))
    for body in linkage.body:
        inertia = tree.RotationalInertia(body.inertia, body.inertia, body.inertia)
        about = tree.SpatialInertia.MakeFromCentralInertia(body.mass, _place(body.center), inertia)
        plant.AddRigidBody(body.name, about)
    for joint in linkage.joint:
        ends = _body(plant, joint.parent), _body(plant, joint.child)
        frames = (
            plant.AddFrame(tree.FixedOffsetFrame(f"{joint.name}.{k}", body.body_frame(), at))
            for k, (body, at) in enumerate(zip(ends, _ends(joint), strict=True))
        )
        plant.AddJoint(_joint(joint, *frames))
    for loop in linkage.loop:
        (a, at_a), (b, at_b) = (
            (_body(plant, body), _place(at)) for body, at in zip(loop.bodies, loop.at, strict=True)
        )
        plant.AddBallConstraint(a, at_a, b, at_b)
    plant.Finalize()
    return plant


def _body(plant: Any, name: str) -> Any:
    return plant.world_body() if name == "ground" else plant.GetBodyByName(name)


def _ends(joint: Joint) -> list[RigidTransform]:
    return [RigidTransform(_place(at)) for at in (joint.at_parent, joint.at_child)]


def _joint(joint: Joint, parent: Any, child: Any) -> Any:
    if joint.kind.free:
        return tree.PlanarJoint(joint.name, parent, child)
    (freedom,) = joint.kind.freedoms
    if freedom.turns:
        return tree.RevoluteJoint(joint.name, parent, child, [0, 0, 1])
    return tree.PrismaticJoint(joint.name, parent, child, [*joint.direction(freedom), 0])


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, float, float]]:
    plant = _plant(linkage, h)
    op = linkage.held
    body, at = _body(plant, op.body), _place(op.at)
    joints = [plant.GetJointByName(joint.name) for joint in linkage.joint]
    order = [
        i for j in joints for i in range(j.position_start(), j.position_start() + j.num_positions())
    ]
    start = np.empty(2 * len(q))
    start[order], start[[len(q) + i for i in order]] = q, qd
    pushed = plants.ExternallyAppliedSpatialForce()
    pushed.body_index, pushed.p_BoBq_B = body.index(), at
    pushed.F_Bq_W = SpatialForce(tau=[0, 0, wrench[2]], f=[*wrench[:2], 0])

    def run(steps: int) -> tuple[float, float, float]:
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        plant.SetPositionsAndVelocities(context, start)
        if np.any(wrench):
            plant.get_applied_spatial_force_input_port().FixValue(context, [pushed])
        simulator.Initialize()
        began = time.perf_counter()
        simulator.AdvanceTo(steps * h)
        seconds = time.perf_counter() - began
        x, y, _ = plant.CalcPointsPositions(
            context, body.body_frame(), at, plant.world_frame()
        ).ravel()
        return float(x), float(y), seconds

    return run
