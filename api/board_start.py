"""Starts a linkage where somebody holds the handle of a board."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import numpy as np

from hapticlink.analysis.stability.poses import by_joint
from hapticlink.components.device.models import device_model
from hapticlink.components.linkage.inverse_kinematics import InverseKinematics
from hapticlink.components.specs.linkage import coordinates
from hapticlink.fmus.fmu_functions import GRAPHS
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.boards.driver import DRIVERS, SIMULATED_BOARD, Silent, Wiring
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.scene.scene import Scene

ITERATIONS = 60
"""Steps of Gauss-Newton from the device's start to a place anywhere in its workspace."""
NEAR, CLOSED = 2e-3, 1e-6
"""Largest distance (m) of the linkage from the handle, and gap (m) of its loops."""


def start_at_handle(scene: Scene, ready: Callable[[str], object]) -> Scene:
    """The scene, started where the handle is: the board of its first user is opened in the pose of
    `home`, then the handle is moved to where the linkage is to start. `ready` is told what to do
    before each, and returns when it is done. A scene whose board has no `home` is returned as it
    is: its board is started where the linkage starts.

    Raises InputFault where the linkage does not reach the handle, Fault where the board does not
    answer.
    """
    driver, device = driver_of(scene, ""), scene.device
    if not (driver and device and scene.linkage and driver.home):
        return scene
    if driver.port == SIMULATED_BOARD:
        raise InputFault(f"device.driver.home: a {SIMULATED_BOARD} is where the scene starts")
    resolution = [e.resolution for e in device.encoders]
    wiring = Wiring.of(driver, len(device.motors), resolution, driver.home)
    board = DRIVERS[driver.type](driver.port, wiring)
    ready("hold the handle in its home pose")
    try:
        board.open()
        ready("move the handle to where the linkage is to start, and keep it there")
        board.send([0.0] * len(device.motors))
        counts = board.receive(driver.silence)
    except (Silent, OSError) as error:
        raise Fault(f"the board at {driver.port}: {error}") from None
    finally:
        board.close()
    angles = [math.tau / n * c for n, c in zip(wiring.counts, counts, strict=True)]
    with GRAPHS:
        model = device_model(device)
        at = model.place_from_angles(
            ca.SX(ca.DM(angles)), ca.SX(ca.DM(model.start_place)), model.numbers, ITERATIONS
        )
        place = np.array(ca.DM(ca.evalf(model.handle(at, model.numbers)))).ravel()[:2]
        kinematics = InverseKinematics(scene.linkage)
        reached = kinematics.reached(
            np.array(coordinates(scene.linkage, scene.linkage.start)), place
        )
    off = float(np.hypot(*(reached.point[:2] - place)))
    if not off < NEAR or reached.gap > CLOSED:
        where = ", ".join(f"{x:.4g}" for x in place)
        raise InputFault(
            f"the linkage does not reach the handle at ({where}) m: it comes within "
            f"{1e3 * off:.3g} mm; move the handle there"
        )
    start = by_joint(scene.linkage, reached.q)
    return open_scene.load(scene, {"linkage.start": start, "device.driver.home": angles})
