"""How far the worst case is from the limit, and what takes an unstable one to the safe side.

Both are judged in one pose and all hands, with frames of whole haptic periods next to the scene's,
whose map is short; what is advised is judged in all poses at the scene's own rates before.
A mode that only drifts counts as stable.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hapticlink.analysis.stability.gains import LAWS, Gains
from hapticlink.analysis.stability.hands import FREE, OWN_FREE
from hapticlink.analysis.stability.held_equilibria import Held
from hapticlink.analysis.stability.largest_scale import largest
from hapticlink.analysis.stability.mode_kinds import Bounds
from hapticlink.analysis.stability.poses import Pose
from hapticlink.analysis.stability.rates import whole_frames
from hapticlink.analysis.stability.workspace_cases import AtRest, Case, at_pose, in_poses
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.base.loop_names import CONTROLLER
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene

FINE = 0.1
"""Of the logarithm of the factor on all stiffnesses."""
FINEST = 2
"""Of a count, the part to which it is found."""
LATEST, SLOWEST = 8, 32
"""Haptic periods up to which a further delay, and a frame, are tried."""
HOLDS = ("zoh", "foh", "lead", "mean")
"""That are tried as a remedy."""
SAFE = 1.25
"""By how much gains that are advised stay below their limit."""
DAMPINGS = (0.5, 2.0)
"""Factors on the damping of the coupling that are tried."""
FASTER = (2, 4)
"""Factors on rates that are tried."""
TRIED = 2
"""Remedies that are judged in all poses."""


@dataclass(frozen=True)
class Margin:
    """How far the worst pose is from the limit in all hands; None where it has no such quantity."""

    stiffness: float | None
    """The factor on all stiffnesses, dampings by its root, up to which it is stable; 0 where it is
    unstable with any."""
    delay: float | None
    """The further delay (s) of all that the controller reads."""
    rate: float | None
    """The lowest rate (Hz) down to which it is stable; infinite where it is with none."""
    clock: str
    """Of that rate: graphics or haptics."""

    def record(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Remedy:
    """Options with which all hands are stable in all poses, the growth rate (1/s) of the worst case
    with them, and in how many of how many cases it is so."""

    options: tuple[str, ...]
    growth: float
    stable: bool

    def record(self) -> dict[str, Any]:
        return asdict(self)


def improvements(
    scene: str | Path | Scene,
    given: Sequence[str],
    poses: Sequence[Pose],
    pose: Pose,
    hands: Mapping[str, Hand],
    bounds: Bounds,
    worst: Case,
    with_rest: Container[str],
) -> tuple[Margin, Remedy | None]:
    """The margin in the worst pose, and what ends its instability in all poses `with_rest`, by
    name; None where it is stable."""
    first = sorted(hands, key=lambda name: name != worst.hand)
    held = {name: hands[name] for name in first if name not in (FREE, OWN_FREE)}
    search = _Search(scene, tuple(given), pose, held, bounds)
    with at_pose(scene, search.quick, pose) as place:
        margin = search.margin(place)
        candidates = [*search.candidates(place.gains, margin)]
    judged = [p for p in poses if p.name in with_rest]
    if worst.free or worst.verdict != "unstable" or worst.drifts:
        return margin, None
    return margin, search.remedy(candidates, judged)


class _Search:
    def __init__(
        self,
        scene: str | Path | Scene,
        given: tuple[str, ...],
        pose: Pose,
        hands: Mapping[str, Hand],
        bounds: Bounds,
    ) -> None:
        self._scene, self._given, self._pose = scene, given, pose
        self._hands, self._bounds = hands, bounds
        self._read = open_scene.load(scene, given)
        self.quick = whole_frames(self._read, given)
        self._haptic = exact(self._read.haptics.rate)

    def margin(self, place: Held) -> Margin:
        stiffness = None
        if place.gains.laws:
            try:
                stiffness = largest(lambda s: self._stable(place, s), FINE)
            except InputFault:
                stiffness = 0.0
        delay = None
        if CONTROLLER in place.map.system.fmu:
            ticks = _last(lambda n: self._stable(place, 1.0, n), LATEST)
            delay = float(ticks / self._haptic) if self._stable(place, 1.0) else 0.0
        clock = "haptics" if self._read.graphics is None else "graphics"
        return Margin(stiffness, delay, self._rate(clock), clock)

    def _rate(self, clock: str) -> float | None:
        """The lowest rate of whole haptic periods a frame that is stable, with all above it that
        were tried."""
        if clock == "haptics":
            return None
        frames = _last(lambda n: self._growth((*self._given, self._framed(n))) < 0.0, SLOWEST)
        return float(self._haptic / frames) if frames else float("inf")

    def _framed(self, n: int) -> str:
        return f'graphics.rate="{self._haptic / n}"'

    def _stable(self, place: Held, scale: float, late: int = 0) -> bool:
        """Whether all hands are stable with gains scaled, and all that the controller reads some
        haptic periods later."""
        try:
            at = AtRest(place, dict.fromkeys(place.gains.laws, scale), late)
            return at.worst(self._hands, self._bounds) < 0.0
        except (InputFault, FmuFault):
            return False

    def _growth(self, given: Sequence[str]) -> float:
        """The growth rate of a hand in the pose that is unstable, or of the worst one where none
        is; infinite where there is no equilibrium."""
        try:
            with at_pose(self._scene, given, self._pose) as place:
                return AtRest(place).worst(self._hands, self._bounds)
        except (InputFault, FmuFault):
            return float("inf")

    def candidates(self, gains: Gains, margin: Margin) -> Iterator[tuple[str, ...]]:
        """Single changes of the scene, and the last resort, gains and rate together."""
        read = self._read
        for hold in HOLDS:
            if read.graphics is not None and hold != read.hold and not read.holds:
                yield (f"hold={hold}",)
        gain: tuple[str, ...] = ()
        if margin.stiffness:
            scale = min(1.0, margin.stiffness) / SAFE
            gain = tuple(overrides.written(gains.options(dict.fromkeys(gains.laws, scale))))
            yield gain
        table, _, _ = LAWS["drift"]
        for factor in DAMPINGS:
            for key, value in gains.options({"drift": factor**2}).items():
                if key == f"{table}.damping":
                    yield tuple(overrides.written({key: value}))
        if read.graphics is not None:
            assert isinstance(read.graphics.rate, int | float | str)  # see `whole_frames`
            rate = float(exact(read.graphics.rate))
            if margin.rate is not None and margin.rate > rate:
                rate = min(margin.rate, float(self._haptic))
            for factor in (1, *FASTER):
                if rate < factor * rate <= float(self._haptic) or factor == 1:
                    yield (f"graphics.rate={factor * rate:g}", *(gain if factor == 1 else ()))
            if read.mechanism_at == "graphics":
                yield ("mechanism_at=haptics",)
        for factor in FASTER:
            yield (f"haptics.rate={factor * float(self._haptic):g}",)
            if gain:
                yield (f"haptics.rate={factor * float(self._haptic):g}", *gain)

    def remedy(self, candidates: Sequence[tuple[str, ...]], poses: Sequence[Pose]) -> Remedy | None:
        """The candidate that is judged best in the worst pose and holds in all poses."""
        ranked: list[tuple[float, int, tuple[str, ...]]] = []
        for change in candidates:
            options = (*self._given, *change)
            with_change = whole_frames(open_scene.load(self._scene, options), options)
            ranked.append((self._growth(with_change), len(ranked), change))
        places, best = {pose.name for pose in poses}, None
        for growth, _, change in sorted(ranked)[:TRIED]:
            if growth >= 0.0 and best:
                break
            found, _ = in_poses(
                self._scene, (*self._given, *change), poses, self._hands, self._bounds
            )
            complete = places <= {case.pose for case in found}
            least = _worst(found) if complete else float("inf")
            if best is None or least < best.growth:
                best = Remedy(change, least, least < 0.0)
            if best.stable:
                break
        return best


def _worst(found: Sequence[Case]) -> float:
    """The largest growth rate of the cases that do not only drift, and are not marginal."""
    rates = [case.growth for case in found if case.verdict != "marginal" and not case.drifts]
    return max(rates, default=-float("inf"))


def _last(holds: Callable[[int], bool], most: int) -> int:
    """The largest count that holds, with all the ones that were tried below it, by doubling and
    bisection to a part FINEST of it; 0 where 1 does not."""
    low, high = 0, 1
    while holds(high):
        low, high = high, 2 * high
        if low >= most:
            return low
    while high - low > max(1, low // FINEST):
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
