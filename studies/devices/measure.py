"""What a device can render, and whether runs agree with the verdicts on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import hapticlink as hl
from hapticlink.analysis.search.search import largest_scale
from hapticlink.analysis.search.settings import Gains
from hapticlink.analysis.stability.hand_cases import Case, InHands, worst_case
from hapticlink.analysis.stability.hands import HANDS, standing
from hapticlink.analysis.stability.modes import DRIFT
from hapticlink.analysis.stability.poses import Pose, choose_evenly_spaced, simulate_scene
from hapticlink.analysis.stability.resting_scene import resting
from hapticlink.analysis.stability.short_hyperperiod import whole_frames
from hapticlink.components.device.models import device_model
from hapticlink.components.device.motors_and_encoders import mass_and_count
from hapticlink.components.device.observer_laws import default_bandwidth
from hapticlink.components.device.workspace import workspace
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand, Hand, SpringHand
from hapticlink.orchestrator.base.signal_names import HANDLE_VELOCITY
from hapticlink.orchestrator.scene.find_scene import list_shipped
from hapticlink.orchestrator.scene.read_and_check import read_scene

SCENE = "closed-loop-ideal"
SECONDS, EARLY, LATE = 60.0, (0.25, 2.0), 5.0
OFF = (1e-6, 0.0, 0.0)
QUIET, MOST = 1e-7, 0.5
BESIDE = (0.8, 1.25)
"""Factors on the margin, with which the verdicts are checked."""
FINE = 0.05
"""Of the margin's logarithm."""
ALONE = 12.0
"""Duration (s) of the runs without topology controller."""
COUPLING = 100.0
"""K_pc (N/m) of the scene."""
Options = dict[str, Any]


def planar_devices() -> list[str]:
    """The shipped devices that render a planar linkage, as that of the scene."""
    alone = 'title = "a device"\nduration = 1.0\ndevice.extends = "{}"'
    return [
        name for name in list_shipped("device") if read_scene(alone.format(name)).space == PLANE
    ]


def options(name: str) -> Options:
    """Those of the scene with a device."""
    pull = {"hand.wrench": [-0.5, 0.0, 0.0], "controller.bias": "full"}
    return {"device.extends": name, **pull}


@dataclass(frozen=True)
class Check:
    """A verdict with gains of `factor` times the margin, in words, and what a run says."""

    factor: float
    says: str
    hand: str
    growth: float
    run: str

    @property
    def agrees(self) -> bool:
        """A verdict that is marginal or drifts is not decided by a run."""
        return self.says not in ("stable", "unstable") or self.says == self.run


@dataclass(frozen=True)
class Judged:
    """The verdict at the start pose in the worst of the hands of `stability`, the largest factor on
    all gains, dampings by its root, up to which no hand is unstable there, and what checks it."""

    says: str
    hand: str
    growth: float
    margin: float
    checks: tuple[Check, ...]


def judged(name: str) -> Judged:
    """That of a device, with frames of whole haptic periods."""
    read, _ = whole_frames(hl.scene(SCENE, options(name)))
    assert read.linkage is not None
    pose = choose_evenly_spaced(simulate_scene(read), read.linkage, 1)[0]
    with resting(read, pose.held, at=pose.start) as place:
        gains = Gains(place.map.system)

        def worst(factor: float) -> Case:
            scales = dict.fromkeys(gains.laws, factor)
            return worst_case(InHands(place, scales).cases(pose.name, dict(HANDS), DRIFT))

        first = worst(1.0)
        margin = largest_scale(lambda factor: worst(factor).verdict != "unstable", FINE).value
        checks = []
        for factor in BESIDE:
            case = worst(factor * margin)
            given = options(name) | gains.options(dict.fromkeys(gains.laws, factor * margin))
            ran = run_case(given, pose, HANDS[case.hand])
            checks.append(Check(factor, case.verdict, case.hand, float(case.growth), ran))
    return Judged(first.verdict, first.hand, float(first.growth), float(margin), tuple(checks))


def run_case(given: Options, there: Pose, holding: Hand) -> str:
    """stable or unstable, by a run in a pose and a hand."""
    assert isinstance(holding, ArmHand | SpringHand)
    changes = {
        "hand": standing(holding, np.add(there.point, OFF)),
        "linkage.start": there.joints,
        "linkage.start_velocity": {},
        "duration": SECONDS,
        "stop_when": "",
    }
    kept = {key: value for key, value in given.items() if not key.startswith("hand")}
    run = hl.run(SCENE, kept | changes, figures=False)
    if run.fault:
        return "unstable"
    speed, time = np.abs(run[HANDLE_VELOCITY]).max(axis=1), run.time(HANDLE_VELOCITY)
    early = speed[(time >= EARLY[0]) & (time <= EARLY[1])].max()
    late = speed[time >= SECONDS - LATE].max()
    return "stable" if late < max(MOST * early, QUIET) else "unstable"


@dataclass(frozen=True)
class Rendered:
    """Numbers of a device: the range of its mass (kg) over its workspace and all directions, the
    least force (N) that its motors can give at the start in any direction, the way (m) of the
    handle by a count, the bandwidth of its observer (rad/s) and the error of the force (N) by a
    count."""

    mass: tuple[float, float]
    force: float
    count: float
    omega_n: float
    noise: float


def rendered(device: Device) -> Rendered:
    """Those of a device."""
    model, space = device_model(device), workspace(device)
    z = ca.SX.sym("z", len(model.start_place))
    lengths = min(model.directions.size, 2)
    still = ca.SX(model.directions.size, 1)
    M, _ = model.motion(z, still, model.numbers)
    pose = ca.SX.sym("pose", 3)
    placed = ca.Function("placed", [pose], [model.place_at_pose(pose)])
    function = ca.Function("M", [z], [ca.inv(ca.inv(M)[:lengths, :lengths])])
    masses = []
    for i, x in enumerate(space.x[::8]):
        for k, y in enumerate(space.y[::8]):
            for n, theta in enumerate(space.theta[::8]):
                if space.margin[8 * i, 8 * k, 8 * n] >= 0.0:
                    masses += [*np.linalg.eigvalsh(np.array(function(placed([x, y, theta]))))]
    J = ca.Function("J", [z], [model.jacobian(z, model.numbers)])(model.start_place)
    limits = np.array([motor.torque_limit for motor in device.motors])
    back = np.linalg.pinv(np.array(J).T)
    turned = np.linspace(0.0, np.pi, 60)
    ways = np.stack([np.cos(turned), np.sin(turned), 0.0 * turned])
    along = np.array(model.directions.rows) @ ways
    asked = np.abs(back @ along[:, np.linalg.norm(along, axis=0) > 1e-9]) / limits[:, None]
    mass, count = mass_and_count(model)
    omega_n = default_bandwidth(model)
    return Rendered(
        (float(min(masses)), float(max(masses))),
        float(1.0 / asked.max()),
        count,
        omega_n,
        mass * count * omega_n**2,
    )
