"""A linkage in space in the hand through a point port: mechanism, copy, controller and an ideal
device of three directions, stepped one after another as a run does."""

from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.blocks.controller import controller
from hapticlink.components.port_space import POINT
from hapticlink.components.specs.control import Controller, Teleoperation
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Mechanism
from tests.blocks import Running, virtual_environment, virtual_mechanism
from tests.spatial_linkages import bricard

RATE, MASS = 512, 0.3
"""Of the haptic loop (Hz), and of the device (kg), the same in all directions."""


def distance(linkage, frames, duration=0.5):
    """The largest distance (m) of handle and point under 1 N at 1 Hz, with frames at a rate (Hz);
    the way of the handle (m) and the number of constrained directions at the end."""
    coupling = Teleoperation(stiffness=(100.0,) * 3, damping=(70.0,) * 3)
    mechanism = Running(virtual_mechanism(linkage, Mechanism()))
    copy = Running(virtual_environment(linkage, GraphicsCopy(), Directions()))
    law = Running(controller(Controller(bias="full", teleoperation=coupling), POINT, 1.0))
    h, read = 1 / RATE, ("x", "v", "q", "qd", "a_bias")
    point, held = mechanism.outputs(*read), copy.y
    x, v, start = point["x"], np.zeros(3), point["x"]
    following, apart, frame = held, [], 0
    for k in range(round(duration * RATE)):
        if k * frames >= frame * RATE:  # what a frame reads at its begin is known at its end
            held = following
            copy.set(q_ref=point["q"], qd_ref=point["qd"]).step(1 / frames)
            following, frame = copy.y, frame + 1
        F = np.array([0.0, 0.0, np.sin(2 * np.pi * k * h)])
        law.set(x_S=point["x"], v_S=point["v"], x_D=x, v_D=v, F_hand=F, M=MASS * np.eye(3))
        law.set(Lambda_inv=held["Lambda_inv"], P_c=held["P_c"], a_bias=point["a_bias"])
        wrench = law.y
        a = (wrench["F_motor"] + F) / MASS
        x, v = x + h * v + h**2 / 2 * a, v + h * a
        mechanism.set(F_hand=F, F_drift=wrench["F_drift"]).step(h)
        point = mechanism.outputs(*read)
        apart.append(np.linalg.norm(point["x"] - x))
    return max(apart), np.linalg.norm(x - start), held["n_constraints"]


def test_bricard_in_the_hand():
    """Its closures hold the point in two directions; the shorter frames, the nearer the handle."""
    linkage = replace(bricard(), gravity=None)
    coarse, moved, count = distance(linkage, 10)
    fine, *same = distance(linkage, 64)
    assert coarse < 15e-6
    assert coarse > 4 * fine
    assert moved > 0.02
    assert count == 2
    assert same == [pytest.approx(moved, rel=1e-2), count]
