"""The closed loop as one differential equation, of the components' own expressions.

Mechanism in joint coordinates, device, controller and hand at the same instant, with nothing
sampled and nothing held:

    D qdd + C qd = Q + J_h' (F_h - F_drift) + W' lambda                   (B.6)
    M_d v_D' + C_d v_D = J_q' tau(F_motor) + F_h + stops                  (4.5)

State y = (q, qd, x_D, v_D), and (x_a, v_a) of an arm. The number of constrained directions is a
discrete state, `mode`, which changes where an eigenvalue of S Lambda^-1 S passes its tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from benchmarks.continuous.hand import Hand
from benchmarks.continuous.march import Guards
from hapticlink.components.component import Component
from hapticlink.components.device.models import device_model
from hapticlink.fmus.blocks import component
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene


class Relative:
    """The loop of a scene with one linkage, ideal sensing, and nothing from the graphics copy.
    Raises ValueError for a hand that `Hand` does not know."""

    def __init__(self, scene: Scene) -> None:
        made = {b.name: component(b.block, b.settings) for b in blocks(scene).built}
        mechanism, controller = made["virtual_mechanism"], made["controller"]
        assert scene.device
        self.hand, device = Hand(scene.hand), device_model(scene.device)
        n = sum(v.size for v in mechanism.states if v.name == "q")
        y, mode, t = ca.SX.sym("y", 2 * n + 6 + 6 * self.hand.moves), ca.SX.sym("mode"), ca.SX(0)
        motion, x_D, v_D = y[: 2 * n], y[2 * n : 2 * n + 3], y[2 * n + 3 : 2 * n + 6]
        target = ca.SX.sym("target", 6)

        F_hand, arm = self.hand.rates(y[2 * n + 6 :], x_D, v_D, target, ca.vertcat)
        start = mechanism.start_inputs, mechanism.start_parameters
        first = np.array(mechanism.initialize(*start)).ravel()
        ends = np.cumsum([v.size for v in mechanism.states])
        at_start = dict(
            zip((v.name for v in mechanism.states), np.split(first, ends), strict=False)
        )
        # In continuous time no place passes a shape: its side is not kept, as at the start.
        moves = {"q": motion[:n], "qd": motion[n:], "n_constrained": mode}
        state = ca.vertcat(*(moves.get(name, ca.DM(value)) for name, value in at_start.items()))
        free = _outputs(mechanism, state, {}, t)
        p = device.numbers
        M, c = device.motion(x_D, v_D, p)
        seen = {
            "x_S": free["x"],
            "v_S": free["v"],
            "x_D": x_D,
            "v_D": v_D,
            "F_hand": F_hand,
            "M": M,
            "c": c,
            "F_env": free.get("F_env", ca.SX(3, 1)),
            **{name: free[name] for name in ("Lambda_inv", "P_c", "a_bias")},
        }
        forces = _outputs(controller, ca.SX(0, 1), seen, t)
        pushed = {"F_hand": F_hand, "F_drift": forces["F_drift"]}
        qdd = _outputs(mechanism, state, pushed, t)["qdd"]
        tau = device.motor_torques(forces["F_motor"], x_D, p)
        wrench = device.jacobian(x_D, p).T @ tau + F_hand - c
        wrench += device.stop_force(x_D, v_D, p)
        rate = ca.vertcat(motion[n:], qdd, v_D, ca.solve(M, wrench), *arm)
        cse = {"cse": True}
        self._rate = ca.Function("rate", [y, mode, target], [rate], cse)
        self._mobility = ca.Function("mobility", [motion], [free["Lambda_inv"]], cse)
        self.guards = Guards(scene, self.mobility)

        self.first_mode = int(at_start["n_constrained"][0])
        pose = np.array(mechanism.output(first, *start, 0.0)).ravel()[:3]
        self.start = np.r_[first[: 2 * n], pose, np.zeros(3), self.hand.start(pose)]
        self.handle = slice(2 * n, 2 * n + 2)
        self._motion = slice(0, 2 * n)

    def rate(self, t: float, y: np.ndarray, mode: int) -> np.ndarray:
        """y' at time t (s)."""
        return np.array(self._rate(y, mode, self.hand.target(t))).ravel()

    def mobility(self, y: np.ndarray) -> np.ndarray:
        """Lambda^-1, (3, 3)."""
        return np.array(self._mobility(y[self._motion]))


def _outputs(block: Component, x: ca.SX, u: Mapping[str, ca.SX], t: ca.SX) -> dict[str, ca.SX]:
    """The outputs of a block by name, with inputs `u` by name, 0 for those that are not given."""
    given = [ca.vec(u[v.name].T) if v.name in u else ca.SX.zeros(v.size) for v in block.inputs]
    flat = block.output(x, ca.vertcat(*given), ca.DM(block.start_parameters), t)
    found, first = {}, 0
    for v in block.outputs:
        values = flat[first : first + v.size]
        if len(v.shape) == 2:
            values = ca.reshape(values, v.shape[1], v.shape[0]).T
        found[v.name] = values
        first += v.size
    return found
