"""The poses in which a scene is judged: moments of its own run, evenly spaced, and one in contact
with the median force of all that are; where its run comes to rest; and where a wrench leads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.analysis.stability.hands import (
    FIRM,
    TURNING,
    by_direction,
    linearise_hand,
    spring,
    standing,
)
from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.analysis.stability.modes import judged_modes, modes
from hapticlink.analysis.stability.resting_scene import RestingScene, contact_force, resting
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.smooth_scene import StartPose
from hapticlink.analysis.stability.stand_in import find_stand_ins
from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.hand import ConstantHand, Hand, HoldingHand
from hapticlink.components.specs.linkage import Directions, Linkage
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import Fault, FmuFault, InputFault
from hapticlink.orchestrator.base.signal_names import (
    CONTACT_GAP,
    ENVIRONMENT_WRENCH,
    HAND,
    HAND_WRENCH,
    HANDLE_POSE,
    HANDLE_VELOCITY,
    JOINT_COORDINATES,
    JOINT_RATES,
    POINT_POSE,
    signal_of_user,
)
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.read_results import Results, Table, read_into_memory
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.timeline import timeline

SETTLING, CALM = 10.0, 0.2
"""Time (s) in which a wrench takes a damped handle near rest, and its last part, over which the
pose is averaged."""
SETTLED_BY = 5.0
"""Damping of the handle meanwhile (N.s/m)."""
LONGEST, LATE = 60.0, 0.1
"""Time (s) after which a run that has not come to rest does not, and its last part."""
AT_REST, NEARLY = 1e-3, 1.0
"""Rates (rad/s, m/s) of the joints and the handle in that part, up to which a run rests, and up to
which a shorter one may."""
LED = "where its wrench leads"
LEAVING, OFF = 20.0, 2e-4
"""Duration (s) of a run that shows where a divergence leads, and how far off the hand is at first
(m), along x and along z or about it."""
NEAR = 5e-3
"""Motions (m) up to which it leads nowhere, as to an equilibrium beside a singular pose."""
PER_METRE = 10.0
"""Angles (rad) that are as far off as a length of 1 m, or as much moved."""
FEWER, MORE = "fewer constrained", "more constrained"
LIGHT = 0.25
"""The force (N) with which a hand presses where that of the run slides off, as from a corner or a
disc along the spring that the coupling is."""


@dataclass(frozen=True)
class Pose:
    """The pose of a run at a time (s), by joint and of the operational point, and the wrench with
    which a hand presses there against what touches."""

    time: float
    joints: dict[str, float | list[float]]
    point: tuple[float, ...]
    press: tuple[float, ...]
    others: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """The poses of the points that further users hold."""
    touches: bool = False
    """Whether the hand presses against something in that moment."""
    title: str = ""
    """What it is, instead of a moment."""
    space: PortSpace = PLANE
    """Of the operational point."""
    handle: tuple[float, ...] | None = None
    """The pose of the handle, where that is not on the operational point."""
    found: str = ""
    """How, of a pose that is no moment."""
    counted: str = ""
    """Of a pose beside another one, which differs in the number of constrained directions alone:
    FEWER or MORE."""
    counting: dict[str, float] = field(default_factory=dict)
    """Options of [directions] by which these are counted there, without hysteresis."""

    @property
    def start(self) -> StartPose:
        """Where a map begins."""
        return StartPose(self.joints, self.handle)

    def at_equilibrium(self, found: RestingScene, linkage: Linkage) -> Pose:
        """The pose in which a scene was found to rest next to this one."""
        q = found.signal(JOINT_COORDINATES)
        ports = POINT_POSE, HANDLE_POSE, HAND_WRENCH
        x, handle, F = (tuple(found.signal(port).tolist()) for port in ports)
        joints = by_joint(linkage, q) if len(q) else self.joints
        return replace(self, joints=joints, point=x, handle=handle or None, press=F)

    @property
    def lighter(self) -> Pose:
        """Pressed with LIGHT."""
        F = np.array(self.press)
        return replace(self, press=tuple((F * LIGHT / self.space.distance(F)).tolist()))

    @property
    def name(self) -> str:
        name = self.title or f"{self.time:.3g} s" + (" (in contact)" if self.touches else "")
        return f"{name}, {self.counted}" if self.counted else name

    def counted_otherwise(self, place: RestingScene, directions: Directions) -> Iterator[Pose]:
        """This pose, in which a scene was found at rest, with as few and with as many constrained
        directions as there can be by what was before, where these are others than it was found
        with."""
        if self.counted:
            return
        now, fewest, most = place.counts()
        for word, number, factor in ((FEWER, fewest, 1.0), (MORE, most, directions.hysteresis)):
            if (number != now).any():
                tolerance = directions.rank_tolerance * factor
                by = {"directions.rank_tolerance": tolerance, "directions.hysteresis": 1.0}
                yield replace(self, counted=word, counting=by)

    def apart(self, other: Pose) -> float:
        """How far (m) its point, and the handle, are from the point of another pose."""
        places = np.array([x for x in (self.point, self.handle) if x])
        return float(self.space.distance(places - other.point).max())

    def leaves(self, read: Scene, hand: Hand | None) -> bool:
        """Whether the run of a scene from this pose on, in a hand that stands still next to it,
        comes further away than NEAR; one that fails does."""
        if not isinstance(hand, HoldingHand):
            return True
        off = by_direction(self.space, OFF, PER_METRE)
        held = {"hand": standing(hand, np.add(self.point, (off[0], 0.0, off[2])))}
        run = simulate_for(LEAVING, read, {**self.started, **held})
        moved = np.abs(_read_poses(run)[POINT_POSE] - self.point).max(axis=0)
        return bool(fault_of(run) or (moved > by_direction(self.space, NEAR, PER_METRE)).any())

    @property
    def started(self) -> dict[str, object]:
        """The options with which a scene starts at rest in this pose."""
        return {"linkage.start": self.joints, "linkage.start_velocity": {}, **self.counting}

    @property
    def held(self) -> dict[str, object]:
        """The options with which a spring hand that stands still holds a scene in this pose."""
        no_force = (0.0, 0.0, 0.0)
        hands = {
            f"hands.{u}": spring(x, no_force, FIRM, self.space) for u, x in self.others.items()
        }
        at = self.handle or self.point
        return {"hand": spring(at, self.press, FIRM, self.space), **hands, **self.counting}


def simulate_scene(scene: str | Path | Scene, options: Options = ()) -> Results:
    """A run of the scene. Raises InputFault where it has no row."""
    with temporary_folders.temporary_folder() as room:
        experiment = simulate(scene, room, options, csv=False)
        if not experiment.outcome.published:
            raise InputFault(f"the scene's own run fails: {experiment.outcome.fault}")
        return read_into_memory(experiment.results)


def simulate_for(seconds: float, scene: Scene, changes: Mapping[str, object] = {}) -> Results:
    """A run of that length, whatever ends the scene early."""
    return simulate_scene(scene, {**changes, "duration": seconds, "stop_when": ""})


def fault_of(run: Results) -> str:
    """How a run failed of which poses are taken, "" where it reached its end."""
    return run.record.fault.message if run.record.fault else ""


def choose_evenly_spaced(run: Results, linkage: Linkage, count: int) -> list[Pose]:
    """Of a run, `count` evenly spaced ones from its start on, and the one in contact as the last
    one if there was any. Raises InputFault where the poses are not recorded."""
    table = _read_poses(run)
    moments = [int(i * len(table["time"]) / count) for i in range(count)]
    size = linkage.space.distance(_contact_force(table, linkage))
    touching = np.flatnonzero(size)
    if len(touching):
        moments.append(int(touching[np.argsort(size[touching])[len(touching) // 2]]))
    return [_pose(run, linkage, i) for i in moments]


def find_rest_pose(read: Scene, linkage: Linkage) -> Pose:
    """Where the constant wrench of a scene leads a damped handle: the equilibrium under that wrench
    next to the mean over the end of a run, or to its last pose; or, where none is found, one in
    which a firm grip holds it; or that mean. Without topology controller equilibria lie side by
    side: then the one in which the run rests, if it does, with the scene's own damping if there is
    any. Raises InputFault where the run fails."""
    assert isinstance(read.hand, ConstantHand)
    topology = bool(read.controller and read.controller.topology)
    own = any(read.hand.damping or ()) and not topology
    damping = read.hand.damping if own else by_direction(linkage.space, SETTLED_BY, TURNING)
    free = {"hand": {"type": "constant", "wrench": read.hand.wrench, "damping": damping}}
    told = f"its run{'' if own else f' with {SETTLED_BY:g} N.s/m of damping'}"
    run = simulate_for(SETTLING, read, free)
    if run.record.fault:
        raise InputFault(f"{told} fails: {run.record.fault.message}")
    speed = float(np.abs(_fastest(run)).max())
    if speed <= NEARLY and not topology:
        with suppress(InputFault, FmuFault):
            pose = _rested(simulate_for(LONGEST, read, free), linkage)
            with resting(read, free, at=pose.start) as place:
                all_modes = modes(place.period({}).linear, place.map.period)
                if judged_modes(all_modes)[0].growth < 0.0:  # else the run creeps past it
                    pose = pose.at_equilibrium(place, linkage)
                    return replace(pose, title=LED, found=f"{told} rests there")
    still = f"still moves at up to {speed:.2g}" if speed > AT_REST else f"moves below {AT_REST:g}"
    moves = f"{told} {still} rad/s or m/s after {SETTLING:g} s"
    ends = (_average(run, linkage, since) for since in (1.0 - CALM, 1.0))
    near = [replace(pose, press=read.hand.wrench, title=LED) for pose in ends]
    tried: list[tuple[Pose, Options, str]] = [(p, free, "under that wrench") for p in near]
    tried += [(p, p.held, "in which a firm grip holds it") for p in near]
    for pose, hand, how in tried:
        with suppress(InputFault, FmuFault), resting(read, hand, at=pose.start) as place:
            found = f"{moves}, and judged is the equilibrium next to there {how}"
            return replace(pose.at_equilibrium(place, linkage), found=found)
    return near[0]


def rest(read: Scene, linkage: Linkage) -> Pose:
    """Where the run of a scene comes to rest within LONGEST, with what its hand presses there.
    Raises InputFault where it fails, or keeps moving."""
    hyperperiod(timeline(read))  # refuses rates without one
    return replace(_rested(simulate_for(LONGEST, read), linkage), title="where its run rests")


def _rested(run: Results, linkage: Linkage) -> Pose:
    """The pose in which a run of LONGEST rests. Raises InputFault where it does not."""
    if run.record.fault:
        raise InputFault(f"the run does not come to rest: {run.record.fault.message}")
    fastest = _fastest(run)
    if (speed := float(np.abs(fastest).max())) > AT_REST:
        hertz = np.count_nonzero(np.diff(np.sign(fastest))) / 2 / (LATE * LONGEST)
        raise InputFault(
            f"the run does not come to rest in {LONGEST:g} s: it still moves at up to "
            f"{speed:.2g} rad/s or m/s, at {hertz:.2g} Hz; an equilibrium takes damping, or a hand "
            "that holds it"
        )
    hand = table_of(run, HAND_WRENCH)
    press = tuple(hand[HAND_WRENCH][-1].tolist()) if hand else (0.0, 0.0, 0.0)
    return replace(_average(run, linkage, 1.0), press=press)


def _fastest(run: Results) -> Vector:
    """The rates, in the last part of a run, of the joint or the direction of the handle that is
    then the fastest."""
    handle = table_of(run, HANDLE_VELOCITY)
    rates = [_read_poses(run)[JOINT_RATES], *([handle[HANDLE_VELOCITY]] if handle else [])]
    late: list[Vector] = [v for each in rates for v in each[int((1 - LATE) * len(each)) :].T]
    return max(late, key=lambda v: float(np.abs(v).max()))


@contextmanager
def in_own_hand(read: Scene) -> Iterator[tuple[RestingScene, Hand | None]]:
    """A scene at rest in its own hand, next to its start, or else where its run comes to rest; one
    with a constant wrench where that leads. In these it is held by a spring in whose place the hand
    that is given, too, is to be put. Raises InputFault or FmuFault where there is no
    equilibrium."""
    with ExitStack() as stack:
        found, last = None, Fault()
        for pose, hand in _own_equilibria(read):
            at = (pose.held, None, pose.start) if pose else ()
            try:
                found = stack.enter_context(resting(read, *at)), hand
                break
            except (InputFault, FmuFault) as fault:
                last = fault
        if found is None:
            raise last
        yield found


def _own_equilibria(read: Scene) -> Iterator[tuple[Pose | None, Hand | None]]:
    """The pose of `in_own_hand`, None for its start, and the hand, in the order in which they are
    tried."""
    if not presses(read):
        yield None, None
    if read.linkage is None or read.hand is None or is_hand_replaced(read):
        return
    leads = find_rest_pose if presses(read) else rest
    yield leads(read, read.linkage), linearise_hand(read.hand)


def presses(read: Scene) -> bool:
    """Whether the hand of a scene is a constant wrench, but none of 0."""
    return (
        isinstance(read.hand, ConstantHand) and any(read.hand.wrench) and not is_hand_replaced(read)
    )


def is_hand_replaced(read: Scene) -> bool:
    """Whether an FMU of others is in place of the hand."""
    return any(f.replaces == HAND for f in read.fmu)


def visited_poses(run: Results) -> tuple[Matrix, Matrix]:
    """The poses of the operational point, (k, 3), and the joint coordinates, (k, n), of a run.
    Raises InputFault as `choose_evenly_spaced`."""
    table = _read_poses(run)
    return table[POINT_POSE], table[JOINT_COORDINATES]


def _average(run: Results, linkage: Linkage, since: float) -> Pose:
    """The mean pose, of the handle, too, over the part of a run from `since` (0 to 1) of it on.
    Raises InputFault as `choose_evenly_spaced`."""
    table, device = _read_poses(run), table_of(run, HANDLE_POSE)

    def mean(values: Matrix) -> Vector:
        average: Vector = values[min(len(values) - 1, int(since * len(values))) :].mean(axis=0)
        return average

    return replace(
        _pose(run, linkage, len(table["time"]) - 1),
        joints=by_joint(linkage, mean(table[JOINT_COORDINATES])),
        point=tuple(mean(table[POINT_POSE]).tolist()),
        handle=tuple(mean(device[HANDLE_POSE]).tolist()) if device else None,
        touches=False,
    )


def _read_poses(run: Results) -> Table:
    table = table_of(run, POINT_POSE)
    if table is not None and JOINT_COORDINATES in table and len(table["time"]):
        return table
    if fault := fault_of(run):
        raise InputFault(f"the scene's own run fails before its first pose: {fault}")
    raise InputFault(f"{POINT_POSE} and {JOINT_COORDINATES} are not recorded: no poses of a run")


def _contact_force(table: Table, linkage: Linkage) -> Matrix:
    if ENVIRONMENT_WRENCH not in table:
        return np.zeros((len(table["time"]), 3))
    return contact_force(linkage, table[ENVIRONMENT_WRENCH], table.get(CONTACT_GAP))


def _pose(run: Results, linkage: Linkage, i: int) -> Pose:
    table = _read_poses(run)
    users = [user for user in run.record.scene.get("devices", {}) if _point(user) in table]
    force = _contact_force(table, linkage)[i]
    return Pose(
        float(table["time"][i]),
        by_joint(linkage, table[JOINT_COORDINATES][i]),
        tuple(table[POINT_POSE][i].tolist()),
        tuple((0.0 - force).tolist()),
        {user: tuple(table[_point(user)][i].tolist()) for user in users},
        touches=bool(force.any()),
        space=linkage.space,
    )


@contextmanager
def at_pose(
    read: Scene,
    pose: Pose,
    held: bool = True,
    start: Vector | None = None,
    work: SharedWork | None = None,
) -> Iterator[tuple[RestingScene, Pose]]:
    """The scene at rest in a pose, `held` there by a firm spring or as it is, and the pose as it is
    pressed: a hand that slides off what it touches presses lightly. The equilibrium is searched
    from the state `start`; `work` as of `open_lifted_map`. Raises InputFault or FmuFault where
    there is none."""
    with ExitStack() as stack:
        try:
            options = pose.held if held else pose.counting
            place = stack.enter_context(resting(read, options, start, pose.start, work))
            _require_touch(pose, place)
        except (InputFault, FmuFault):
            if not pose.touches:
                raise
            pose = pose.lighter
            place = stack.enter_context(resting(read, pose.held, start, pose.start, work))
        yield place, pose


def _require_touch(pose: Pose, place: RestingScene) -> None:
    if pose.touches and not place.contact.any():
        raise InputFault("it comes off what it touches")


@contextmanager
def at_equilibrium(
    read: Scene,
    candidates: Sequence[Pose],
    tell: Callable[[str], object],
    starts: Mapping[str, Vector] = {},
) -> Iterator[tuple[list[Pose], dict[str, RestingScene]]]:
    """The poses in which the scene has an equilibrium, and the scene there by the pose's name,
    searched from `starts`. A hand that slides off what it touches presses lightly; poses without
    equilibrium are reported and skipped. Raises InputFault where no pose has one."""
    with ExitStack() as stack:
        at_rest: list[Pose] = []
        held_at: dict[str, RestingScene] = {}
        work = SharedWork()
        for pose in candidates:
            found = at_pose(read, pose, start=starts.get(pose.name), work=work)
            try:
                place, pressed = stack.enter_context(found)
                _require_touch(pose, place)
            except (InputFault, FmuFault) as fault:
                tell(f"  pose at {pose.name} is skipped: {fault}")
                continue
            if pressed is not pose:
                tell(f"  pose at {pose.name}: the force slides off; {LIGHT:g} N are taken")
            at_rest.append(pressed)
            held_at[pose.name] = place
        tell(f"  {len(held_at)} poses with an equilibrium")
        for each in find_stand_ins(work.responses):
            tell(f"  {each}")
        if not held_at:
            raise InputFault("no equilibrium is found in any pose of the run, in a firm grip")
        yield at_rest, held_at


def _point(user: str) -> str:
    return signal_of_user(POINT_POSE, user)


def by_joint(linkage: Linkage, q: Vector) -> dict[str, float | list[float]]:
    """Joint coordinates as `linkage.start` has them."""
    joints: dict[str, float | list[float]] = {}
    first = 0
    for joint in linkage.joint:
        size = joint.kind.size
        values = q[first : first + size].tolist()
        joints[joint.name] = values if size > 1 else values[0]
        first += size
    return joints
