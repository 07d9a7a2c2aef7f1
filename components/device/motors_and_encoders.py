"""Motors and encoders of the device: quantised readings, and in numbers the torques of the motors
and what one count of an encoder looks like to a controller."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.models import device_model
from hapticlink.components.evaluate_rows import evaluate_rows
from hapticlink.components.specs.device import Device

Field = NDArray[np.float64]


def quantised(value: ca.SX, quantum: ca.SX, share: float = 0.0) -> ca.SX:
    """quantum floor(value/quantum + share): rounded down by default, to the nearest count by a
    share of 0.5; the value itself where the quantum is 0."""
    return _quantised(value, quantum, share)[0]


def count(angles: ca.SX, resolution: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Angles (rad) by encoders, counts to the nearest one times resolution, and these counts; where
    the resolution is 0, the angles themselves, and counts of one radian."""
    return _quantised(angles, resolution, 0.5)


def _quantised(value: ca.SX, quantum: ca.SX, share: float) -> tuple[ca.SX, ca.SX]:
    coarse = quantum > 0.0
    counts = value / ca.if_else(coarse, quantum, 1.0)
    counts = ca.floor(counts + share if share else counts)
    return ca.if_else(coarse, quantum * counts, value), counts


@cache
def torque_function(device: Device) -> ca.Function:
    """Torques (N.m), (m,), of a wrench at a pose of the handle, as the device's motors give them:
    of least norm, and limited."""
    model, size = device_model(device), device.space.size
    wrench, pose = ca.SX.sym("wrench", size), ca.SX.sym("pose", size)
    z = model.place_at_pose(pose)
    tau = model.motor_torques(model.directions.pick(wrench), z, model.numbers)
    return ca.Function("torques", [wrench, pose], [tau], {"cse": True})


def motor_torques(device: Device, wrenches: Field, poses: Field) -> Field:
    """`torque_function` of wrenches and poses, a row each: (k, m)."""
    return evaluate_rows(torque_function(device), wrenches, poses)


def torque_shares(device: Device, torques: Field) -> Field:
    """Torques (k, m) by the limits of their motors: the largest share of each row, (k,)."""
    limits = np.array([motor.torque_limit for motor in device.motors])
    shares: Field = (np.abs(torques) / limits).max(axis=1)
    return shares


def mass_and_count(model: DeviceModel) -> tuple[float, float]:
    """Mass (kg) at the handle and way (m) of it by a count, means over the lengths that are felt,
    where the device is assembled."""
    z, p = ca.SX.sym("z", len(model.start_place)), model.numbers
    lengths = model.directions.lengths
    J = model.angle_rates(z, p)
    counts = ca.diag(ca.DM([1 / sensed.resolution for sensed in model.encoders])) @ J
    M, _ = model.motion(z, ca.SX(model.directions.size, 1), p)
    mass = ca.det(M[:lengths, :lengths]) ** (1 / lengths)
    spread = ca.trace(ca.inv(counts.T @ counts)[:lengths, :lengths]) / lengths
    found = ca.Function("mass_and_count", [z], [mass, ca.sqrt(spread)])(model.start_place)
    return float(found[0]), float(found[1])


def count_energies(device: Device, pose: Field, period_s: float) -> Field:
    """The kinetic energies (J), (e,), v' M v/2 with v = (J' J)^-1 J' e_i delta/T, of a handle at
    the pose whose measured pose moves by one count delta of encoder i in a period T."""
    model, x = device_model(device), ca.SX.sym("x", device.space.size)
    z, p = model.place_at_pose(x), model.numbers
    J = model.angle_rates(z, p)
    resolutions = ca.DM([sensed.resolution for sensed in model.encoders])
    v = ca.solve(J.T @ J, J.T) @ ca.diag(resolutions) / period_s
    M, _ = model.motion(z, ca.SX(model.directions.size, 1), p)
    energies = ca.sum1(v * (M @ v)) / 2
    return np.asarray(ca.Function("energies", [x], [energies])(pose)).ravel()
