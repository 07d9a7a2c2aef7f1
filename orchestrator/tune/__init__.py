"""Gains with which contact and joint constraint feel equally stiff, as stiff as a margin allows.

**Margin.** The stability margin g is the factor on all stiffnesses together, dampings by its root,
at which the linearised map of the co-simulation (stability/) becomes unstable, in the worst of the
poses and hands that are judged. The default of 2 (6 dB) is the least gain margin that textbooks of
control ask for (Astrom, Murray, Feedback Systems, 2008, section 9.3).

**Felt stiffness.** The dynamic stiffness 1/|n' X n| at the handle (held.py), at a frequency of
pressing, by default 2 Hz: of a joint constraint along the wrench that no motion of the mechanism
answers, n in null(S Lambda^-1 S), the stiffest of them; of a contact along its wrench.

**Search.** Each law alone is taken to its limit of stability, which sets the ratios of the laws; a
common factor takes them to the limit together, and by the margin back. Then the law of what feels
stiffer is softened until both feel alike, and the margin is found again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.tune.held import Complex, Held, held
from hapticlink.orchestrator.tune.poses import Pose, poses

MARGIN, HERTZ = 2.0, 2.0
HANDS = (100.0, 1000.0)
"""Stiffnesses (N/m) of the hands that a margin is for: a light touch and a firm grip."""
STRIDE, FAST = 2.0, 20.0
"""Of scales on the way to a limit; growth (1/s) at which no other hand or pose is asked."""
WIDEST = 2.0**20
"""Scale of gains beyond which there is no limit of stability."""
FINE, COARSE = 0.01, 0.1
"""Of the logarithm of a scale."""
RIGID = 1e7
"""Felt stiffness (N/m) above which nothing gives way: the hand's own wrench is cancelled."""
EQUAL = 0.02
"""Difference of felt stiffnesses, relative, that is equal."""
RATES = {"haptics.rate": (0.8, 1.25), "graphics.rate": (0.5, 2.0)}
"""Neighbouring rates, as factors."""
Tell = Callable[[str], object]


@dataclass(frozen=True)
class Tuned:
    """tables: the scene's tables with the gains. scales: of the scene's own gains, by law. margin:
    g of these gains, and `own` that of the scene's. felt: stiffness (N/m) by "constraint" and
    "contact", and `felt_before` that of the scene's own gains. neighbours: margins by a rate's key
    and value. limits: of each law alone. compliances: (3, 3) of the handle in each pose, at
    `hertz`, in a firm grip."""

    title: str
    tables: dict[str, dict[str, Any]]
    scales: dict[str, float]
    margin: float
    own: float
    felt: dict[str, float]
    felt_before: dict[str, float]
    poses: tuple[Pose, ...]
    limits: dict[str, float]
    asked: float
    hertz: float
    compliances: dict[str, Complex]
    neighbours: dict[str, float] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """The content of tune.json."""
        return {
            "title": self.title,
            "gains": self.tables,
            "scales": self.scales,
            "limits_alone": self.limits,
            "margin_asked": self.asked,
            "margin": self.margin,
            "margin_of_scene": self.own,
            "frequency": self.hertz,
            "felt_stiffness": self.felt,
            "felt_stiffness_of_scene": self.felt_before,
            "compliance": {
                name: np.stack([X.real, X.imag], axis=-1).tolist()
                for name, X in self.compliances.items()
            },
            "margins_at_neighbouring_rates": self.neighbours,
            "poses": {pose.name: list(pose.handle) for pose in self.poses},
            "wrenches": {pose.name: list(pose.along) for pose in self.poses},
            "hands": list(HANDS),
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield f"margin {self.margin:.3g}; with the gains of the scene {self.own:.3g}"
        for name, value in self.felt.items():
            yield (
                f"{name} feels like {_stiffness(value)} at {self.hertz:g} Hz; with the gains of "
                f"the scene {_stiffness(self.felt_before[name])}"
            )
        for rate, margin in self.neighbours.items():
            yield f"margin at {rate}: {margin:.3g}" + (" (unstable)" if margin < 1.0 else "")
        yield from (f"--set {_quoted(option)}" for option in self.options)

    @property
    def options(self) -> tuple[str, ...]:
        """The gains as options of a scene, `key=value`."""
        return tuple(
            f"{key}.{name}={overrides.text(value, key)}"
            for key, table in self.tables.items()
            for name, value in table.items()
        )


def tune(
    scene: str | Path,
    options: Options = (),
    *,
    margin: float = MARGIN,
    hertz: float = HERTZ,
    neighbours: bool = True,
    tell: Tell = lambda text: None,
) -> Tuned:
    """The gains of a scene (see the module's text); it is run once to find a contact.

    Raises InputFault for a margin below 1, a scene without a law to tune or a handle, and one that
    is unstable with any gains.
    """
    if not margin >= 1.0:
        raise InputFault(f"--margin {margin}: give 1 or more, the factor up to instability")
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"), ExitStack() as stack:
        given = overrides.written(options)
        read = open_scene.load(scene, given)
        found = poses(scene, given)
        tell(f"poses: {', '.join(pose.name for pose in found)}")
        at = {}
        for pose in found:
            at[pose.name] = stack.enter_context(held(open_scene.load(scene, pose.options(given))))
        search = Search(at, {pose.name: pose.along for pose in found}, hertz)
        own, before = search.common({}), search.felt({})
        limits = {}
        for law in search.laws:
            limits[law] = search.alone(law)
            tell(f"{law}: unstable alone at {limits[law]:.4g} times the gains of the scene")
        top = search.common(limits)
        scales = {law: limit * top / margin for law, limit in limits.items()}
        softened = search.equal(scales)
        reached = margin if softened == scales else search.common(softened)
        scales = softened
        result = Tuned(
            read.title,
            search.tables(scales),
            scales,
            reached,
            own,
            search.felt(scales),
            before,
            found,
            limits,
            margin,
            hertz,
            search.compliances(scales),
        )
    if neighbours:
        for key, value in _rates(read):
            tell(f"margin at {key} = {value:g}")
            result.neighbours[f"{key}={value:g}"] = margin_of(scene, result, given, {key: value})
    return result


def margin_of(
    scene: str | Path, tuned: Tuned, options: Options = (), further: Mapping[str, Any] | None = None
) -> float:
    """The margin g of tuned gains in a scene changed by `further` options; 0 where it comes to no
    rest."""
    given = overrides.written(options)
    with interrupt.held(), np.errstate(invalid="ignore", over="ignore"), ExitStack() as stack:
        at = {}
        try:
            for pose in tuned.poses:
                changed = (*pose.options(given), *overrides.written(further or {}))
                at[pose.name] = stack.enter_context(held(open_scene.load(scene, changed)))
        except InputFault:
            return 0.0
        return Search(at, {}, tuned.hertz).common(tuned.scales)


def _stiffness(value: float) -> str:
    return f"{value:.4g} N/m" if np.isfinite(value) else "a rigid body"


def _quoted(option: str) -> str:
    return f"'{option}'" if "[" in option else option


def _rates(read: Any) -> list[tuple[str, float]]:
    found = []
    for key, factors in RATES.items():
        part = getattr(read, key.partition(".")[0])
        rate = getattr(part, "rate", None)
        if isinstance(rate, int | float):
            found += [(key, float(round(rate * factor))) for factor in factors]
    return found


class Search:
    """Limits of stability over the poses `at`, and stiffnesses along their wrenches."""

    def __init__(
        self, at: Mapping[str, Held], along: Mapping[str, tuple[float, ...]], hertz: float
    ) -> None:
        self._at, self._along, self._hertz = at, along, hertz
        self.laws = list(dict.fromkeys(law.name for h in at.values() for law in h.gains.laws))
        if not self.laws:
            raise InputFault("no coupling, topology controller or contact: no gains to tune")

    def alone(self, law: str) -> float:
        """The scale at which a law is unstable in a firm grip, the others as in the scene, to a
        tenth: it sets ratios alone."""
        places = [h for h in self._at.values() if any(each.name == law for each in h.gains.laws)]
        pose = places[-1] if law == "contact" else places[0]
        return _limit(lambda s: pose.growth({law: s}, HANDS[-1]), law, COARSE)

    def common(self, scales: Mapping[str, float]) -> float:
        """The factor on all scales at which the scene is unstable in the worst pose and hand."""
        each = {law: scales.get(law, 1.0) for law in self.laws}

        def growth(factor: float) -> float:
            tried = {law: scale * factor for law, scale in each.items()}
            worst = -np.inf
            for hand in HANDS[::-1]:
                for place in self._at.values():
                    if (worst := max(worst, place.growth(tried, hand))) > FAST:
                        return worst
            return worst

        return _limit(growth, "all gains", FINE)

    def compliances(self, scales: Mapping[str, float]) -> dict[str, Complex]:
        """The compliance (3, 3) at the handle in each pose."""
        return {
            name: place.compliance(scales, HANDS[-1], self._hertz)
            for name, place in self._at.items()
        }

    def felt(self, scales: Mapping[str, float]) -> dict[str, float]:
        """The felt stiffness (N/m) in each pose; infinite where nothing gives way."""
        found = {}
        for name, X in self.compliances(scales).items():
            n = np.array(self._along[name])
            given_way = float(abs(n @ X @ n))
            found[name] = np.inf if given_way < 1.0 / RIGID else 1.0 / given_way
        return found

    def equal(self, scales: Mapping[str, float]) -> dict[str, float]:
        """`scales` with the law of what feels stiffer softened until both feel alike; as they are
        where that law does not make the difference."""
        felt = self.felt(scales)
        if len(felt) < 2 or not np.isfinite([*felt.values()]).all():
            return dict(scales)
        stiff = max(felt, key=lambda name: felt[name])
        soft = min(felt, key=lambda name: felt[name])
        law = {"constraint": "topology", "contact": "contact"}[stiff]
        if law not in scales or felt[stiff] <= felt[soft] * (1 + EQUAL):
            return dict(scales)

        def apart(logarithm: float) -> float:
            tried = self.felt({**scales, law: float(np.exp(logarithm))})
            return float(np.log(tried[stiff] / tried[soft]))

        top = float(np.log(scales[law]))
        bottom = top - 10.0
        if apart(bottom) > 0.0:
            return dict(scales)
        return {**scales, law: float(np.exp(brentq(apart, bottom, top, xtol=FINE)))}

    def tables(self, scales: Mapping[str, float]) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for place in self._at.values():
            found |= place.gains.tables(scales)
        return found


def _limit(growth: Callable[[float], float], what: str, fine: float) -> float:
    """The least scale found at which `growth` (1/s) of a scale crosses 0, its logarithm to `fine`;
    WIDEST where there is none."""
    low = high = 1.0
    if growth(1.0) > 0.0:
        while growth(low := low / STRIDE) > 0.0:
            if low < 1.0 / WIDEST:
                raise InputFault(f"{what}: unstable however low the gains are")
        high = low * STRIDE
    else:
        while growth(high := high * STRIDE) <= 0.0:
            if high > WIDEST:
                return WIDEST
        low = high / STRIDE
    found = brentq(lambda s: growth(float(np.exp(s))), np.log(low), np.log(high), xtol=fine)
    return float(np.exp(found))
