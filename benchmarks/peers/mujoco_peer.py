"""MuJoCo: relative joints, loops as `connect` equalities between two sites.

Its equalities are soft by design. They are made as stiff as the documentation allows for a step h
("Solver parameters": time constant at least 2 h, damping ratio 1, impedance near 1), with Newton's
solver at a tight tolerance. All steps of a run are one call into its C library.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Point

NAME = "MuJoCo"
METHODS = ("Euler", "implicitfast", "RK4")


def _xy(point: Point | None) -> str:
    x, y = point or (0.0, 0.0)
    return f"{x!r} {y!r} 0"


def mjcf(linkage: Linkage, method: str, h: float) -> str:
    """The linkage as MJCF. Raises ValueError for what this converter does not know."""
    if linkage.sprung or linkage.driven or linkage.rubbing or linkage.limited:
        raise ValueError("forces of joints and springs have no counterpart in this converter")
    sites: dict[str, list[str]] = {}
    points = [("hand", linkage.operational_point.body, linkage.operational_point.at)]
    for i, loop in enumerate(linkage.loop):
        points += [(f"loop{i}.{k}", loop.bodies[k], loop.at[k]) for k in (0, 1)]
    for name, body, at in points:
        sites.setdefault(body, []).append(f'<site name={quoteattr(name)} pos="{_xy(at)}"/>')

    def below(parent: str) -> str:
        found = "".join(sites.get(parent, ()))
        for j in linkage.joint:
            if j.parent != parent:
                continue
            b = next(b for b in linkage.body if b.name == j.child)
            a, c = j.at_parent or (0.0, 0.0), j.at_child or (0.0, 0.0)
            axis = j.axis or 0.0
            pin = {"revolute": "hinge", "prismatic": "slide"}[j.type]
            along = "0 0 1" if pin == "hinge" else f"{math.cos(axis)!r} {math.sin(axis)!r} 0"
            found += (
                f'<body name={quoteattr(b.name)} pos="{_xy((a[0] - c[0], a[1] - c[1]))}">'
                f'<inertial pos="{_xy(b.center)}" mass="{b.mass!r}" '
                f'diaginertia="{b.inertia!r} {b.inertia!r} {b.inertia!r}"/>'
                f'<joint name={quoteattr(j.name)} type="{pin}" axis="{along}" pos="{_xy(c)}"/>'
                f"{below(b.name)}</body>"
            )
        return found

    equalities = "".join(
        f'<connect site1="loop{i}.0" site2="loop{i}.1" solref="{2 * h!r} 1" '
        'solimp="0.9999 0.9999 0.001 0.5 2"/>'
        for i in range(len(linkage.loop))
    )
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{h!r}" integrator="{method}" '
        f'gravity="{_xy(linkage.gravity)}" solver="Newton" iterations="100" tolerance="1e-14">'
        '<flag contact="disable"/></option>'
        f"<worldbody>{below('ground')}</worldbody><equality>{equalities}</equality></mujoco>"
    )


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, float, float]]:
    model = mujoco.MjModel.from_xml_string(mjcf(linkage, method, h))
    data = mujoco.MjData(model)
    body = model.body(linkage.operational_point.body).id
    places = [int(model.joint(j.name).qposadr[0]) for j in linkage.joint]
    center = next(b.center for b in linkage.body if b.name == linkage.operational_point.body)
    if np.any(wrench) and not np.allclose(
        center or (0, 0), linkage.operational_point.at or (0, 0), atol=1e-12
    ):
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
