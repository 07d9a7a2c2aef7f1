"""Exudyn: bodies in absolute coordinates, joints and loops as RevoluteJoint2D constraints.

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
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Place, in_plane

# The build without range checks, as its documentation advises.
sys.exudynFast = True  # type: ignore[attr-defined]
import exudyn as exu  # noqa: E402
import exudyn.itemInterface as item  # noqa: E402

NAME = "Exudyn"
METHODS = ("trapezoidal, index 2", "generalised alpha (0.9), index 3")
SPARSE_FROM = 30  # bodies


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, float, float]]:
    z, zd = Bodies(linkage).start(q, qd)
    settings = _settings(method, h, len(linkage.body))

    def run(steps: int) -> tuple[float, float, float]:
        system, mbs, sensor = _build(linkage, wrench, z.reshape(-1, 3), zd.reshape(-1, 3))
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = steps * h
        solver = exu.MainSolverImplicitSecondOrder()
        solver.InitializeSolver(mbs, settings)
        began = time.perf_counter()
        done = solver.SolveSteps(mbs, settings)
        seconds = time.perf_counter() - began
        x, y = mbs.GetSensorValues(sensor)[:2] if done else (math.nan, math.nan)
        solver.FinalizeSolver(mbs, settings)
        system.Reset()
        return x, y, seconds

    return run


def _build(linkage: Linkage, wrench: np.ndarray, z: np.ndarray, zd: np.ndarray) -> tuple:
    """(system container, assembled system, sensor at the operational point); z and zd: poses and
    velocities of the centres of mass, (k, 3)."""
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
