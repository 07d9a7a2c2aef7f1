"""The poses in which gains are judged: moments of the scene's own run, evenly spaced, and one in
contact with the median force of all that are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.analysis.tune.held_equilibria import Held, held
from hapticlink.analysis.tune.spring_hand import FIRM, spring
from hapticlink.components.linkage.parameters import COORDINATES
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.loop_names import (
    ENVIRONMENT_WRENCH,
    JOINT_COORDINATES,
    POINT_POSE,
)
from hapticlink.orchestrator.results.tables import Results
from hapticlink.orchestrator.scene import overrides

LIGHT = 0.25
"""The force (N) with which a hand presses where that of the run slides off, as from a corner or a
disc along the spring that the coupling is."""


@dataclass(frozen=True)
class Pose:
    """The pose of a run at a time (s), by joint and of the operational point (m, m, rad), and the
    wrench (N, N, N.m) with which a hand presses there against what touches."""

    time: float
    joints: dict[str, float | list[float]]
    point: tuple[float, ...]
    press: tuple[float, ...]

    @property
    def lighter(self) -> Pose:
        """Pressed with LIGHT."""
        F = np.array(self.press)
        return replace(self, press=tuple((F * LIGHT / np.hypot(*F[:2])).tolist()))

    @property
    def name(self) -> str:
        return f"{self.time:.3g} s" + (" (in contact)" if any(self.press) else "")

    def options(self, given: Sequence[str]) -> tuple[str, ...]:
        """The options of the scene at rest in this pose, in a spring hand."""
        start = {
            "hand": spring(self.point, self.press, FIRM),
            "linkage.start": self.joints,
            "linkage.start_velocity": {},
        }
        return (*given, *overrides.written(start))


def poses(run: Results, linkage: Linkage, count: int) -> list[Pose]:
    """Of a run, `count` evenly spaced ones from its start on, and the one in contact as the last
    one if there was any. Raises InputFault where the poses are not recorded."""
    table = table_of(run, POINT_POSE)
    if table is None or JOINT_COORDINATES not in table or not len(table["time"]):
        raise InputFault(
            f"{POINT_POSE} and {JOINT_COORDINATES} are not recorded: no poses of a run"
        )
    times, points, joints = table["time"], table[POINT_POSE], table[JOINT_COORDINATES]
    force = table[ENVIRONMENT_WRENCH] if ENVIRONMENT_WRENCH in table else np.zeros((len(times), 3))
    moments = [int(i * len(times) / count) for i in range(count)]
    size = np.hypot(force[:, 0], force[:, 1])
    touching = np.flatnonzero(size)
    if len(touching):
        moments.append(int(touching[np.argsort(size[touching])[len(touching) // 2]]))
    return [
        Pose(
            float(times[i]),
            _by_joint(linkage, joints[i]),
            tuple(points[i].tolist()),
            tuple((0.0 - force[i]).tolist()),
        )
        for i in moments
    ]


@contextmanager
def at_equilibrium(
    scene: str | Path,
    given: Sequence[str],
    candidates: Sequence[Pose],
    tell: Callable[[str], object],
    starts: Mapping[str, Vector] = {},
) -> Iterator[tuple[list[Pose], dict[str, Held]]]:
    """The poses in which the scene has an equilibrium, and the scene there by the pose's name,
    searched from `starts`. A hand that slides off what it touches presses lightly; poses without
    equilibrium are reported and skipped. Raises InputFault where no pose has one."""
    with ExitStack() as stack:
        resting: list[Pose] = []
        held_at: dict[str, Held] = {}
        for pose in candidates:
            for pressed in (pose, pose.lighter) if any(pose.press) else (pose,):
                try:
                    start = starts.get(pose.name)
                    place = stack.enter_context(held(scene, pressed.options(given), start))
                    if any(pose.press) and not place.touches:
                        raise InputFault("it comes off what it touches")
                except (InputFault, FmuFault) as fault:
                    why = fault
                else:
                    if pressed is not pose:
                        tell(f"  pose at {pose.name}: the force slides off; {LIGHT:g} N are taken")
                    resting.append(pressed)
                    held_at[pose.name] = place
                    break
            else:
                tell(f"  pose at {pose.name} is skipped: {why}")
        tell(f"  {len(held_at)} poses with an equilibrium")
        if not held_at:
            raise InputFault("the scene has no equilibrium in any pose of its run, in a firm grip")
        yield resting, held_at


def _by_joint(linkage: Linkage, q: Vector) -> dict[str, float | list[float]]:
    found: dict[str, float | list[float]] = {}
    at = 0
    for joint in linkage.joint:
        size = COORDINATES[joint.type]
        values = [float(v) for v in q[at : at + size]]
        found[joint.name] = values if size > 1 else values[0]
        at += size
    return found
