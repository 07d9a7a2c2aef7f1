"""The verdict on a scene over poses and hands, as text and as a record."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from html import escape
from typing import Any

from hapticlink.analysis.search.search import DOUBLINGS
from hapticlink.analysis.stability import frozen_nonlinearities
from hapticlink.analysis.stability.hand_cases import NOWHERE, Case, worst_case
from hapticlink.analysis.stability.hands import FREE
from hapticlink.analysis.stability.margin_and_remedy import Margin
from hapticlink.analysis.stability.modes import Bounds
from hapticlink.analysis.stability.poses import NEAR, Pose
from hapticlink.analysis.stability.remedy_trial import Remedy
from hapticlink.analysis.stability.stand_in import StandIn, record_stand_ins
from hapticlink.components.specs.hand import Hand
from hapticlink.orchestrator.results.html_table import html_table
from hapticlink.orchestrator.scene.overrides import as_command_line


@dataclass(frozen=True, repr=False)
class Stability:
    """The stability of a scene in poses and hands."""

    title: str
    bounds: Bounds
    poses: tuple[Pose, ...]
    hands: Mapping[str, Hand | None]
    """The judged hands by name, the scene's own among them; None: the scene as it is."""
    cases: tuple[Case, ...]
    without: Mapping[str, str]
    """By pose without equilibrium, the reason."""
    worst: Case
    margin: Margin
    remedies: tuple[Remedy, ...]
    """What makes all hands stable, or improves most: the best of all that was tried, and softer
    gains where these suffice; none where all are stable, or nothing that was tried helps."""
    frozen: tuple[str, ...]
    """Lines of text on what is removed or stays as at rest."""
    rounded: str = ""
    """At which rate it was judged instead of its own, and why."""
    stand_ins: tuple[StandIn, ...] = ()
    """What stands for FMUs whose state cannot be read."""
    run_fault: str = ""
    """How the scene's run, from which the poses are taken, failed; "" if it reached its end."""

    @property
    def in_hands(self) -> str:
        """stable, marginal, drifts or unstable, in the worst of all hands."""
        return _word([case for case in self.cases if not case.free])

    @property
    def in_free_air(self) -> str:
        """The same where nobody holds the handle; "" where the scene's hand does."""
        loose = [case for case in self.cases if case.free]
        return _word(loose) if loose else ""

    @property
    def verdict(self) -> str:
        """stable, marginal, drifts or unstable: in hands; "not held" where it is stable in these,
        and the scene has no hand that brings it to rest."""
        loose = FREE in self.hands or self.in_free_air not in ("", "stable")
        if self.in_hands in ("stable", "marginal") and loose:
            return "not held"
        return self.in_hands

    @property
    def growth(self) -> float:
        """The growth rate (1/s) of the worst case."""
        return self.worst.growth

    @property
    def damping(self) -> float | None:
        """The damping to ground (N.s/m) that a handle in free air lacks: infinite if none that was
        tried suffices, None if it lacks none."""
        return max((c.damping for c in self.cases if c.damping is not None), default=None)

    def record(self) -> dict[str, Any]:
        """The content of stability.json."""
        return {
            "title": self.title,
            "verdict": self.verdict,
            "in_hands": self.in_hands,
            "in_free_air": self.in_free_air or None,
            "growth_rate": self.growth,
            "worst": self.worst.record(),
            "margin": asdict(self.margin),
            "remedies": [asdict(remedy) for remedy in self.remedies],
            "damping_needed_in_free_air": self.damping,
            "drift": asdict(self.bounds),
            "poses": [asdict(pose) for pose in self.poses],
            "equilibria": {c.pose: asdict(c.at) for c in self.cases if c.at},
            "poses_without_equilibrium": dict(self.without),
            "hands": {name: asdict(hand) if hand else None for name, hand in self.hands.items()},
            "cases": [case.record() for case in self.cases],
            "frozen": list(self.frozen),
            "rounded": self.rounded,
            **record_stand_ins(self.stand_ins),
            "run_fault": self.run_fault or None,
        }

    @property
    def finding(self) -> str:
        """The verdict in one line."""
        return f"{self._finding}{'; but its own run fails' if self.run_fault else ''}"

    @property
    def _finding(self) -> str:
        poses = len({case.pose for case in self.cases})
        held = {case.hand for case in self.cases if not case.free}
        edge = {c.hand for c in self.cases if c.hand in held and c.verdict == "marginal"}
        hands = f"{len(held)} hands" if len(held) > 1 else next(iter(held), "")
        in_poses = f"{poses} pose{'s' if poses > 1 else ''}"
        calm = f"stable in {hands} and {in_poses}"
        if len(edge) == len(held) > 0:
            calm = f"marginal in {hands} and {in_poses}"
        elif edge:
            calm = f"stable in {len(held - edge)} of {hands} and marginal in the others, {in_poses}"
        worst = self.worst
        if self.verdict == "unstable":
            return f"unstable: {_name_case(worst)}"
        if self.verdict == "drifts":
            slow = [case for case in self.cases if case.drifts and not case.free]
            some = f"{len({case.hand for case in slow})} of {hands}" if len(held) > 1 else hands
            near = f", and marginal in {len(edge)}" if edge else ""
            return f"drifts slowly in {some}{near}, {in_poses}: {_name_case(worst)}"
        if self.verdict == "not held":
            loose = worst_case(c for c in self.cases if c.free)
            if loose.verdict != "unstable":
                slight = "neither grow nor decay" if loose.verdict == "marginal" else "do not grow"
                return f"not held: in free air small motions {slight}; {calm}"
            does = "drifts" if loose.drifts else f"shows a growing {loose.kind}"
            ends = "small motions decay with no damping that was tried"
            if self.damping is not None and math.isfinite(self.damping):
                ends = f"small motions decay with about {self.damping:.2g} N.s/m of damping"
            return f"not held: in free air it {does} at {loose.growth:.2g} 1/s, and {ends}; {calm}"
        if self.verdict == "marginal":
            return f"{calm}: {_name_case(worst)}"
        return f"{calm}; slowest to decay at {-worst.growth:.3g} 1/s, {_where(worst)}"

    def __str__(self) -> str:
        return "\n".join((f"{self.title}: {self.finding}", *self.lines()))

    __repr__ = __str__

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{escape(line)}</li>" for line in (*self._warnings(), *self._below()))
        table = html_table(("hand", "worst pose", "growth 1/s", "Hz", "what"), self._in_hands())
        return f"<p><b>{escape(f'{self.title}: {self.finding}')}</b></p>{table}<ul>{lines}</ul>"

    def lines(self) -> Iterator[str]:
        """The result as text, below the finding."""
        yield from self._warnings()
        rows = [*self._in_hands()]
        wide = max(24, *(len(pose) for _, pose, *_ in rows))
        yield f"{'hand':28s} {'worst pose':{wide}s} {'growth 1/s':>11s} {'Hz':>7s}  what"
        for hand, pose, growth, hertz, what in rows:
            yield f"{hand:28s} {pose:{wide}s} {growth:11.3g} {hertz:7.3g}  {what}"
        yield from self._below()

    def _warnings(self) -> Iterator[str]:
        if self.run_fault:
            yield (
                f"warning: its own run fails: {self.run_fault}; the poses are those up to there, "
                "in which small motions alone are judged"
            )

    def _in_hands(self) -> Iterator[tuple[str, str, float, float, str]]:
        """The worst case of each hand."""
        for hand in _hands(self.cases):
            worst = worst_case(c for c in self.cases if c.hand == hand.hand)
            grows = worst.verdict == "unstable" or worst.kind == NOWHERE
            what = worst.kind if grows else worst.verdict
            yield worst.hand, worst.pose, worst.growth, worst.hertz, what

    def _below(self) -> Iterator[str]:
        """What stands below the table of hands: margins, remedies, and what was left out."""
        poses = {case.pose for case in self.cases}
        aside = "drifts aside"
        if self.margin.left_out:
            aside += f", and hands with a {NOWHERE}"
        if len(poses) > 1:
            aside += "; other poses may have less"
        yield f"margin at {self.worst.pose} ({aside}): {', '.join(self._margins())}"
        full = dict.fromkeys(case.pose for case in self.cases if case.saturated)
        if full:
            yield (
                f"at {', '.join(full)} motors are at their limit, and are judged as if they stayed "
                "there: the hand moves the bare device, until it takes them off their limit"
            )
        yield from self._about_rest()
        if self.margin.alone:
            yield (
                f"at {self.worst.pose} the mechanism leaves its pose by itself: without hand and "
                f"rendering small motions grow at {self.margin.alone:.3g} 1/s"
            )
        for remedy in self.remedies:
            options = " ".join(map(as_command_line, remedy.options))
            how = f"decays at {'' if remedy.stable else 'only '}{-remedy.growth:.2g} 1/s"
            if math.isinf(remedy.growth):
                how = "nothing grows by more than a drift"
            elif not remedy.stable and remedy.growth >= 0.0:
                how = f"improves most, to {remedy.growth:.2g} 1/s, which is not enough"
            if self.margin.left_out:
                how += " in the other hands"
            if remedy.marginal:
                how += f"; marginal in {len(remedy.marginal)} of the hands"
            if remedy.drifting:
                how += f"; drifts in {len(remedy.drifting)} of the hands"
            if remedy.breaks:
                how += f"; but in its run {remedy.breaks}"
            yield f"{'remedy' if remedy is self.remedies[0] else 'or'}: {options}: {how}"
        if not self.remedies and self.verdict == "unstable":
            yield "remedy: none of the changes of hold, rate, gain and damping that were tried"
        if self.worst.participation and self.verdict != "stable":
            parts = ", ".join(f"{name} {share:.2f}" for name, share in self.worst.participation)
            yield f"who moves: {parts}"
        if self.rounded:
            yield self.rounded
        for pose, why in self.without.items():
            yield f"pose at {pose} left out: {why}"
        yield from map(str, self.stand_ins)
        apart = frozen_nonlinearities.name_by_end(self.frozen)
        if apart:
            yield f"judged for small motions; {apart}"

    def _about_rest(self) -> Iterator[str]:
        """Of which equilibria the rates are."""
        held = {case.pose: case for case in self.cases if case.at and not case.free}
        for name, case in held.items():
            if case.at and case.at.found:
                F = ", ".join(f"{round(x, 9) + 0.0:.3g}" for x in case.at.press)
                yield f"{name}: {case.at.found}; each hand stands still there with ({F}) N and N.m"
        visited = {pose.name: pose for pose in self.poses if not pose.found}
        off = {n: c.at.apart(visited[n]) for n, c in held.items() if c.at and n in visited}
        if far := [name for name, length in off.items() if length > NEAR]:
            most = max(off.values())
            yield (
                f"at {', '.join(far)} the equilibrium that is judged is up to {1e3 * most:.2g} mm "
                "from where the run was"
            )
        if counted := [name for name, case in held.items() if case.at and case.at.counted]:
            yield (
                f"{', '.join(counted)}: how many directions are constrained in that pose depends "
                "on what was before (`hysteresis`)"
            )
        if beside := [name for name, case in held.items() if case.neutral]:
            yield (
                f"at {', '.join(beside)} equilibria lie side by side, as in some direction nothing "
                "resists: the rates are of those in stability.json, and may differ beside them"
            )

    def _margins(self) -> Iterator[str]:
        margin = self.margin

        def told(quantity: str, what: str, value: str) -> str:
            if quantity in margin.not_searched_further:
                return f"{what}at least {value} (not searched further)"
            return f"{what}{value}"

        if margin.not_searched:
            yield f"not searched, {margin.not_searched}"
            return
        if margin.stiffness is not None:
            some = told("stiffness", "stiffnesses ", f"times {_within(margin.stiffness)}")
            least = f"down to times {2.0**-DOUBLINGS:.1g}"
            yield some if margin.stiffness else f"stable with no stiffnesses tried, {least}"
        if margin.delay is not None:
            what = "further delay in the controller"
            some = told("delay", "", f"{_within(1e3 * margin.delay, 3)} ms of {what}")
            yield some if margin.delay else f"less than a haptic period of {what}"
        if margin.rate is not None:
            down = f"down to {-float(_within(-margin.rate, 3)):g} Hz in whole haptic periods"
            some = told("rate", "graphics ", down)
            yield some if math.isfinite(margin.rate) else "stable at no graphics rate tried"
        if margin.stiffness is None and margin.delay is None and margin.rate is None:
            yield "no coupling and no second rate"


def _within(value: float, digits: int = 2) -> str:
    """A limit in a number of digits, rounded to its safe side, down."""
    if not value or not math.isfinite(value):
        return f"{value:g}"
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)
    # what is a number of units but for rounding stays
    return f"{math.floor(value / unit + 1e-9) * unit:g}"


def _hands(cases: tuple[Case, ...]) -> list[Case]:
    """A case of each hand."""
    return list({case.hand: case for case in cases}.values())


def _word(cases: list[Case]) -> str:
    growing = [case for case in cases if case.verdict == "unstable"]
    if not growing:
        return "marginal" if any(case.verdict == "marginal" for case in cases) else "stable"
    return "drifts" if all(case.drifts for case in growing) else "unstable"


def _where(case: Case) -> str:
    return f"in {case.hand} at {case.pose}"


def _name_case(case: Case) -> str:
    how = "grows" if case.growth > 0.0 else "decays"
    return f"{case.kind} of {case.hertz:.3g} Hz {how} at {abs(case.growth):.3g} 1/s {_where(case)}"
