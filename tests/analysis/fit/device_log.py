"""Logs as a lab records them, made with this project's own device and hand: motors that shake the
handle, encoders that count, a force sensor with noise."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from hapticlink.analysis.fit.log import Log
from hapticlink.components.blocks.hand import hand
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.component import Component
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import Hand
from tests.blocks import on_own_memory

PERIOD = 1 / 512
FINER = 8
"""Steps of the simulated world in a period: hand and device push each other all the time."""
AMPLITUDES = np.array([3.0, 3.0, 0.05])
"""Of the motors' wrench (N, N, N.m)."""


def shaken(samples: int, seed: int, low: float = 0.7, high: float = 25.0) -> np.ndarray:
    """Wrenches of the motors, (n, 3): twelve sines each, of random phases."""
    random, t = np.random.default_rng(seed), np.arange(samples) * PERIOD
    hertz = np.geomspace(low, high, 12)
    phases = random.uniform(0, 2 * np.pi, (3, 12, 1))
    return (np.sin(2 * np.pi * hertz[:, None] * t + phases).sum(1) * AMPLITUDES[:, None] / 3).T


def recorded(device: Device, user: Hand, seconds: float, seed: int, noise: float = 0.05) -> Log:
    """The log of `seconds` in which the motors shake the handle in the user's hand. noise: of the
    force sensor, as a standard deviation (N; N.m by a hundredth of it)."""
    samples = int(seconds / PERIOD)
    motors = shaken(samples, seed)
    plant, user_block = haptic_device(device, encoders=True), hand(user)
    device_moves, arm_moves = _stepped(plant), _stepped(user_block)
    settings = np.array(user_block.start_parameters)
    x, arm = _start(plant), None
    pose, wrench = np.zeros((samples, 3)), np.zeros((samples, 3))
    size, force = sum(v.size for v in user_block.inputs), on_own_memory(user_block.output)
    for k in range(samples * FINER):
        t = k * PERIOD / FINER
        handle = x[:size]  # its true pose and velocity are the first states
        if arm is None:
            arm = np.asarray(user_block.initialize(handle, settings)).ravel()
        F = force(arm, handle, settings, t)
        sample, within = divmod(k, FINER)
        if not within:
            pose[sample], wrench[sample] = x[6:9], F  # as the encoders count
        arm = arm_moves(arm, handle, t)
        x = device_moves(x, np.r_[motors[sample], F], t)
    sensor = np.random.default_rng(seed + 1).normal(0.0, noise, (samples, 3)) * [1, 1, 0.01]
    return Log(PERIOD, pose, motors, wrench + sensor)


def _stepped(block: Component) -> Callable[..., np.ndarray]:
    x, u, t = (
        ca.MX.sym("x", block.step.size1_in(0)),
        ca.MX.sym("u", block.step.size1_in(1)),
        ca.MX.sym("t"),
    )
    after = block.step(x, u, ca.DM([*block.start_parameters]), t, PERIOD / FINER)
    return on_own_memory(ca.Function("moved", [x, u, t], [after]))


def _start(block: Component) -> np.ndarray:
    return np.asarray(block.initialize([*block.start_inputs], [*block.start_parameters])).ravel()
