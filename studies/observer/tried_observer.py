"""A Kalman observer with what was tried and not built: a fourth state, a dead zone of counts, a
wrench that keeps the impulse, and a grip's stiffness in its prediction.

As components/device/kalman_observer.py, with

    F <- F + T F' - T (K v + B a) on x and y,   F' <- F' + M g_4 e    (order 4; a grip K, B = K/100)
    each angle's error less the dead zone, as far as it is beyond it
    F_hand_observed = F + M g_2 e/T                                   (impulse kept)

and the gains of SciPy's Riccati equation for the chain of integrators.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm, solve_discrete_are

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device.models import device_model
from hapticlink.components.device.variables import seen, start_pose
from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator import open_scene

NAME, T = "tried_observer", 1 / 512


def riccati_gains(omega_n: float, order: int, period: float = T) -> np.ndarray:
    """The gains of the steady Kalman filter of `order` integrators in a row, white noise of density
    omega_n^(2 order) into the first one and of density 1 on the measured output of the last."""
    A = np.eye(order, k=1)
    noise = np.zeros((order, order))
    noise[-1, -1] = omega_n ** (2 * order)
    # Van Loan: the noise over a period
    V = expm(np.block([[-A, noise], [np.zeros((order, order)), A.T]]) * period)
    Phi = V[order:, order:].T
    Q, H, R = Phi @ V[:order, order:], np.eye(order)[:1], np.array([[1 / period]])
    P = solve_discrete_are(Phi.T, H.T, (Q + Q.T) / 2, R)
    return (P @ H.T / (H @ P @ H.T + R)).ravel()


def tried_observer() -> Component:
    """The observer of the twin pantograph."""
    device = open_scene.load("closed-loop").device
    assert device is not None
    model = device_model(device)
    own = ("dead_zone", "impulse", "grip")
    block = Block(
        inputs=[Variable("q", (4,), "rad"), Variable("tau", (4,), "N.m")],
        parameters=[
            start_pose(PLANE),
            *model.parameters,
            Variable("encoder_resolution", (), "rad", device.encoders[0].resolution),
            Variable("g", (4,), "1", 0.0),
            *(Variable(name, (), "1", 0.0) for name in own),
        ],
        states=[
            *(Variable(f"{name}_observer", *PLANE.pose) for name in ("x", "v", "F", "dF")),
            Variable("period", (), "s"),
        ],
        outputs=list(seen(PLANE, force=True)),
    )
    s, u, p = block.x, block.u, block.p
    x, v, F, rate = (s[f"{name}_observer"] for name in ("x", "v", "F", "dF"))
    h, g = s["period"], p["g"]
    inertia, c = model.motion(x, v, p)
    a = ca.solve(inertia, model.jacobian(x, p).T @ u["tau"] + F - c)
    x, F = x + h * v + h**2 / 2 * a, F + h * rate
    F -= h * p["grip"] * ca.vertcat((v + a / 100)[:2], 0)
    v += h * a
    J, e = model.jacobian(x, p), u["q"] - model.angles(x, p)
    dead = p["dead_zone"] * p["encoder_resolution"]
    e = e - ca.fmin(ca.fmax(e, -dead), dead)
    e = ca.solve(J.T @ J, J.T @ e) * (h > 0)
    impulse = p["impulse"] * inertia @ (g[1] * e) / ca.if_else(h > 0, h, 1)
    x, v = x + g[0] * e, v + g[1] * e
    F, rate = F + inertia @ (g[2] * e), rate + inertia @ (g[3] * e)
    inertia, c = model.motion(x, v, p)
    none = ca.SX.zeros(3)
    return block.component(
        NAME,
        "Observers that were tried",
        "sampled",
        initial={
            "x_observer": model.place_from_angles(u["q"], p["x_start"], p),
            **{f"{name}_observer": none for name in ("v", "F", "dF")},
            "period": ca.SX(0),
        },
        step={
            "x_observer": x,
            "v_observer": v,
            "F_observer": F,
            "dF_observer": rate,
            "period": block.h,
        },
        output={"x": x, "v": v, "F_hand_observed": F + impulse, "M": inertia, "c": c},
        documentation=__doc__ or "",
    )


def options(omega_n: float, *, order: int = 3, **settings: float) -> dict[str, Any]:
    """The options of a scene for this observer."""
    found = riccati_gains(omega_n, order)
    start = {"g": [*map(float, found), *[0.0] * (4 - order)], **settings}
    fmu = {"name": "observer", "block": NAME, "replaces": "observer", "start": start}
    return {"device.observer.beside": True, "fmu": [fmu]}
