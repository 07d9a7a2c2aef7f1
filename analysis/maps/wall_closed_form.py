"""The closed form behind a map of the stiffness and damping of a virtual wall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.stability.limit_cycles import CountedWall
from hapticlink.components.specs.linkage import Joint
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import ForeignFmu

START = "fmu.{}.start.{}"
EXACT = ("rk4", "dormand-prince-8")
"""Integrators whose steps are, for a map, those of the device itself."""


@dataclass(frozen=True)
class Form:
    """The loop of a wall of stiffness K and damping B, in which the device has m (kg), b (N.s/m)
    and the force comes `periods` of T (s) late. flipped: the first key is the damping."""

    m: float
    b: float
    T: float
    periods: int
    flipped: bool

    def __call__(self, x: Matrix, y: Matrix) -> Matrix:
        """The spectral radius at values of both keys."""
        K, B = (y, x) if self.flipped else (x, y)
        return wall_limits.radius(self.m, self.b, self.T, self.periods, K, B)


@dataclass(frozen=True)
class _WallScene:
    """A scene whose only sampled part is a wall on a device of one prismatic joint."""

    wall: ForeignFmu
    joint: Joint
    m: float
    T: float
    periods: int


def _wall_scene(read: Scene) -> _WallScene | None:
    """The wall of a scene behind a zero-order hold, against a constant hand; None for any other."""
    wall = next((f for f in read.fmu if f.block == "virtual_wall"), None)
    linkage = read.linkage
    if wall is None or linkage is None or len(linkage.joint) != 1 or len(read.fmu) != 1:
        return None
    joint, body = linkage.joint[0], linkage.body[0]
    if joint.kind.units != ("m",) or not joint.damping:
        return None
    sprung = joint.stiffness or joint.drive or linkage.spring
    held = read.hands or (read.hand is not None and read.hand.type != "constant")
    pulsed = wall.settings.get("pulse") or wall.settings.get("velocity") == "measured"
    exactly = read.mechanism.integrator in EXACT and read.coupling == "gauss-seidel"
    if sprung or held or pulsed or not exactly:
        return None
    holds = {read.hold, *read.holds.values()}
    late = [d for name, d in read.delays.items() if name.startswith(wall.name)]
    T = float(1 / exact(read.haptics.rate))
    periods = sum(float(d) for d in late if isinstance(d, int | float | str)) / T
    if holds - {"zoh"} or len(late) != len(read.delays) or abs(periods - round(periods)) > 1e-6:
        return None
    return _WallScene(wall, joint, body.mass, T, round(periods))


def form(scene: Scene, panel: Mapping[str, str], x: str, y: str) -> Form | None:
    """The closed form of such a scene over stiffness and damping of its wall; None for any
    other."""
    found = _wall_scene(open_scene.load(scene, [f"{k}={v}" for k, v in panel.items()]))
    if found is None:
        return None
    keys = [START.format(found.wall.name, name) for name in ("stiffness", "damping")]
    if sorted((x, y)) != sorted(keys):
        return None
    return Form(found.m, found.joint.damping or 0.0, found.T, found.periods, x == keys[1])


class NamedWall(NamedTuple):
    """A wall by the name of its FMU."""

    name: str
    counted: CountedWall


def counted_wall(read: Scene) -> NamedWall | None:
    """The wall of such a scene whose position is measured in counts; None for any other."""
    found = _wall_scene(read)
    if found is None:
        return None
    own = {**found.wall.settings, **found.wall.start}
    K, B, quantum = (float(own.get(name) or 0.0) for name in ("stiffness", "damping", "quantum"))
    if not quantum:
        return None
    b, friction = found.joint.damping or 0.0, found.joint.friction or 0.0
    counted = CountedWall(found.m, b, found.T, K, quantum, friction, B, found.periods)
    return NamedWall(found.wall.name, counted)


def passive_margin(found: Form, x: Matrix, y: Matrix) -> Matrix:
    """The device's damping less that which the wall needs to be passive for any hand."""
    K, B = (y, x) if found.flipped else (x, y)
    return found.b - wall_limits.passive_damping(found.T, found.periods, K, B)
