"""A tight reference for the tip of a linkage: two formulations, whose difference is the floor.

`maximal`: every body in absolute coordinates, joints and loops alike as closures of two points,
[M -G'; G 0] solved by least squares in NumPy. `relative`: the component's own accelerations in
joint coordinates. Both by SciPy's DOP853 at rtol 1e-13.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.ours import Ours
from hapticlink.components.specs.linkage import Linkage

TOLERANCE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}


def tip(ours: Ours, end: float) -> tuple[np.ndarray, float]:
    """(x, y) of the operational point at `end` (s), and the error floor (m)."""
    first, second = _relative(ours, end), _maximal(ours, end)
    return second, float(np.linalg.norm(first - second))


def _relative(ours: Ours, end: float) -> np.ndarray:
    n = len(ours.start) // 2

    def f(_: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[n:], ours.outputs(x)["qdd"]]

    x = solve_ivp(f, (0, end), ours.start, **TOLERANCE).y[:, -1]
    return ours.outputs(x)["x"][:2]


def _maximal(ours: Ours, end: float) -> np.ndarray:
    linkage: Linkage = ours.linkage
    n = len(linkage.body)
    place = {b.name: i for i, b in enumerate(linkage.body)}
    center = {b.name: np.array(b.center or (0.0, 0.0)) for b in linkage.body}
    mass = np.array([[b.mass, b.mass, b.inertia] for b in linkage.body]).ravel()
    applied = np.zeros(3 * n)
    applied.reshape(n, 3)[:, :2] = np.outer(
        [b.mass for b in linkage.body], linkage.gravity or (0, 0)
    )
    pins = [((j.parent, j.at_parent), (j.child, j.at_child)) for j in linkage.joint]
    pins += [tuple(zip(loop.bodies, loop.at, strict=True)) for loop in linkage.loop]
    op = linkage.operational_point

    def arm(body: str, at: tuple[float, float] | None, angle: float) -> np.ndarray:
        x, y = np.array(at or (0.0, 0.0)) - center[body]
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * x - s * y, s * x + c * y])

    def acceleration(z: np.ndarray, zd: np.ndarray) -> np.ndarray:
        G, gamma = np.zeros((2 * len(pins), 3 * n)), np.zeros(2 * len(pins))
        for k, ends in enumerate(pins):
            for sign, (body, at) in zip((1, -1), ends, strict=True):
                if body == "ground":
                    continue
                i = 3 * place[body]
                r = arm(body, at, z[i + 2])
                G[2 * k : 2 * k + 2, i : i + 3] = sign * np.array([[1, 0, -r[1]], [0, 1, r[0]]])
                gamma[2 * k : 2 * k + 2] -= sign * zd[i + 2] ** 2 * r
        force, i = applied.copy(), 3 * place[op.body]
        r = arm(op.body, op.at, z[i + 2])
        fx, fy, moment = ours.wrench
        force[i : i + 3] += (fx, fy, moment + r[0] * fy - r[1] * fx)
        free = force / mass
        S = (G / mass) @ G.T
        return free + (G.T @ np.linalg.lstsq(S, -gamma - G @ free, rcond=1e-13)[0]) / mass

    start = np.r_[_poses(ours)]
    m = 3 * n
    solution = solve_ivp(
        lambda _, y: np.r_[y[m:], acceleration(y[:m], y[m:])], (0, end), start, **TOLERANCE
    )
    z, i = solution.y[:m, -1], 3 * place[op.body]
    return z[i : i + 2] + arm(op.body, op.at, z[i + 2])


def _poses(ours: Ours) -> np.ndarray:
    """Absolute poses and velocities of all bodies' centres, from the assembled start."""
    linkage, n = ours.linkage, len(ours.start) // 2
    q, qd = ours.start[:n], ours.start[n:]
    frames = {"ground": (np.zeros(2), 0.0, np.zeros(2), 0.0)}

    def arm(at: tuple[float, float] | None, angle: float) -> np.ndarray:
        x, y = at or (0.0, 0.0)
        return np.array(
            [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y]
        )

    def moved(frame: tuple, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return frame[0] + r, frame[2] + frame[3] * np.array([-r[1], r[0]])

    waiting = list(zip(linkage.joint, q, qd, strict=True))
    while waiting:
        joint, value, rate = next(w for w in waiting if w[0].parent in frames)
        waiting.remove((joint, value, rate))
        if joint.type != "revolute":
            raise ValueError(f"joint `{joint.name}`: the reference knows revolute joints only")
        parent = frames[joint.parent]
        pivot, drift = moved(parent, arm(joint.at_parent, parent[1]))
        angle, omega = parent[1] + value, parent[3] + rate
        origin, velocity = moved((pivot, angle, drift, omega), -arm(joint.at_child, angle))
        frames[joint.child] = (origin, angle, velocity, omega)
    poses, rates = [], []
    for b in linkage.body:
        at, velocity = moved(frames[b.name], arm(b.center, frames[b.name][1]))
        poses += [*at, frames[b.name][1]]
        rates += [*velocity, frames[b.name][3]]
    return np.array([*poses, *rates])
