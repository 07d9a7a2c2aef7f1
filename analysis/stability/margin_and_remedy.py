"""How far the worst case is from the limit, and what takes an unstable one to the safe side.

Both are searched in one pose and all hands, and what is advised is judged in all poses before.
A mode that only drifts counts as stable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import cached_property

from hapticlink.analysis.search.search import (
    Largest,
    largest_count,
    largest_scale,
)
from hapticlink.analysis.search.settings import LAWS, REMEDIES, set_rate
from hapticlink.analysis.stability.hand_cases import TIE, UNSURE, Case, InHands, first_of_largest
from hapticlink.analysis.stability.hands import FREE, OWN_FREE, UNHELD
from hapticlink.analysis.stability.mechanism_alone import growth_alone
from hapticlink.analysis.stability.modes import Bounds
from hapticlink.analysis.stability.poses import Pose, at_pose
from hapticlink.analysis.stability.remedy_trial import (
    Remedy,
    Trial,
    Visited,
    find_best,
    those_that_help,
)
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.analysis.stability.short_hyperperiod import frame_length, graphics_rate, short
from hapticlink.analysis.stability.told_steps import Steps
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.base.signal_names import CONTROLLER
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene

FINE = 0.02
"""Of the logarithm of the factor on all stiffnesses."""
LATEST, SLOWEST = 8, 64
"""Haptic periods up to which a further delay, and a frame, are tried."""
SAFE = 1.25
"""By how much gains that are advised stay below their limit."""
DAMPINGS = (0.5, 2.0)
"""Factors on the damping of the coupling that are tried."""
FASTER = (2, 4)
"""Factors on rates that are tried."""
MARGINS = "stiffness", "delay", "rate"
TRIED = 3
"""Remedies that are judged in all poses."""


@dataclass(frozen=True)
class Margin:
    """How far the worst pose is from the limit in all hands; None where it has no such quantity."""

    stiffness: float | None
    """The factor on all stiffnesses, dampings by its root, up to which it is stable, to FINE of its
    logarithm; 0 where it is unstable with all that were tried."""
    delay: float | None
    """The further delay (s) in the controllers, in whole haptic periods: with one more it is
    unstable. None, too, where it is unstable with none."""
    rate: float | None
    """The lowest graphics rate (Hz) down to which it is stable with frames of whole haptic periods:
    with frames a period longer it is unstable. Infinite where it is with all that were tried."""
    not_searched_further: tuple[str, ...] = ()
    """The quantities that are stable as far as they were searched, or next to which no equilibrium
    was found, or rounding decides whether something grows: at least these."""
    alone: float = 0.0
    """The growth rate (1/s) of the mechanism in that pose by itself, without hand and rendering; 0
    where it is no more than a drift."""
    left_out: tuple[str, ...] = ()
    """The hands that were not searched with, as their divergence there leads nowhere."""
    not_searched: str = ""
    """Why nothing was searched."""


def improvements(
    read: Scene,
    pose: Pose,
    hands: Mapping[str, Hand | None],
    bounds: Bounds,
    worst: Case,
    visited: Visited,
    hardest: Sequence[str] = (),
    work: SharedWork | None = None,
    steps: Steps | None = None,
) -> tuple[Margin, tuple[Remedy, ...]]:
    """The margin in the `pose` of the `worst` case, and what ends its instability or grows less, as
    `remedies`; nothing where it is stable. visited: gives the poses in which the scene with other
    options is judged, those that are named in `hardest` first."""
    if worst.verdict == "marginal" and worst.uncertainty > UNSURE:
        unsure = f"as growth rates there are uncertain by {worst.uncertainty:.2g} 1/s"
        return Margin(None, None, None, not_searched=unsure), ()
    first = sorted(hands, key=lambda name: name != worst.hand)
    held = {name: hands[name] for name in first if name not in (FREE, OWN_FREE)}
    if not held:
        return Margin(None, None, None, not_searched="as no hand is left"), ()
    search = _Search(read, pose, held, bounds, work or SharedWork(), steps or Steps(None, 0))
    stable = worst.free or worst.verdict != "unstable" or worst.drifts
    with search.place() as (place, _):
        margin = search.margin(place)
        softer = search.softer(place, margin)
        candidates = () if stable else [*search.candidates(place, margin, softer)]
    found = search.remedies(candidates, softer, visited, hardest)
    return margin, those_that_help(found, worst.growth)


class _Search:
    def __init__(
        self,
        read: Scene,
        pose: Pose,
        hands: Mapping[str, Hand | None],
        bounds: Bounds,
        work: SharedWork,
        steps: Steps,
    ) -> None:
        self._read, self._pose, self._hands, self._bounds = read, pose, hands, bounds
        self._work, self._steps = work, steps
        self._known: dict[tuple[str, ...], float] = {}
        self._without: set[tuple[str, float]] = set()
        """Values, by quantity, with which no equilibrium was found, or only what grows within its
        uncertainty: not known to be unstable."""
        self._own_place: RestingScene | None = None
        self._haptic = exact(self._read.haptics.rate)

    def place(
        self, change: Sequence[str] = ()
    ) -> AbstractContextManager[tuple[RestingScene, Pose]]:
        """The scene, with a change, at rest in the pose."""
        read = short(open_scene.load(self._read, change) if change else self._read)[0]
        return at_pose(read, self._pose, self._hands.keys() != {UNHELD}, work=self._work)

    def margin(self, place: RestingScene) -> Margin:
        found: dict[str, Largest] = {}
        self._own_place = place
        self._steps.tell(f"margins at {self._pose.name}")
        if place.gains.laws:
            self._steps.begin("margin of stiffness")
            found["stiffness"] = largest_scale(lambda s: self._stable(place, s), FINE)
        stable = ("stiffness" in found and found["stiffness"].value >= 1.0) or self._stable(place)
        if CONTROLLER in place.map.system.fmu:
            self._steps.begin("margin of delay")
            if stable:
                found["delay"] = largest_count(lambda n: self._stable(place, late=n), 1, LATEST)
        if self._read.graphics is not None:
            self._steps.begin("margin of the graphics rate")
            found["rate"] = self._slowest_frame(stable)
        beyond = tuple(name for name, limit in found.items() if not self._limited(name, limit))
        stiffness, delay, frame = (found.get(name) for name in ("stiffness", "delay", "rate"))
        return Margin(
            stiffness=stiffness.value if stiffness else None,
            delay=float(int(delay.value) / self._haptic) if delay else None,
            rate=self._frame_rate(int(frame.value), stable) if frame else None,
            not_searched_further=beyond,
            alone=self._alone(place),
        )

    def _limited(self, name: str, found: Largest) -> bool:
        """Whether it is unstable beside the largest value that holds."""
        above = found.value * math.exp(FINE) if name == "stiffness" else found.value + 1
        without = (value for quantity, value in self._without if quantity == name)
        return found.limited and not any(found.value < v <= above * (1 + TIE) for v in without)

    def _alone(self, place: RestingScene) -> float:
        with suppress(InputFault, FmuFault):  # no equilibrium with the scene's gains
            return growth_alone(place.period({}), self._bounds)
        return 0.0

    def _frame_rate(self, periods: int, stable: bool) -> float:
        """The graphics rate (Hz) whose frames are so many haptic periods; of the scene's own frames
        its own rate, where that is stable: it need not be a whole number of periods."""
        if not periods:
            return float("inf")
        own = stable and periods == frame_length(self._read)
        return float(graphics_rate(self._read) if own else self._haptic / periods)

    def _slowest_frame(self, stable: bool) -> Largest:
        """The longest frame, in haptic periods, that is stable, searched from the scene's own on,
        with which it is `stable` or not where it is not rounded."""
        own = frame_length(self._read)

        def holds(n: int) -> bool:
            if n == own and stable:
                return True
            self._steps.tell(f"margin of the graphics rate: {self._frame_rate(n, stable):.3g} Hz")
            return self._growth([set_rate("graphics", self._haptic / n)], ("rate", n)) < 0.0

        return largest_count(holds, own, SLOWEST)

    def _stable(self, place: RestingScene, scale: float = 1.0, late: int = 0) -> bool:
        """Whether all hands are stable with gains scaled, and controllers that compute with what
        they read some haptic periods before."""
        self._steps.tell(
            f"margin of delay: {late} haptic periods"
            if late
            else f"margin of stiffness: times {scale:.3g}"
        )
        try:
            scales = {} if scale == 1.0 else dict.fromkeys(place.gains.laws, scale)
            return self._worst(InHands(place, scales, late)) < 0.0
        except InputFault:
            self._without.add(("delay", late) if late else ("stiffness", scale))
        except FmuFault:  # diverges at once
            pass
        return False

    def _growth(self, change: Sequence[str], value: tuple[str, float] | None = None) -> float:
        """With a change, the growth rate of a hand in the pose that is unstable, or of the worst
        one where none is; infinite where there is no equilibrium, as is noted for the `value` of a
        quantity."""
        if (change := tuple(change)) not in self._known:
            try:
                with self.place(change) as (place, _):
                    self._known[change] = self._worst(InHands(place))
            except (InputFault, FmuFault) as fault:
                self._known[change] = float("inf")
                if value and isinstance(fault, InputFault):
                    self._without.add(value)
        return self._known[change]

    def _worst(self, held: InHands) -> float:
        return held.worst(self._hands, self._bounds, lambda hand: self._own.slow(hand))

    @cached_property
    def _own(self) -> InHands:
        """With the scene's own gains."""
        assert self._own_place is not None
        return InHands(self._own_place)

    def softer(self, place: RestingScene, margin: Margin) -> tuple[str, ...]:
        """Gains below the limit; nothing where no gains are stable."""
        if not margin.stiffness:
            return ()
        scale = min(1.0, margin.stiffness) / SAFE
        gains = place.gains
        return tuple(overrides.write_options(gains.options(dict.fromkeys(gains.laws, scale))))

    def candidates(
        self, place: RestingScene, margin: Margin, softer: tuple[str, ...]
    ) -> Iterator[tuple[str, ...]]:
        """Single changes of the scene, and the last resort, softer gains and rate together."""
        read, gains = self._read, place.gains
        for hold in REMEDIES:
            if read.graphics is not None and hold != read.hold and not read.holds:
                yield (f"hold={hold}",)
        if softer:
            yield softer
        part, _, _ = LAWS["drift"]
        for factor in DAMPINGS:
            options = gains.options({"drift": factor**2})
            damping = {k: v for k, v in options.items() if k.endswith(f".{part}.damping")}
            if damping:
                yield tuple(overrides.write_options(damping))
        if read.graphics is not None:
            rate = graphics_rate(read)
            if (whole := self._haptic / frame_length(read)) != rate:
                yield (set_rate("graphics", whole),)
            if margin.rate is not None and margin.rate > rate:
                rate = self._haptic / max(1, round(self._haptic / margin.rate))
            for factor in (1, *FASTER):
                if rate < factor * rate <= self._haptic or factor == 1:
                    yield (set_rate("graphics", factor * rate), *(softer if factor == 1 else ()))
            if read.mechanism_at == "graphics":
                yield ("mechanism_at=haptics",)
        for factor in FASTER:
            yield (set_rate("haptics", factor * self._haptic),)
            if softer:
                yield (set_rate("haptics", factor * self._haptic), *softer)

    def remedies(
        self,
        candidates: Sequence[tuple[str, ...]],
        softer: tuple[str, ...],
        visited: Visited,
        hardest: Sequence[str],
    ) -> tuple[Remedy, ...]:
        """The first of those that are best in the worst pose that suffices, judged in the poses of
        its changed run; the best of TRIED where none does. And softer gains with which all
        decays."""
        self._steps.expected += len(candidates) + min(TRIED, len(candidates))
        growth = {}
        for change in candidates:
            self._steps.begin(_name(change, softer))
            growth[change] = self._growth(change)
        # What leaves the same mode of an arm ties: fewer options, which come first.
        left, best = [*growth], list[tuple[str, ...]]()
        while left and len(best) < TRIED:
            best.append(first_of_largest(left, lambda change: -growth[change]))
            left.remove(best[-1])
        best[1:] = [change for change in best[1:] if growth[change] < 0.0]

        def trial(change: tuple[str, ...]) -> Trial:
            name, changed = _name(change, softer), short(open_scene.load(self._read, change))[0]
            self._steps.begin(f"{name}: its own run")
            return Trial(
                change,
                changed,
                visited,
                hardest,
                self._hands,
                self._bounds,
                lambda pose: self._steps.tell(f"{name}: pose at {pose}"),
                self._work,
            )

        trials: dict[tuple[str, ...], Trial] = {}
        for change in best:
            trials[change] = trial(change)
            if trials[change].judge(lambda remedy: remedy.suffices).suffices:
                break  # which ranks before those that do not suffice
        if growth.get(softer, 0.0) < 0.0 and softer not in trials:
            trials[softer] = trial(softer)
        found = [find_best([*trials.values()])] if trials else []
        if softer in trials and softer not in (remedy.options for remedy in found):
            found += [remedy] if (remedy := trials[softer].judge()).growth < 0.0 else []
        return tuple(found)


def _name(change: tuple[str, ...], softer: tuple[str, ...]) -> str:
    others = [option for option in change if option not in softer]
    return "remedy " + " and ".join(
        [*others, *(["softer gains"] if len(others) < len(change) else [])]
    )
