"""The poses in which gains are judged: moments of the scene's own run, evenly spaced, and one in
contact with the median force of all that are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.analysis.stability.hands import FIRM, spring
from hapticlink.analysis.stability.held_equilibria import Held, held
from hapticlink.components.linkage.parameters import COORDINATES
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.loop_names import (
    ENVIRONMENT_WRENCH,
    JOINT_COORDINATES,
    POINT_POSE,
    signal_of_user,
)
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.tables import Results, Table
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene

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
    others: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """The poses of the points that further users hold."""
    title: str = ""
    """What it is, instead of a moment."""

    @property
    def touches(self) -> bool:
        """Whether the hand presses against something."""
        return any(self.press) and not self.title

    @property
    def lighter(self) -> Pose:
        """Pressed with LIGHT."""
        F = np.array(self.press)
        return replace(self, press=tuple((F * LIGHT / np.hypot(*F[:2])).tolist()))

    @property
    def name(self) -> str:
        return self.title or f"{self.time:.3g} s" + (" (in contact)" if self.touches else "")

    def options(self, given: Sequence[str]) -> tuple[str, ...]:
        """The options of the scene at rest in this pose, in a spring hand."""
        start = {
            "hand": spring(self.point, self.press, FIRM),
            "linkage.start": self.joints,
            "linkage.start_velocity": {},
        }
        no_force = (0.0, 0.0, 0.0)
        start |= {f"hands.{u}": spring(x, no_force, FIRM) for u, x in self.others.items()}
        return (*given, *overrides.written(start))


def simulated(
    scene: str | Path | Scene,
    given: Sequence[str],
    changes: Mapping[str, float | list[float]] = {},
) -> Results:
    """A run of the scene with changes as options. Raises InputFault where it has no row."""
    with temporary_folders.room() as room:
        made = simulate(scene, room, (*given, *overrides.written(changes)), csv=False)
        if not made.outcome.published:
            raise InputFault(f"the scene's own run fails: {made.outcome.fault}")
        return made.results


def evenly_spaced(run: Results, linkage: Linkage, count: int) -> list[Pose]:
    """Of a run, `count` evenly spaced ones from its start on, and the one in contact as the last
    one if there was any. Raises InputFault where the poses are not recorded."""
    table = _recorded(run)
    moments = [int(i * len(table["time"]) / count) for i in range(count)]
    size = np.hypot(*_force(table)[:, :2].T)
    touching = np.flatnonzero(size)
    if len(touching):
        moments.append(int(touching[np.argsort(size[touching])[len(touching) // 2]]))
    return [_pose(run, linkage, i) for i in moments]


def average(run: Results, linkage: Linkage, since: float) -> Pose:
    """The mean pose over the part of a run from `since` (0 to 1) of it on. Raises InputFault as
    `evenly_spaced`."""
    table = _recorded(run)
    n = len(table["time"])
    part = slice(min(n - 1, int(since * n)), n)
    end = _pose(run, linkage, n - 1)
    return replace(
        end,
        joints=_by_joint(linkage, table[JOINT_COORDINATES][part].mean(axis=0)),
        point=tuple(table[POINT_POSE][part].mean(axis=0).tolist()),
    )


def _recorded(run: Results) -> Table:
    table = table_of(run, POINT_POSE)
    if table is None or JOINT_COORDINATES not in table or not len(table["time"]):
        raise InputFault(
            f"{POINT_POSE} and {JOINT_COORDINATES} are not recorded: no poses of a run"
        )
    return table


def _force(table: Table) -> Matrix:
    found: Matrix = table[ENVIRONMENT_WRENCH] if ENVIRONMENT_WRENCH in table else np.zeros((1, 3))
    return np.broadcast_to(found, (len(table["time"]), 3))


def _pose(run: Results, linkage: Linkage, i: int) -> Pose:
    table = _recorded(run)
    users = [user for user in run.record.scene.get("devices", {}) if _point(user) in table]
    return Pose(
        float(table["time"][i]),
        _by_joint(linkage, table[JOINT_COORDINATES][i]),
        tuple(table[POINT_POSE][i].tolist()),
        tuple((0.0 - _force(table)[i]).tolist()),
        {user: tuple(table[_point(user)][i].tolist()) for user in users},
    )


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
            for pressed in (pose, pose.lighter) if pose.touches else (pose,):
                try:
                    start = starts.get(pose.name)
                    place = stack.enter_context(held(scene, pressed.options(given), start))
                    if pose.touches and not place.touches:
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


def _point(user: str) -> str:
    return signal_of_user(POINT_POSE, user)


def _by_joint(linkage: Linkage, q: Vector) -> dict[str, float | list[float]]:
    found: dict[str, float | list[float]] = {}
    at = 0
    for joint in linkage.joint:
        size = COORDINATES[joint.type]
        values = [float(v) for v in q[at : at + size]]
        found[joint.name] = values if size > 1 else values[0]
        at += size
    return found
