"""The printed numbers of a scene, each with what runs say of it: agree, contradicted, or undecided
and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

import hapticlink as hl
from hapticlink.orchestrator.scene.overrides import parse
from studies.said.growth import (
    SCALES,
    Growth,
    Odd,
    growth_by_ticks,
    growth_of,
    hertz,
    hyperperiod,
    step_of,
)

NUDGES = (np.array([1.0, -0.7, 5.0]),) * 2 + (np.array([-0.4, 1.0, -3.0]),)
"""Of the hand, in its three directions (m, m, rad), of a run and of the next ones, which are seen
beside runs that are nudged the other way (Odd)."""
LONGEST = 60.0, 60.0, 100.0
"""Of each of them (s)."""
CLOSE, APART = 0.03, 0.06
"""Differences of growth rates, relative, up to which they agree, as a run is not quite small, and
from which on they contradict."""
LEAST, SLIGHT = 0.002, 0.01
"""The same (1/s), of rates that are nearly 0; and what grows by less than the second is marginal by
the words of `stability`."""
FAR = 1e-5
"""Changes in a tick (m, rad) that a motion of 1e-9 does not reach in 20 s by a drift. With
other gains, whose rest is not told, a run begins beside it: the difference of two does not."""
BESIDE = 1e-7
"""Changes of the mechanism in the first ticks (m, rad), a hundred nudges, from which on a run
begins beside its rest."""
OWN = "free", "the scene's own damper"
BLOCKS = "haptic_device", "hand", "virtual_mechanism"
LEFT_OUT = "interpolation", "timing"
Row = dict[str, Any]
Ended = tuple[Growth, Any]
Claim = tuple[str, float, str, str]
COLUMNS = "what", "told", "says", "why"


class Checked:
    """A scene with its verdict."""

    def __init__(self, base: str, options: Mapping[str, Any]) -> None:
        self.base, self.options = base, dict(options)
        self.varies = isinstance(self.options["graphics.rate"], Mapping)
        told = (hl.equilibrium_stability if self.varies else hl.stability)(base, self.options)
        self.record, self.finding = told.record(), getattr(told, "finding", told.verdict)
        self.own = hl.run(base, self.options, figures=False)
        self.connections = [c.split(" -> ") for c in self.own.run["connections"]]
        scene = hl.scene(base, self.options)
        self.haptic = Fraction(str(scene.haptics.rate))
        slow = scene.graphics.rate if scene.graphics and not self.varies else self.haptic
        self.graphics = Fraction(str(slow))

    def at_rest(self, pose: str, hand: Mapping[str, Any], nudge: Any) -> dict[str, Any]:
        """The options of a run that begins in the equilibrium of a pose, nudged, in a hand."""
        at = self.record["equilibria"][pose]
        place, F = np.array(at["handle"] or at["point"]), np.array(at["press"])
        off = np.resize([1.0, -0.6, 0.3, 0.8], len(at["joints"])) * nudge[0]
        start = [0.0, *(place + 0.3 * np.roll(nudge, 1) * [0.2, 1.0, 1.0])]
        brought: list[Row] = [{"from": {"table": [start]}, "to": "haptic_device.x_start"}]
        if hand["type"] == "arm" and F.any():
            brought += [
                {"from": f"hand.F[{i}]", "to": f"{end}[{i}]", "offset": F[i - 1]}
                for start, end in self.connections
                for i in (1, 2, 3)
                if start == "hand.F"
            ]
            F = np.zeros(3)
        options = {k: v for k, v in self.options.items() if k.partition(".")[0] != "hand"}
        options |= self.counting(pose)
        if "friction of hold passive" in str(self.record["frozen"]):
            # What is told is without it, as is said, and so as by zoh. At 800/15 Hz seed 4800512
            # grows at .141 1/s by zoh; with friction 1e-9 m come to rest within 25 s.
            options = {k: "zoh" if v == "passive" else v for k, v in options.items()}
        for user, there in at["others"].items():
            options[f"hands.{user}"] = _table(hand, np.array(there), np.zeros(3), -0.6 * nudge)
        return options | {
            "hand": _table(hand, place, F, nudge),
            "connection": brought,
            "linkage.start": {
                joint: np.add(x, dx).tolist()
                for (joint, x), dx in zip(at["joints"].items(), off, strict=True)
            },
            "linkage.start_velocity": {},
            "record": {"signals": [*SCALES], "format": "rows"},
            "stop_when": "",
        }

    def counting(self, pose: str) -> Row:
        """The options with which directions are counted as told, where that depends on what was
        before: with a tolerance of .1 as few as there can be, of .15 as many."""
        told = self.record["equilibria"]
        if told[pose]["counting"]:
            return dict(told[pose]["counting"])
        for beside, tolerance in (("fewer constrained", 0.15), ("more constrained", 0.1)):
            if f"{pose}, {beside}" in told:
                return {"directions.rank_tolerance": tolerance, "directions.hysteresis": 1.0}
        return {}

    def step(self, told: float, changes: Row) -> float:
        """Between the snapshots of a run (s)."""
        slow = Fraction(str(changes.get("graphics.rate", self.graphics)))
        return step_of(self.haptic, slow, told)

    def run(self, pose: str, hand: Row, told: float, changes: Row, again: int) -> Ended:
        """The growth rate of a run in a pose and a hand; `told` is how fast it may be."""
        step = self.step(told, changes)
        rises = 1e-15 if told > 5.0 else 1e-12 if told > 1.0 else 1e-9
        small, folds = (rises, 20.0) if told > 0.0 else (5e-7, 30.0)  # until its rest creeps alone
        folds *= 1 + again // 2
        seconds = max(0.25, min(LONGEST[again], max(folds / max(abs(told), 1e-3), 30 * step)))
        try:
            to, *fro = (
                self._nudged(pose, hand, sign * small * NUDGES[again], changes, seconds)
                for sign in ((1.0, -1.0) if again else (1.0,))
            )
        except hl.InputFault as fault:
            return Growth(why=str(fault).splitlines()[0]), None
        seen = Odd(to, *fro) if fro else to
        return growth_of(seen, step, told), seen

    def _nudged(self, pose: str, hand: Row, nudge: Any, changes: Row, seconds: float) -> Any:
        options = self.at_rest(pose, hand, nudge) | changes
        if len(options["connection"]) > 1:  # the hand's connections are one for each scalar
            each = [(" ->", f"[{i}] ->", f"[{i}]") for i in (1, 2, 3)]
            options["delays"] = {
                key.replace(old, new) + end: late
                for key, late in options.get("delays", {}).items()
                for old, new, end in (each if key.startswith("hand.F ->") else [("", "", "")])
            }
        return hl.run(self.base, options | {"duration": seconds}, figures=False)


def _table(hand: Mapping[str, Any], place: Any, F: Any, nudge: Any) -> Row:
    """The [hand] table that stands still at a pose, nudged, and presses with F."""
    table = {k: v for k, v in hand.items() if v is not None and k not in LEFT_OUT}
    if table["type"] in ("constant", "profile"):
        off = F + nudge * np.array([100.0, 100.0, 0.2])
        damped = {"damping": table["damping"]} if table.get("damping") else {}
        rows = [[0.0, *off.tolist()], [0.05, *F.tolist()]]
        return {"type": "profile", "table": rows, "interpolation": "hold", **damped}
    k = np.array(table["stiffness"])
    target = place + np.divide(F, k, out=np.zeros(3), where=k > 0) + nudge
    return table | {"target": [[0.0, *target.tolist()]]}


def compare(case: Mapping[str, Any], run: Growth) -> tuple[str, str]:
    """agree, contradicted or undecided, and why."""
    if run.why:
        return "undecided", run.why
    told, found = case["growth_rate"], f"run {run.rate:.4g} +- {run.spread:.2g} 1/s"
    off, size = abs(run.rate - told), max(abs(told), abs(run.rate))
    allowed = 2 * run.spread + case["uncertainty"]
    if run.spread > max(0.05 * size, LEAST):
        return "undecided", f"the run is not clean: {found}"
    turn = 2 * np.pi * case["frequency"] * run.step
    turns = min(abs((turn + s * run.turn + np.pi) % (2 * np.pi) - np.pi) for s in (-1, 1))
    if off <= max(CLOSE * size, LEAST) + allowed:
        if turns > max(0.15, 0.1 * turn) and size > SLIGHT:
            says = "contradicted" if told > 0.0 else "undecided"  # one beside it that is not seen
            return says, f"{found}, turning by {run.turn:.3g} a step, not {turn:.3g}"
        return "agree", found
    return ("contradicted" if off > max(APART * size, 2 * LEAST) + allowed else "undecided"), found


def claims(scene: Checked) -> Iterator[Row]:
    """All printed numbers, with what runs say of them."""
    kinds = (_exponent,) if scene.varies else (_rates, _damping, _margins, _remedies)
    for kind in (_energies, *kinds):
        yield from (dict(zip(COLUMNS, claim, strict=True)) for claim in kind(scene))


def _energies(scene: Checked) -> Iterator[Claim]:
    """What the hand of the scene's own run put in, and what was generated at its port, (J), by sums
    over rows: each force is held over a step."""
    told = scene.own.run["user_port"]
    if not isinstance(told, Mapping) or scene.base == "two-users":
        return
    F, x, E = (scene.own[s] for s in ("hand.F", "haptic_device.x_true", "virtual_mechanism.energy"))
    n = min(map(len, (F, x, E)))
    put_in = np.concatenate([[0.0], np.cumsum(np.sum(F[: n - 1] * np.diff(x[:n], axis=0), axis=1))])
    if len(scene.own.time("virtual_mechanism.energy")) != len(scene.own.time("hand.F")):
        return
    generated = E[:n].ravel() - E[0] - put_in
    for what, J, by_rows in (
        ("energy generated (J)", told["generated"], generated[-1]),
        ("most energy generated (J)", told["peak"], generated.max()),
    ):
        near = abs(J - by_rows) <= 1e-9 + 1e-6 * max(np.abs(put_in).max(), np.ptp(E))
        yield what, J, "agree" if near else "contradicted", f"rows {by_rows:.6g} J"


def _exponent(scene: Checked) -> Iterator[Claim]:
    """The Lyapunov exponent of a rate that varies, by the slope of the logarithm of what moves. A
    handle that decays faster may leave out a mode: of -1.374 1/s that of seed 5000727 shows -2.1,
    and the mechanism at 1e-13 m/s -1.2 to -1.6."""
    told, wide = scene.record["lyapunov_exponent"], 3 * scene.record["confidence"]
    row = "Lyapunov exponent (1/s)", told
    run = hl.run(scene.base, scene.options | {"duration": LONGEST[0]}, figures=False)
    d = np.linalg.norm(np.diff(run["haptic_device.x_true"], axis=0), axis=1)
    n = int(scene.haptic) // 4
    size = np.array([d[i : i + n].max() for i in range(0, len(d) - n, n)])
    moving = np.flatnonzero((size < 1e-6) & (size > 1e-13))
    if len(moving) < 16:
        yield *row, "undecided", "less than 4 s between rounding and large motions"
        return
    slope = float(np.polyfit(moving / 4, np.log(size[moving]), 1)[0])
    off = slope - told
    far, near = off > max(3 * wide, 0.3 * abs(told)), abs(off) < max(wide, 0.1 * abs(told))
    says = "agree" if near else "contradicted" if far else "undecided"
    yield *row, says, f"run {slope:.4g}"


def _rank(case: Mapping[str, Any]) -> tuple[bool, bool, bool, float]:
    grows = case["verdict"] == "unstable"
    fast = grows and case["kind"] != "drift"
    return fast, grows, case["verdict"] == "marginal", case["growth_rate"]


def _rates(scene: Checked) -> Iterator[Claim]:
    """Of each hand, in its worst pose."""
    cases = scene.record["cases"]
    for hand in dict.fromkeys(c["hand"] for c in cases):
        yield _rate(scene, max((c for c in cases if c["hand"] == hand), key=_rank))


def _rate(scene: Checked, case: Mapping[str, Any]) -> Claim:
    """The growth rate of a hand. A run that shows more than was told may show a creep by the square
    of its nudge (Odd); one that shows less may leave out a mode: a last one begins otherwise, and
    is longer. Frames of different lengths contradict nothing (FOLDS), but agree where there are too
    few hyperperiods: of -1.861 1/s, whose hyperperiod is 1 s, seed 4900623 shows -2.03 +- .16 by
    these, and -1.8608 by frames. A mode of the handle may be faint beside what the mechanism shows:
    in a firm grip seed 5400104 grows at .0021 1/s by all, and at the told .0196 by the handle; in a
    light touch seed 5600014 decays at .039 1/s by all, and at the told .00204 by the hand. Beside
    rests that lie side by side seed 5700326 creeps on by 6e-9 rad a step, which changes by a
    hundredth: changes of changes have the told -2.95."""
    told, hand = case["growth_rate"], scene.record["hands"][case["hand"]]
    step = scene.step(told, {})
    row = f"{case['hand']} at {case['pose']} (1/s)", told
    if case["saturated"]:
        return *row, "undecided", "motors at their limit, which any motion takes them off"
    whole = step == hyperperiod(scene.haptic, scene.graphics)
    frame = step_of(scene.haptic, scene.graphics, math.inf)
    if abs(told) * step > 1.0 and not whole and told < 0.0:
        return *row, "undecided", "too fast for frames of different lengths"
    for again in range(len(NUDGES)):
        run, seen = scene.run(case["pose"], hand, told, {}, again)
        says, why = compare(case, run)
        if says != "agree" and seen is not None:
            others = [growth_of(seen, step, told, block) for block in BLOCKS]
            others.append(growth_of(seen, step, told, creeps=True))
            if frame != step and abs(told) * frame < 1.0:
                others.append(growth_of(seen, frame, told))
            if told * step > 1.0:
                others.append(growth_by_ticks(seen))
            agree = (each for each in (compare(case, o) for o in others) if each[0] == "agree")
            says, why = next(agree, (says, why))
        if says == "agree" or (again and says == "contradicted" and run.rate > told):
            break
    if says == "contradicted" and not whole:
        return *row, "undecided", f"{why}, by frames of different lengths"
    return *row, says, why


def _drifts(rate: float, frequency: float) -> bool:
    """Slow in the words of `stability`: by less than 0.2 1/s and below 1 Hz."""
    return rate < 0.2 and frequency < 1.0


def _grows(scene: Checked, case: Row, changes: Row) -> tuple[bool | None, bool]:
    """Whether in the pose and hand of a case more than a drift, and than twice what is marginal
    there, grows; None where that is not clean. And whether with changes the told equilibrium is
    none, so that what moves there is not small, and only the odd part of two runs counts. In seed
    5600047, with 138 times its stiffness, the handle rises by 93 1/s to 9e-6 rad, where its motors
    are at their limit, and comes back: what counts is how it rises."""
    hand, slow, beside = scene.record["hands"][case["hand"]], case["growth_rate"], False
    for again, about in ((0, 1.0), (0, 0.1), (2, 0.1)):
        if beside and not again:
            continue
        run, ended = scene.run(case["pose"], hand, about, changes, again)
        if ended is None:
            return None, beside
        if not again:
            beside = bool(np.abs(np.diff(ended["virtual_mechanism.q"][:20], axis=0)).max() > BESIDE)
        if ended.fault:
            return True, beside
        size = np.abs(np.diff(ended["haptic_device.x_true"], axis=0)).max(axis=1)
        if (again or not beside) and not (rise := growth_by_ticks(ended)).why:
            return not _drifts(rise.rate, hertz(ended, scene.step(about, changes))), beside
        if size.max() > FAR and again:
            return True, beside
        if size.max() > FAR or (beside and not again):
            continue
        early, *_, middle, _, _, late = (float(p.max()) for p in np.array_split(size, 8))
        fits = not run.why and run.spread < max(0.1 * abs(run.rate), SLIGHT / 2)
        if fits and (run.rate < SLIGHT or late > middle):  # else a few steps looked like that
            least = 2.2 * slow if case["verdict"] == "marginal" else 0.0
            fast = run.rate > max(SLIGHT, least) and not _drifts(
                run.rate, hertz(ended, scene.step(about, changes))
            )
            return fast, beside
        if late > 100 * early:
            return True, beside
        if late < early / 100:
            return False, beside
    return None, beside


def _in_hands(scene: Checked, changes: Row, most: int) -> tuple[bool | None, str]:
    """Whether something grows in the worst pose in some of at most so many hands with changes."""
    pose, clean = scene.record["worst"]["pose"], True
    left_out = (*OWN, *scene.record["margin"]["left_out"])
    there = [c for c in scene.record["cases"] if c["pose"] == pose]
    cases = [c for c in there if c["hand"] not in left_out]
    for case in sorted(cases, key=lambda c: -c["growth_rate"])[:most]:
        grows, beside = _grows(scene, case, changes)
        if grows:
            if most < len(cases) and beside:
                return None, f"{case['hand']} grows, but begins beside its rest"
            return True, f"{case['hand']} grows"
        clean = clean and grows is False
    return (False, "none grows") if clean else (None, "not clean in some hand")


def _damping(scene: Checked) -> Iterator[Claim]:
    """The damping with which small motions of a free handle decay at .1 1/s, and half of it."""
    b = scene.record["damping_needed_in_free_air"]
    poses = [
        c["pose"]
        for c in scene.record["cases"]
        if b is not None and c["damping_needed"] == b < math.inf
    ]
    for pose in poses[:1]:
        hands = [{"type": "constant", "damping": [d, d, 1e-3 * d]} for d in (b, b / 2)]
        rates = [scene.run(pose, hand, -0.1, {}, 0)[0] for hand in hands]
        if rates[1].rate < -0.11:  # or it grew to what is not small before it was looked at
            rates[1] = scene.run(pose, hands[1], 10.0, {}, 0)[0]
        says = "agree" if rates[0].rate < -0.09 and rates[1].rate > -0.11 else "contradicted"
        if any(r.why or r.spread > max(0.01, 0.1 * r.rate) for r in rates):
            says = "undecided"
        why = ", ".join(r.why or f"{r.rate:.3g}" for r in rates)
        yield f"damping in free air at {pose} (N.s/m)", b, says, f"runs {why}"


def _margins(scene: Checked) -> Iterator[Claim]:
    margin, options, haptic = scene.record["margin"], scene.options, float(scene.haptic)
    forces = [" -> ".join(c) for c in scene.connections if c[0].startswith("controller")]

    def scaled(s: float) -> Row:
        by = {"stiffness": s, "damping": s**0.5}
        names = {f"controller.teleoperation.{key}": factor for key, factor in by.items()}
        found: Row = {n: [gain * factor for gain in options[n]] for n, factor in names.items()}
        topology = {"stiffness": 200.0 * s, "damping": 50.0 * s**0.5}
        return found | ({"controller.topology": topology} if options["controller.topology"] else {})

    def later(n: float) -> Row:
        given = {str(k): float(v) for k, v in options.get("delays", {}).items()}
        late = {c: given.get(c.partition(" -> ")[0], 0.0) + n / haptic for c in forces}
        return {"delays": given | late if n else given}

    def framed(n: float) -> Row:
        return {"graphics.rate": f"{scene.haptic}/{n:g}"}

    for name, change in (("stiffness", scaled), ("delay", later), ("rate", framed)):
        if (told := margin[name]) is None:
            continue
        inside, outside = 0.9 * told, 1.1 * told or 2.0**-10
        if name != "stiffness":
            inside = round(told * haptic) if name == "delay" else int(haptic / told + 1e-6)
            outside = inside + 1
        open_end = name in margin["not_searched_further"]
        below = _in_hands(scene, change(inside), 2) if inside else (False, "")
        above = (True, "not told") if open_end else _in_hands(scene, change(outside), 9)
        says = "undecided" if None in (below[0], above[0]) else "contradicted"
        if (below[0], above[0]) == (False, True):
            says = "agree"
        why = f"at {inside:.4g}: {below[1]}; at {outside:.4g}: {above[1]}"
        if name == "delay" and says == "contradicted" and options["hold"] == "model":
            says, why = "undecided", f"{why}; `model` takes the age of what comes late into account"
        yield f"margin of {name}", told, says, why


def _remedies(scene: Checked) -> Iterator[Claim]:
    """Each by the scene with its options, of which a run is to show the rate that it is told."""
    for remedy in scene.record["remedies"]:
        told, what = remedy["growth"], f"remedy {' '.join(remedy['options'])} (1/s)"
        try:
            given = {".".join(names): value for names, value in map(parse, remedy["options"])}
            there = Checked(scene.base, scene.options | given)
        except (hl.InputFault, hl.Fault) as fault:
            yield what, told, "contradicted", str(fault).splitlines()[0]
            continue
        told_of = [c for c in there.record["cases"] if c["hand"] not in OWN]
        fast = [c for c in told_of if c["verdict"] == "stable" or _rank(c)[0]]
        of, _, says, why = _rate(there, max(fast, key=_rank))
        limit = told + max(CLOSE * abs(told), LEAST) if math.isfinite(told) else SLIGHT
        if (most := max(c["growth_rate"] for c in fast)) > limit:
            says, why = "contradicted", f"with these options {most:.4g} is told"
        yield f"{what}: {of}", told, says, why
