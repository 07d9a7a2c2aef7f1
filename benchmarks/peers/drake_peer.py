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

from benchmarks.peers.comparable import axis, pinned, require_comparable, vector
from hapticlink.components.specs.linkage import Joint, Linkage

NAME = "Drake"
METHODS = ("discrete, SAP",)


def _plant(linkage: Linkage, h: float) -> Any:
    """The linkage as a plant. Raises ValueError for what is not compared."""
    require_comparable(linkage)
    plant = plants.MultibodyPlant(h)
    plant.set_discrete_contact_approximation(plants.DiscreteContactApproximation.kSap)
    plant.mutable_gravity_field().set_gravity_vector(vector(linkage.gravity))
    for body in linkage.body:
        I = body.inertia_tensor  # noqa: E741
        inertia = tree.RotationalInertia(*np.diag(I), I[0, 1], I[0, 2], I[1, 2])
        about = tree.SpatialInertia.MakeFromCentralInertia(body.mass, vector(body.center), inertia)
        plant.AddRigidBody(body.name, about)
    for joint in linkage.joint:
        ends = _body(plant, joint.parent), _body(plant, joint.child)
        frames = (
            plant.AddFrame(tree.FixedOffsetFrame(f"{joint.name}.{k}", body.body_frame(), at))
            for k, (body, at) in enumerate(zip(ends, _ends(joint), strict=True))
        )
        plant.AddJoint(_joint(joint, *frames))
    # A ball constraint of the world's own body ends the process: one welded to it takes its place.
    about = tree.SpatialInertia.MakeFromCentralInertia(
        1, np.zeros(3), tree.RotationalInertia(1, 1, 1)
    )
    base = plant.AddRigidBody("base", about)
    plant.WeldFrames(plant.world_frame(), base.body_frame())
    for ends in pinned(linkage):
        found = ((base if of == "ground" else _body(plant, of), at) for of, at in ends)
        plant.AddBallConstraint(*(each for end in found for each in end))
    plant.Finalize()
    return plant


def _body(plant: Any, name: str) -> Any:
    return plant.world_body() if name == "ground" else plant.GetBodyByName(name)


def _ends(joint: Joint) -> list[RigidTransform]:
    return [RigidTransform(vector(at)) for at in (joint.at_parent, joint.at_child)]


def _joint(joint: Joint, parent: Any, child: Any) -> Any:
    if joint.kind.free:
        return tree.PlanarJoint(joint.name, parent, child)
    (freedom,) = joint.kind.freedoms
    if freedom.turns:
        return tree.RevoluteJoint(joint.name, parent, child, axis(joint))
    return tree.PrismaticJoint(joint.name, parent, child, [*joint.direction(freedom), 0])


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, ...]]:
    plant = _plant(linkage, h)
    op = linkage.held
    body, at = _body(plant, op.body), vector(op.at)
    joints = [plant.GetJointByName(joint.name) for joint in linkage.joint]
    order = [
        i for j in joints for i in range(j.position_start(), j.position_start() + j.num_positions())
    ]
    start = np.empty(2 * len(q))
    start[order], start[[len(q) + i for i in order]] = q, qd
    pushed = plants.ExternallyAppliedSpatialForce()
    pushed.body_index, pushed.p_BoBq_B = body.index(), at
    pushed.F_Bq_W = SpatialForce(tau=[0, 0, wrench[2]], f=[*wrench[:2], 0])

    def run(steps: int) -> tuple[float, ...]:
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        plant.SetPositionsAndVelocities(context, start)
        if np.any(wrench):
            plant.get_applied_spatial_force_input_port().FixValue(context, [pushed])
        simulator.Initialize()
        began = time.perf_counter()
        simulator.AdvanceTo(steps * h)
        seconds = time.perf_counter() - began
        place = plant.CalcPointsPositions(context, body.body_frame(), at, plant.world_frame())
        return *place.ravel()[: linkage.dimension].tolist(), seconds

    return run
