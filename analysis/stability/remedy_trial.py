"""The trial of a remedy: the scene with it, judged as it would be, in one pose after the other.

With each pose the rank of a remedy can only become worse: its worst growth rate and the hands that
are marginal are those of all poses so far, and whether its run breaks a limit is not known before
that. So a remedy that already ranks behind another one, which is judged to its end, needs no
further pose, and the best of several is found by judging the one that ranks first further.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from hapticlink.analysis.stability.hand_cases import Case, in_poses
from hapticlink.analysis.stability.modes import Bounds
from hapticlink.analysis.stability.poses import Pose
from hapticlink.analysis.stability.shared_work import SharedWork
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.scene.scene import Scene

DECAY = 0.05
"""Rate (1/s) at which a scene with a remedy decays at least, lest what is frozen takes it back."""

Visited = Callable[[Scene], tuple[Sequence[Pose], str]]
"""The poses in which a scene is judged, and which limit of `search/acceptance.py` its run
breaks."""


@dataclass(frozen=True)
class Remedy:
    """Options, and the growth rate (1/s) of the worst case in all poses and hands with them, those
    aside that are marginal or only drift. stable: whether it decays by DECAY at least; marginal:
    the hands in which small motions neither grow nor decay in some pose; drifting: those in which
    they drift; breaks: the limit that the run with them breaks."""

    options: tuple[str, ...]
    growth: float
    stable: bool
    marginal: tuple[str, ...] = ()
    drifting: tuple[str, ...] = ()
    breaks: str = ""

    @property
    def rank(self) -> tuple[bool, bool, bool, int, float]:
        """That of a better one is smaller, and that of one that has failed the largest."""
        failed, grows = self.growth == float("inf"), self.growth >= 0.0
        return failed, grows, bool(self.breaks), len(self.marginal), self.growth

    @property
    def suffices(self) -> bool:
        """Whether no other remedy is needed."""
        return self.stable and not self.marginal and not self.breaks


class Trial:
    """The trial of `options` that change a scene to `changed`, in the poses of `visited` and in the
    `hands`, those that are named in `hardest` first. tell: is called with the pose that is
    judged."""

    def __init__(
        self,
        options: tuple[str, ...],
        changed: Scene,
        visited: Visited,
        hardest: Sequence[str],
        hands: Mapping[str, Hand | None],
        bounds: Bounds,
        tell: Callable[[str], object],
        work: SharedWork,
    ) -> None:
        self.options, self._changed, self._visited = options, changed, visited
        self._hardest = {name: i for i, name in enumerate(hardest)}
        self._hands, self._bounds, self._tell, self._work = hands, bounds, tell, work
        self._cases: list[Case] = []
        self._without: dict[str, str] = {}
        self._breaks = ""
        self._further = self._judge()
        self.ended = False

    @property
    def remedy(self) -> Remedy:
        """The remedy, once it `ended`; before, one that ranks no worse."""
        growth = _worst(self._cases)
        if self.ended and (self._without or not self._cases):
            growth = float("inf")
        slight = {case.hand for case in self._cases if case.verdict == "marginal"}
        slow = {case.hand for case in self._cases if case.drifts}
        marginal, drifting = (tuple(x for x in self._hands if x in some) for some in (slight, slow))
        return Remedy(self.options, growth, growth < -DECAY, marginal, drifting, self._breaks)

    def judge_further(self) -> None:
        """Judges one more pose, if there is one."""
        try:
            next(self._further)
        except StopIteration:
            self.ended = True
        except (InputFault, FmuFault):  # its run fails
            self._cases, self.ended = [], True

    def judge(self, as_long_as: Callable[[Remedy], bool] = lambda remedy: True) -> Remedy:
        """The remedy in all poses, or in those up to which a condition on it holds."""
        while not self.ended and as_long_as(self.remedy):
            self.judge_further()
        return self.remedy

    def _judge(self) -> Iterator[None]:
        poses, self._breaks = self._visited(self._changed)
        for pose in sorted(poses, key=lambda pose: self._hardest.get(pose.name, len(poses))):
            if not any(case.pose == pose.name for case in self._cases):
                self._judge_in(pose)
                yield

    def _judge_in(self, pose: Pose) -> None:
        found, why = in_poses(
            self._changed, [pose], self._hands, self._bounds, self._tell, self._work
        )
        self._cases += found
        self._without.pop(pose.name, None)
        self._without |= why


def find_best(trials: Sequence[Trial]) -> Remedy:
    """The best of some remedies, the first one of those that are as good."""
    while not (first := min(trials, key=lambda trial: trial.remedy.rank)).ended:
        first.judge_further()
    return first.remedy


def those_that_help(remedies: Sequence[Remedy], growth: float) -> tuple[Remedy, ...]:
    """The remedies with which the worst case grows less than without them, at `growth` (1/s): in
    the poses of its own run a change may do worse than in those of the scene."""
    return tuple(remedy for remedy in remedies if remedy.growth < growth)


def _worst(cases: Sequence[Case]) -> float:
    """The largest growth rate of the cases that do not only drift, and are not marginal."""
    rates = [case.growth for case in cases if case.verdict != "marginal" and not case.drifts]
    return max(rates, default=-float("inf"))
