"""Exudyn: bodies in absolute coordinates, joints and loops as RevoluteJoint2D constraints, in space
as revolute joints of bodies with Euler parameters.

Its implicit second-order integrators solve index 2 (trapezoidal) and index 3 (generalised alpha)
with Newton iterations inside its C++ solver; its explicit integrators take no joints. Built as its
own N-four-bar example is: modified Newton, no files. The "fast" build of the module is used.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

import numpy as np

from benchmarks.maximal import Bodies
from benchmarks.peers.comparable import axis, require_comparable, vector
from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Place, in_plane

# The build without range checks, as its documentation advises.
sys.exudynFast = True  # type: ignore[attr-defined]
import exudyn as exu  # noqa: E402
import exudyn.itemInterface as item  # noqa: E402
from exudyn.utilities import RigidBodyInertia  # noqa: E402

NAME = "Exudyn"
METHODS = ("trapezoidal, index 2", "generalised alpha (0.9), index 3")
SPARSE_FROM = 30  # bodies


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, ...]]:
    settings = _settings(method, h, len(linkage.body))
    build = _build_in_space if linkage.dimension > 2 else _build

    def run(steps: int) -> tuple[float, ...]:
        system, mbs, sensor = build(linkage, wrench, q, qd)
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = steps * h
        solver = exu.MainSolverImplicitSecondOrder()
        solver.InitializeSolver(mbs, settings)
        began = time.perf_counter()
        done = solver.SolveSteps(mbs, settings)
        seconds = time.perf_counter() - began
        place = mbs.GetSensorValues(sensor) if done else np.full(3, math.nan)
        solver.FinalizeSolver(mbs, settings)
        system.Reset()
        return *place[: linkage.dimension].tolist(), seconds

    return run


def _build_in_space(linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray) -> tuple:
    """As `_build`, of a linkage of revolute joints that starts at rest."""
    require_comparable(linkage)
    if np.any(qd) or np.any(wrench):
        raise ValueError("in space a linkage falls from rest")
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    numbers = {"ground": mbs.CreateGround()}
    at_start = {name: pose[0] for name, pose in poses(linkage, [q.tolist()]).items()}

    def place(body: str, at: Place | None) -> np.ndarray:
        pose = at_start[body]
        return pose[:3] + pose[3:].reshape(3, 3).T @ vector(at)

    for b in linkage.body:
        turned = at_start[b.name][3:].reshape(3, 3).T
        inertia = RigidBodyInertia(mass=b.mass, inertiaTensor=b.inertia_tensor)
        numbers[b.name] = mbs.CreateRigidBody(
            referencePosition=place(b.name, b.center),
            referenceRotationMatrix=turned,
            inertia=inertia,
            gravity=vector(linkage.gravity),
        )
    pins = [(j.parent, j.child, place(j.parent, j.at_parent), axis(j)) for j in linkage.joint]
    for loop in linkage.loop:
        own = loop.axes[0] if loop.axes else (0.0, 0.0, 1.0)
        pins.append((*loop.bodies, place(loop.bodies[0], loop.at[0]), np.array(own)))
    for first, second, at, along in pins:
        mbs.CreateRevoluteJoint(
            bodyNumbers=[numbers[first], numbers[second]],
            position=at,
            axis=at_start[first][3:].reshape(3, 3).T @ along,
            useGlobalFrame=True,
        )
    op = linkage.held
    center = next(b.center for b in linkage.body if b.name == op.body)
    sensor = mbs.AddSensor(
        item.SensorBody(
            bodyNumber=numbers[op.body],
            localPosition=vector(op.at) - vector(center),
            outputVariableType=exu.OutputVariableType.Position,
            writeToFile=False,
        )
    )
    mbs.Assemble()
    return container, mbs, sensor


def _build(linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray) -> tuple:
    """(system container, assembled system, sensor at the operational point)."""
    z, zd = (each.reshape(-1, 3) for each in Bodies(linkage).start(q, qd))
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    centers = {b.name: np.array(b.center or (0.0, 0.0)) for b in linkage.body} | {
        "ground": np.zeros(2)
    }
    numbers = {"ground": mbs.AddObject(item.ObjectGround())}
    for b, pose, velocity in zip(linkage.body, z, zd, strict=True):
        node = mbs.AddNode(
            item.NodeRigidBody2D(
                referenceCoordinates=[*pose],
                initialCoordinates=[0.0, 0.0, 0.0],
                initialVelocities=[*velocity],
            )
        )
        numbers[b.name] = mbs.AddObject(
            item.ObjectRigidBody2D(physicsMass=b.mass, physicsInertia=b.inertia, nodeNumber=node)
        )
        if linkage.gravity is not None:
            weight = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=numbers[b.name]))
            mbs.AddLoad(
                item.LoadMassProportional(markerNumber=weight, loadVector=[*linkage.gravity, 0.0])
            )

    def marker(body: str, at: Place | None) -> int:
        local = np.array(in_plane(at)) - centers[body]
        return mbs.AddMarker(
            item.MarkerBodyRigid(bodyNumber=numbers[body], localPosition=[*local, 0.0])
        )

    pins = [(marker(j.parent, j.at_parent), marker(j.child, j.at_child)) for j in linkage.joint]
    pins += [(a, b) for loop in linkage.loop for a, b in [map(marker, loop.bodies, loop.at)]]
    for ends in pins:
        mbs.AddObject(item.ObjectJointRevolute2D(markerNumbers=list(ends)))
    op = linkage.held
    hand = marker(op.body, op.at)
    if np.any(wrench):
        mbs.AddLoad(item.LoadForceVector(markerNumber=hand, loadVector=[*wrench[:2], 0.0]))
        mbs.AddLoad(item.LoadTorqueVector(markerNumber=hand, loadVector=[0.0, 0.0, wrench[2]]))
    sensor = mbs.AddSensor(
        item.SensorMarker(
            markerNumber=hand, outputVariableType=exu.OutputVariableType.Position, writeToFile=False
        )
    )
    mbs.Assemble()
    return container, mbs, sensor


def _settings(method: str, h: float, bodies: int) -> exu.SimulationSettings:
    settings = exu.SimulationSettings()
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsStoreAndWriteFiles = False
    settings.solutionSettings.coordinatesSolutionFileName = ""
    settings.timeIntegration.verboseMode = 0
    settings.displayStatistics = False
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-8
    trapezoidal = method == METHODS[0]
    settings.timeIntegration.generalizedAlpha.useIndex2Constraints = trapezoidal
    settings.timeIntegration.generalizedAlpha.useNewmark = trapezoidal
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.adaptiveStep = False
    settings.linearSolver.solverType = (
        exu.LinearSolverType.EigenSparse
        if bodies >= SPARSE_FROM
        else exu.LinearSolverType.EigenDense
    )
    settings.linearSolver.ignoreSingularJacobian = bodies < SPARSE_FROM
    return settings
