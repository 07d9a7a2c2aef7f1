"""The printed numbers of a verdict, each with what runs say of it: agree, contradicted, or
undecided and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

import hapticlink as hl
from studies.said.fit import Fitted, fitted

NUDGE = np.array([1.0, -0.7, 5.0])
"""Of the hand, in the sense of its three directions (m, m, rad)."""
LONGEST = 40.0
CLOSE, APART, SLIGHT = 0.03, 0.06, 0.01
"""Differences of growth rates, relative and (1/s) absolute, up to which they agree, and from which
on they contradict; what grows by less than the last one is marginal."""
HANDS = 1, 3
"""In how many both sides of a margin are run, that of the worst case first."""
Row = dict[str, Any]


class Checked:
    """A scene with its verdict."""

    def __init__(self, base: str, options: Mapping[str, Any]) -> None:
        self.base, self.options = base, dict(options)
        self.varies = isinstance(self.options["graphics.rate"], Mapping)
        told = (hl.equilibrium_stability if self.varies else hl.stability)(base, self.options)
        self.record, self.finding = told.record(), getattr(told, "finding", told.verdict)
        scene = hl.scene(base, self.options)
        self.haptic = Fraction(str(scene.haptics.rate))
        if self.varies:
            return
        self.graphics = Fraction(str(scene.graphics.rate)) if scene.graphics else self.haptic

    def pose(self, name: str) -> Mapping[str, Any]:
        def named(p: Mapping[str, Any]) -> str:
            touches = any(p["press"]) and not p["title"]
            return p["title"] or f"{p['time']:.3g} s" + (" (in contact)" if touches else "")

        found = next(p for p in self.record["poses"] if named(p) == name)
        return self.record["equilibria"].get(name, found)

    def options_in(self, pose: Mapping[str, Any], hand: str, nudge: float) -> dict[str, Any]:
        """The options of a run that begins in a pose and a hand, which is nudged."""
        options = {
            k: v for k, v in self.options.items() if not k.startswith("hand.") and k != "hand"
        }
        spec = self.record["hands"][hand]
        at = pose.get("handle") or pose["point"]
        options |= {"hand": _hand(spec, at, pose["press"], nudge), "stop_when": ""}
        for user, place in pose["others"].items():
            options[f"hands.{user}"] = _hand(spec, place, (0.0, 0.0, 0.0), -0.6 * nudge)
        return options | {"linkage.start": pose["joints"], "linkage.start_velocity": {}}

    def run(
        self, pose: str, hand: str, told: float, changes: Mapping[str, Any] | None = None
    ) -> tuple[Fitted, Any]:
        """The growth rate of a run in a pose and a hand; `told` is how long it has to be."""
        step = self._step(told, changes or {})
        nudge = 1e-9 if told > 0.0 else 1e-5
        seconds = math.log(1e12 if told > 0.0 else 1e6) / max(abs(told), 1e-3)
        seconds = min(LONGEST, max(seconds, 24 * step, 0.25))
        options = self.options_in(self.pose(pose), hand, nudge) | dict(changes or {})
        try:
            run = hl.run(self.base, options | {"duration": seconds}, figures=False)
        except hl.InputFault as fault:
            return Fitted(why=str(fault).splitlines()[0]), None
        return fitted(run, step), run

    def apart(self, name: str) -> bool:
        """Whether the handle rests beside the operational point, where no run can begin."""
        pose = self.pose(name)
        return bool(
            np.abs(np.subtract(pose.get("handle") or pose["point"], pose["point"])).max() > 1e-6
        )

    def own_run(self) -> tuple[Fitted, Any]:
        """The growth rate of the scene's own run, next to where it rests."""
        run = hl.run(self.base, self.options | {"duration": 2.2 * LONGEST}, figures=False)
        return fitted(run, self._step(-1.0, {})), run

    def _step(self, told: float, changes: Mapping[str, Any]) -> float:
        """The hyperperiod, or in fast growth a frame or a tick."""
        fast = Fraction(str(changes.get("haptics.rate", self.haptic)))
        slow = Fraction(str(changes.get("graphics.rate", self.graphics)))
        whole = 1 / Fraction(
            math.gcd(fast.numerator * slow.denominator, slow.numerator * fast.denominator),
            fast.denominator * slow.denominator,
        )
        for step in (whole, 1 / slow, 1 / fast):
            if told * float(step) < 1.0:
                return float(step)
        return float(1 / fast)


def _hand(spec: Mapping[str, Any], at: Any, press: Any, nudge: float) -> dict[str, Any]:
    """The [hand] table that stands still at a pose and presses."""
    table = {
        k: v for k, v in spec.items() if v is not None and k not in ("interpolation", "timing")
    }
    F = np.array(press)
    if table["type"] in ("constant", "profile"):
        off = F + nudge * 100.0 * np.array([1.0, -0.7, 0.01])
        rows = [[0.0, *off.tolist()], [0.05, *F.tolist()]]
        kept = {"damping": table["damping"]} if table.get("damping") else {}
        return {"type": "profile", "table": rows, "interpolation": "hold", **kept}
    compliance = np.zeros(3)
    for key in ("stiffness", "grip_stiffness"):
        if key in table:
            k = np.array(table[key])
            compliance += np.divide(1.0, k, out=np.zeros(3), where=k > 0)
    target = np.array(at) + F * compliance + nudge * NUDGE
    return table | {"target": [[0.0, *target.tolist()]]}


def compare(told: float, hertz: float, run: Fitted) -> tuple[str, str]:
    """agree, contradicted or undecided, and why."""
    if run.why:
        return "undecided", run.why
    off, size = abs(run.growth - told), max(abs(told), abs(run.growth))
    if run.spread > max(0.3 * off, CLOSE * size, 0.004) or not np.isfinite(run.spread):
        return "undecided", f"windows differ: {run.growth:.4g} +- {run.spread:.2g}"
    if off <= max(CLOSE * size, 0.004, 2 * run.spread):
        if hertz and not np.isnan(run.turn):
            turn = 2 * np.pi * hertz * run.step
            apart = abs((turn - run.turn + np.pi) % (2 * np.pi) - np.pi)
            other = abs((turn + run.turn + np.pi) % (2 * np.pi) - np.pi)
            if min(apart, other) > 0.15 and min(apart, other) > 0.1 * turn:
                return "contradicted", f"run turns by {run.turn:.3g} a step, told {turn:.3g}"
        return "agree", f"{run.growth:.4g}"
    verdict = "contradicted" if off > max(APART * size, SLIGHT, 3 * run.spread) else "undecided"
    return verdict, f"run {run.growth:.4g} +- {run.spread:.2g}"


def claims(scene: Checked) -> Iterator[Row]:
    """All printed numbers, with what runs say of them."""
    record = scene.record
    if scene.varies:
        yield _exponent(scene)
        return
    for hand in record["hands"]:
        of = [c for c in record["cases"] if c["hand"] == hand]
        if of:
            yield from _hand_row(scene, max(of, key=lambda c: _rank(c)))
    beside = scene.apart(record["worst"]["pose"]) and record["worst"]["neutral"]
    for claim in (*_margins(scene), *_remedies(scene)):
        if beside and claim["says"] == "contradicted":
            claim |= {
                "says": "undecided",
                "why": f"runs begin beside the equilibrium; {claim['why']}",
            }
        yield claim


def _exponent(scene: Checked) -> Row:
    """The Lyapunov exponent of a rate that varies, by the slope of the logarithm of what moves."""
    told, wide = scene.record["lyapunov_exponent"], 3 * scene.record["confidence"]
    row = {"what": "Lyapunov exponent", "told": told}
    run = hl.run(scene.base, scene.options | {"duration": LONGEST}, figures=False)
    d = np.linalg.norm(np.diff(run["haptic_device.x_true"], axis=0), axis=1)
    n = int(scene.haptic)
    size = np.array([d[i : i + n].max() for i in range(0, len(d) - n, n)])
    moving = np.flatnonzero((size < 1e-6) & (size > 1e-13))
    if len(moving) < 5:
        return row | {
            "says": "undecided",
            "why": "less than 5 s between rounding and large motions",
        }
    slope = float(np.polyfit(moving, np.log(size[moving]), 1)[0])
    off = abs(slope - told)
    says = "agree" if off < max(wide, 0.1 * abs(told)) else "undecided"
    if off > max(3 * wide, 0.3 * abs(told)):
        says = "contradicted"
    return row | {"says": says, "why": f"run {slope:.4g}"}


def _rank(case: Mapping[str, Any]) -> tuple[bool, bool, bool, float]:
    grows = case["verdict"] == "unstable"
    return (
        grows and case["kind"] != "drift",
        grows,
        case["verdict"] == "marginal",
        case["growth_rate"],
    )


def _hand_row(scene: Checked, case: Mapping[str, Any]) -> Iterator[Row]:
    told, about = case["growth_rate"], f"{case['hand']} at {case['pose']}"
    if abs(told) * LONGEST < 1.2 or case["saturated"]:
        why = "motors at their limit" if case["saturated"] else "slower than a run of 40 s tells"
        yield {"what": about, "told": told, "says": "undecided", "why": why}
        return
    pose, kind = scene.pose(case["pose"]), scene.record["hands"][case["hand"]]["type"]
    if scene.apart(case["pose"]) and kind == "constant" and "rests there" in pose["found"]:
        run, _ = scene.own_run()
    else:
        run, _ = scene.run(case["pose"], case["hand"], told)
    says, why = compare(told, case["frequency"], run)
    if says == "contradicted" and scene.apart(case["pose"]) and (case["neutral"] or told > 0.0):
        says, why = "undecided", f"no run begins at this equilibrium; one beside it: {why}"
    yield {"what": about, "told": told, "says": says, "why": why}


def _grows(run: Fitted, ended: Any) -> bool | None:
    """Whether more than a drift grows; None where that is not clean."""
    if ended is None:
        return None
    if ended.fault:
        return True
    if run.why or run.spread > max(0.2 * abs(run.growth), 0.02):
        d = np.abs(np.diff(ended["haptic_device.x_true"], axis=0)).max(axis=1)
        early, late = d[: len(d) // 10].max(), d[-len(d) // 10 :].max()
        return True if late > max(1e-7, 3 * early) else None
    slow = abs(run.turn) / (2 * np.pi * run.step) < 1.0 and run.growth < 0.2
    return run.growth > SLIGHT and not slow


def _in_hands(scene: Checked, changes: Mapping[str, Any], most: int) -> tuple[bool | None, str]:
    """Whether something grows in the worst pose in some of at most so many hands with changes."""
    worst, clean = scene.record["worst"], True
    names = [h for h in scene.record["hands"] if h not in ("free", "the scene's own damper")]
    names.sort(key=lambda h: h != worst["hand"])
    for hand in names[:most]:
        run, ended = scene.run(worst["pose"], hand, -2.7, changes)
        grows = _grows(run, ended)
        if grows:
            return True, f"{hand} grows at {run.growth:.3g}"
        clean = clean and grows is False
    return (False, "none grows") if clean else (None, "not clean in some hand")


def _margins(scene: Checked) -> Iterator[Row]:
    margin, options = scene.record["margin"], scene.options
    reads = [
        c
        for c in hl.run(scene.base, options | {"duration": 0.05}, figures=False).run["connections"]
        if c.partition(" -> ")[2].startswith("controller")
    ]

    def scaled(s: float) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, by in (("stiffness", s), ("damping", s**0.5)):
            gains = options[f"controller.teleoperation.{key}"]
            found[f"controller.teleoperation.{key}"] = [gain * by for gain in gains]
        if options["controller.topology"]:
            found["controller.topology"] = {"stiffness": 200.0 * s, "damping": 50.0 * s**0.5}
        return found

    def later(n: int) -> dict[str, Any]:
        given = {str(k): float(v) for k, v in options.get("delays", {}).items()}
        late = {c: given.get(c.partition(" -> ")[0], 0.0) + n / float(scene.haptic) for c in reads}
        return {"delays": given | late if n else given}

    def framed(n: int) -> dict[str, Any]:
        return {"graphics.rate": f"{scene.haptic}/{n}"}

    for name, change in (("stiffness", scaled), ("delay", later), ("rate", framed)):
        if (value := margin[name]) is None or not math.isfinite(value):
            continue
        open_end = name in margin["not_searched_further"]
        if name == "stiffness":
            inside, outside = 0.9 * value, 1.1 * value
        else:
            n = (
                round(value * float(scene.haptic))
                if name == "delay"
                else math.floor(float(scene.haptic) / value + 1e-6)
            )
            inside, outside = n, n + 1
        below, why = _in_hands(scene, change(inside), HANDS[0]) if inside else (False, "")
        above, how = (True, "") if open_end else _in_hands(scene, change(outside), HANDS[1])
        says = (
            "agree"
            if (below, above) == (False, True)
            else "undecided"
            if None in (below, above)
            else "contradicted"
        )
        yield {
            "what": f"margin of {name}",
            "told": value,
            "says": says,
            "why": f"inside {inside:g}: {why}; outside {outside:g}: {how}",
        }


def _remedies(scene: Checked) -> Iterator[Row]:
    worst = scene.record["worst"]
    for remedy in scene.record["remedies"]:
        pairs = (option.split("=", 1) for option in remedy["options"])
        values = {key: _value(value) for key, value in pairs}
        told = remedy["growth"]
        fast = told if math.isfinite(told) else -0.3
        run, ended = scene.run(worst["pose"], worst["hand"], fast, values)
        if told > 0.0 or not run.why:
            bad = (
                run.growth > told + max(APART * abs(told), SLIGHT)
                if math.isfinite(told)
                else _grows(run, ended)
            )
            says = "contradicted" if (ended.fault and told < 0) or bad else "agree"
        else:
            says = "contradicted" if ended and ended.fault else "undecided"
        yield {
            "what": f"remedy {' '.join(remedy['options'])}",
            "told": told,
            "says": says,
            "why": run.why or f"run {run.growth:.4g}",
        }


def _value(text: str) -> Any:
    import tomllib

    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text
