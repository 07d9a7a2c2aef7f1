"""MuJoCo: relative joints, loops as `connect` equalities between two sites.

Its equalities are soft by design. They are made as stiff as the documentation allows for a step h
("Solver parameters": time constant at least 2 h, damping ratio 1, impedance near 1), with Newton's
solver at a tight tolerance. All steps of a run are one call into its C library.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
import numpy as np

from hapticlink.components.specs.linkage import Linkage
from hapticlink.fmus.engine.mjcf import mjcf
from hapticlink.fmus.errors import FmuError

NAME = "MuJoCo"
METHODS = ("Euler", "implicitfast", "RK4")


def compiled(linkage: Linkage, method: str, h: float) -> mujoco.MjModel:
    """The linkage as a model. Raises ValueError for what the engine does not know."""
    if linkage.sprung or linkage.driven or linkage.rubbing or linkage.limited:
        raise ValueError("forces of joints and springs are not compared")
    try:
        model = mujoco.MjModel.from_xml_string(mjcf(linkage, None, method))
    except FmuError as error:
        raise ValueError(str(error)) from error
    model.opt.timestep, model.opt.disableflags = h, 0
    return model


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, float, float]]:
    model = compiled(linkage, method, h)
    data = mujoco.MjData(model)
    body = model.body(linkage.held.body).id
    places = [int(model.joint(j.name).qposadr[0]) for j in linkage.joint]
    center = next(b.center for b in linkage.body if b.name == linkage.held.body)
    if np.any(wrench) and not np.allclose(center or (0, 0), linkage.held.at or (0, 0), atol=1e-12):
        raise ValueError("MuJoCo's xfrc_applied acts at the centre of mass only")

    def run(steps: int) -> tuple[float, float, float]:
        mujoco.mj_resetData(model, data)
        data.qpos[places], data.qvel[places] = q, qd
        data.xfrc_applied[body, [0, 1, 5]] = wrench
        began = time.perf_counter()
        mujoco.mj_step(model, data, nstep=steps)
        seconds = time.perf_counter() - began
        mujoco.mj_kinematics(model, data)
        x, y, _ = data.site("hand").xpos
        return float(x), float(y), seconds

    return run
