"""Nicosia observer: estimates device velocity, acceleration and hand force from the angles of the
driven joints and the torques of their motors.

The report's section 4.2.1 names it (after Nicosia & Tomei 1990) without equations or gains. On the
pose x that belongs to the measured angles,

    x1' = x2 + k_D e,    M x2' = F_m - C x2 + K_p e,    e = x - x1,    K_p = M omega_n^2

x1 (m, m, rad) follows the measured pose x and x2 the velocity; F_m is the motors' wrench.
For constant M and C = 0 the observed force follows

    F_observed / F = K_p / (M s^2 + k_D M s + K_p).

M and C are constant over a step, so that any rule of `discretisation` applies to the linear system.
At t = 0 x1 is the measured pose and x2 zero: no velocity, no force.

`ForceObserver` knows a mass, `HandleObserver` any device by its kinematics. The latter is the
observer within the device's block, and that of the block `observer` beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from hapticlink.components.device import discretisation
from hapticlink.components.device.device_model import DeviceModel, Parameters


class State(NamedTuple):
    """x1 (m, m, rad) and x2 (m/s, m/s, rad/s), each (n,)."""

    x1: ca.SX
    x2: ca.SX


@dataclass(frozen=True)
class ForceObserver:
    """The observer with gains omega_n (rad/s) and k_D (1/s), stepped by a rule of
    `discretisation`."""

    rule: str
    omega_n: ca.SX
    k_D: ca.SX

    def step(
        self,
        state: State,
        pose: ca.SX,
        pose_next: ca.SX,
        F_motor: ca.SX,
        M: ca.SX,
        C: ca.SX,
        period: ca.SX,
    ) -> State:
        """The state at the end of a `period` (s), with the pose measured at both ends.

        F_motor is the wrench held over the period; M and C are (n, n), the others (n,). Raises
        ValueError for an unknown rule.
        """
        n = pose.numel()
        identity, zero, K = ca.SX.eye(n), ca.SX(n, n), self.omega_n**2
        A = ca.blockcat([[-self.k_D * identity, identity], [-K * identity, -ca.solve(M, C)]])
        B = ca.blockcat([[self.k_D * identity, zero], [K * identity, identity]])
        push = ca.solve(M, F_motor)
        u, u_next = ca.vertcat(pose, push), ca.vertcat(pose_next, push)
        x = discretisation.step(self.rule, A, B, ca.vertcat(*state), u, u_next, period)
        return State(x[:n], x[n:])

    def force(self, state: State, pose: ca.SX, M: ca.SX) -> ca.SX:
        """Observed hand wrench K_p e (N, N, N.m)."""
        return self.omega_n**2 * (M @ (pose - state.x1))

    def velocity(self, state: State, pose: ca.SX) -> ca.SX:
        """Observed velocity x1' = x2 + k_D e (m/s, m/s, rad/s).

        x2 itself is biased by k_D K_p^-1 F, with F the hand's wrench, which is no input.
        """
        return state.x2 + self.k_D * (pose - state.x1)


class ObservedHandle(NamedTuple):
    """The measured place of the device at a sample, (n,), and the state of the observer there."""

    place: ca.SX
    state: State

    @property
    def states(self) -> dict[str, ca.SX]:
        """By the names that they have in a block."""
        x1, x2 = self.state
        return {"x_measured": self.place, "x_observer": x1, "v_observer": x2}

    def unsampled(self, guess: ca.SX) -> ObservedHandle:
        """The state before a first sample at which it is advanced by a period of 0: the place is
        found again from the guess."""
        return self._replace(place=guess)


@dataclass(frozen=True)
class HandleObserver:
    """The observer of a device with parameters p, `omega_n` and `k_D` among them, stepped by a rule
    of `discretisation`, in the k directions in which the device is felt."""

    device: DeviceModel
    p: Parameters
    rule: str

    def read(self, x: Mapping[str, ca.SX]) -> ObservedHandle:
        """That of a block with the states x."""
        return ObservedHandle(x["x_measured"], State(x["x_observer"], x["v_observer"]))

    def start(self, angles: ca.SX, guess: ca.SX) -> ObservedHandle:
        """The handle at rest, without a force, with measured angles near a guessed place."""
        place = self.device.place_from_angles(angles, guess, self.p)
        y = self.device.handle(place, self.p)
        return ObservedHandle(place, State(y, ca.SX.zeros(y.numel())))

    def advance(
        self, before: ObservedHandle, angles: ca.SX, tau: ca.SX, period: ca.SX
    ) -> ObservedHandle:
        """The handle with measured angles, a `period` (s) after a sample before it, over which the
        torques tau (N.m) were held."""
        place = self.device.place_from_angles(angles, before.place, self.p)
        F_motor = self.device.jacobian(before.place, self.p).T @ tau
        M, C = self.device.dynamics(before.place, before.state.x2, self.p)
        y0, y1 = (self.device.handle(z, self.p) for z in (before.place, place))
        step = self._law.step(before.state, y0, y1, F_motor, M, C, period)
        return ObservedHandle(place, step)

    def outputs(self, now: ObservedHandle) -> dict[str, ca.SX]:
        """By name: the handle's x, its velocity v, F_hand_observed, and M and c = C v there, all in
        the k directions."""
        y = self.device.handle(now.place, self.p)
        v = self._law.velocity(now.state, y)
        M, c = self.device.motion(now.place, v, self.p)
        F_hand = self._law.force(now.state, y, M)
        return {"x": y, "v": v, "F_hand_observed": F_hand, "M": M, "c": c}

    def acceleration(self, now: ObservedHandle, tau: ca.SX) -> ca.SX:
        """a = M^-1 (J_q' tau + F_hand_observed - C v) of (4.5) (m/s2, m/s2, rad/s2), (k,), at the
        end of a period over which the torques tau (N.m) were held."""
        seen = self.outputs(now)
        F_motor = self.device.jacobian(now.place, self.p).T @ tau
        return ca.solve(seen["M"], F_motor + seen["F_hand_observed"] - seen["c"])

    @property
    def _law(self) -> ForceObserver:
        return ForceObserver(self.rule, self.p["omega_n"], self.p["k_D"])
