"""MuJoCo: relative joints, loops as `connect` equalities between two sites, in space two a loop.

Its equalities are soft by design. They are made as stiff as the documentation allows for a step h
("Solver parameters": time constant at least 2 h, damping ratio 1, impedance near 1), with Newton's
solver at a tight tolerance. All steps of a run are one call into its C library.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
import numpy as np

from benchmarks.peers.comparable import axis, pinned, require_comparable, vector
from hapticlink.components.specs.linkage import Linkage
from hapticlink.fmus.engine.mjcf import RIGID, mjcf
from hapticlink.fmus.errors import FmuError

NAME = "MuJoCo"
INTEGRATORS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
METHODS = (*INTEGRATORS,)
DENSE = mujoco.mjtJacobian.mjJAC_DENSE


def compiled(linkage: Linkage, method: str, h: float) -> mujoco.MjModel:
    """The linkage as a model. Raises ValueError for what the engine does not know."""
    if linkage.sprung or linkage.driven or linkage.rubbing or linkage.limited:
        raise ValueError("forces of joints and springs are not compared")
    try:
        if linkage.dimension > 2:
            return _in_space(linkage, method, h)
        model = mujoco.MjModel.from_xml_string(mjcf(linkage, None, method))
    except FmuError as error:
        raise ValueError(str(error)) from error
    model.opt.timestep, model.opt.disableflags = h, 0
    return model


def _in_space(linkage: Linkage, method: str, h: float) -> mujoco.MjModel:
    """The linkage with the options and closures that `mjcf` gives one in the plane."""
    require_comparable(linkage)
    spec = mujoco.MjSpec()
    spec.option.integrator = INTEGRATORS[method]
    spec.option.gravity, spec.option.timestep = vector(linkage.gravity), h
    spec.option.solver, spec.option.jacobian = mujoco.mjtSolver.mjSOL_NEWTON, DENSE
    spec.option.iterations, spec.option.tolerance = 100, 1e-14
    made = {"ground": spec.worldbody}
    for joint in linkage.joint:  # each parent comes before its children
        of = next(b for b in linkage.body if b.name == joint.child)
        place = vector(joint.at_parent) - vector(joint.at_child)
        made[joint.child] = body = made[joint.parent].add_body(name=joint.child, pos=place)
        I = of.inertia_tensor  # noqa: E741
        body.explicitinertial, body.mass, body.ipos = True, of.mass, vector(of.center)
        body.fullinertia = [*np.diag(I), I[0, 1], I[0, 2], I[1, 2]]
        hinge = {"type": mujoco.mjtJoint.mjJNT_HINGE, "pos": vector(joint.at_child)}
        body.add_joint(name=joint.name, axis=axis(joint), **hinge)
    made[linkage.held.body].add_site(name="hand", pos=vector(linkage.held.at))
    for i, ends in enumerate(pinned(linkage)):
        names = [f"pin{i}.{k}" for k in (0, 1)]
        for name, (body, at) in zip(names, ends, strict=True):
            made[body].add_site(name=name, pos=at)
        sites = {"objtype": mujoco.mjtObj.mjOBJ_SITE, "name1": names[0], "name2": names[1]}
        stiff = {"solref": [1e-6, 1.0], "solimp": [float(v) for v in RIGID.split()]}
        spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, **sites, **stiff)
    return spec.compile()


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, ...]]:
    model = compiled(linkage, method, h)
    data = mujoco.MjData(model)
    body = model.body(linkage.held.body).id
    places = [int(model.joint(j.name).qposadr[0]) for j in linkage.joint]
    center = next(b.center for b in linkage.body if b.name == linkage.held.body)
    if np.any(wrench) and not np.allclose(center or (0, 0), linkage.held.at or (0, 0), atol=1e-12):
        raise ValueError("MuJoCo's xfrc_applied acts at the centre of mass only")

    def run(steps: int) -> tuple[float, ...]:
        mujoco.mj_resetData(model, data)
        data.qpos[places], data.qvel[places] = q, qd
        data.xfrc_applied[body, [0, 1, 5]] = wrench
        began = time.perf_counter()
        mujoco.mj_step(model, data, nstep=steps)
        seconds = time.perf_counter() - began
        mujoco.mj_kinematics(model, data)
        return *data.site("hand").xpos[: linkage.dimension].tolist(), seconds

    return run
