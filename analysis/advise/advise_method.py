"""Which hold and gains suit a scene: all are run on it, and the best few on draws around it.

A method is a hold of all connections across rates with gains of the virtual coupling. It is within
the limits of a draw if its run is (`search/acceptance.py`). A round runs the ROUND next best
of the scene itself on all draws, until one is within the limits of each; with several, the one with
the smallest median of log(error/mean of the draw) is advised, and those whose error is not larger
in more than three quarters of the draws are within the spread.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.advise.draws import draws
from hapticlink.analysis.advise.method import Measured, Method, measured
from hapticlink.analysis.advise.refine_gains import Draws, Refined, refine
from hapticlink.analysis.search.acceptance import PEAK, WORK, AcceptanceLimits, judged_numbers
from hapticlink.analysis.search.search import judge_best_first
from hapticlink.analysis.search.settings import EARLY, HOLDS
from hapticlink.analysis.sweep.job import job
from hapticlink.analysis.sweep.pool import keep_processes
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.analysis.sweep.run_sweep import Means, sweep
from hapticlink.components.specs.device import Observer
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene.overrides import as_command_line
from hapticlink.orchestrator.scene.scene import Scene

ALIKE = 1.1
"""Ratio of tracking errors up to which it does not matter which hold is taken."""
ROUND = 8
"""Methods of a round."""
OWN = "own"
"""The gains of the scene."""
OTHER_OBSERVER = "device.observer.law=kalman"
"""Which with encoders changes more than holds do (results/observer)."""


@dataclass(frozen=True)
class Advice:
    """What is advised for a scene; `ties` are within the spread, `others` are the rest of what was
    run on all draws, `screened` are all methods on the scene itself, by `limits`."""

    title: str
    taken: Measured
    ties: tuple[Measured, ...]
    others: tuple[Measured, ...]
    screened: Mapping[Method, Row]
    limits: AcceptanceLimits
    gains: Refined | None = None
    """How those of `taken` were found beside the sets, where there is a virtual coupling."""
    kalman: Measured | None = None
    """`taken` with OTHER_OBSERVER, where the scene has the default observer of encoders."""

    def lines(self) -> Iterator[str]:
        """The result as text."""
        if not self.taken.admitted:
            yield f"nothing keeps the limits in every draw: {self.taken.broken}"
            yield "take a higher rate. What comes nearest:"
        rows = [row for method, row in self.screened.items() if method.gains == OWN]
        own = [row[METRIC] for row in rows if not self.limits.why_not(row)]
        if len(own) == len(rows) > 1 and max(own) <= ALIKE * min(own):
            yield (
                f"the hold matters little here: with the scene's own gains all {len(own)} keep the "
                f"limits and leave {short(min(own))} to {short(max(own))} mm"
            )
        yield f"take {self.taken.line}"
        yield from (f"  {as_command_line(option)}" for option in self.taken.method.options)
        if self.gains:
            yield self.gains.line
        if self.kalman:
            yield f"with {as_command_line(OTHER_OBSERVER)} too: {self.kalman.line}"
        for name, found in (("within the spread", self.ties), ("others", self.others)):
            if found:
                yield f"{name}:"
                yield from (f"  {one.line}" for one in found)

    def record(self) -> dict[str, Any]:
        """The content of advice.json."""
        ran = (self.taken, *self.ties, *self.others)
        return {
            "title": self.title,
            "take": list(self.taken.method.options),
            "within_the_limits": self.taken.admitted,
            "draws": [
                {
                    "method": one.method.name,
                    "within": one.within,
                    "error_mm": one.error_mm.tolist(),
                    "energy": one.energy.tolist(),
                }
                for one in ran
            ],
            "scene": {
                method.name: {key: row.get(key) for key in ("end", METRIC, PEAK, WORK)}
                for method, row in self.screened.items()
            },
        }


@one_blas_thread()
@keep_processes()
def advise(
    scene: str | Path | Scene,
    options: Sequence[str],
    means: Means,
    *,
    count: int = 8,
    seed: int = 0,
) -> Advice:
    """The advice for a scene; a later call with the same folder continues. count: of draws, `seed`
    draws them.

    Raises InputFault for a scene without a device, a controller, a hand or anything that is held.
    """
    read = open_scene.load(scene, options)
    methods = all_methods(read)
    assert read.device is not None  # of a scene with methods
    limits = AcceptanceLimits.of(read.device)
    drawn = list(draws(read, 3 * count, seed))
    around, apart, last = [(), *drawn[:count]], drawn[count : 2 * count], drawn[2 * count :]

    def run(of: Sequence[Method], drawn: Sequence[Sequence[str]]) -> dict[Method, list[Row]]:
        return on_draws(scene, options, of, drawn, means)

    screened = {method: rows[0] for method, rows in run(methods, [()]).items()}

    def rank(method: Method) -> tuple[bool, float]:
        row = screened[method]
        return bool(limits.why_not(row)), float(row.get(METRIC, np.inf))

    def judge(these: Sequence[Method], on: Draws = around) -> list[Measured]:
        return [measured(method, rows, limits) for method, rows in run(these, on).items()]

    ranked = _distinct(sorted(methods, key=rank), screened)
    ran = judge_best_first(ranked, judge, lambda one: one.admitted, ROUND)
    advice = _chosen(read.title, list(ran), screened, limits)
    if read.controller and read.controller.teleoperation:
        gains = refine(read, advice.taken, judge, around, apart, last)
        advice = replace(advice, taken=gains.found, gains=gains)
    if read.sensing == "ideal" or replace(read.device.observer, beside=False) != Observer():
        return advice
    other, taken = (*options, OTHER_OBSERVER), advice.taken.method
    found = on_draws(scene, other, [taken], around, means)
    return replace(advice, kalman=measured(taken, found[taken], limits))


def all_methods(read: Scene) -> list[Method]:
    """The methods of a scene. Raises InputFault where there are none."""
    if not (read.device and read.controller and read.hand and read.linkage):
        raise InputFault(
            "nothing to advise: a [linkage], [device], [controller], [hand] are needed"
        )
    if read.graphics is None:
        raise InputFault("nothing to advise: without [graphics] there is one rate, and no hold")
    gains = (OWN, "soft", "medium") if read.controller.teleoperation else (OWN,)
    at_graphics = read.mechanism_at == "graphics"
    holds = [hold for hold in HOLDS if at_graphics or hold != EARLY]
    return [Method(hold, of) for hold in holds for of in gains]


def on_draws(
    scene: str | Path | Scene,
    options: Sequence[str],
    methods: Sequence[Method],
    drawn: Sequence[Sequence[str]],
    means: Means,
) -> dict[Method, list[Row]]:
    """The rows of methods on a scene with the options of each draw, in the order of the draws."""
    jobs = [
        job(scene, (*options, *draw, *method.options), _point(method, draw))
        for method in methods
        for draw in drawn
    ]
    rows = sweep(jobs, means, _numbers)
    n = len(drawn)
    return {method: rows[i * n : (i + 1) * n] for i, method in enumerate(methods)}


def _point(method: Method, draw: Sequence[str]) -> dict[str, str]:
    return {"method": method.name, "draw": " ".join(draw)}


def _numbers(experiment: Experiment) -> Row:
    return judged_numbers(experiment.results)


def _distinct(ranked: Sequence[Method], rows: Mapping[Method, Row]) -> list[Method]:
    """The methods that ran, one of those with the same result: holds that fit nothing are all
    zoh."""
    found: dict[tuple[float, float], Method] = {}
    for method in ranked:
        row = rows[method]
        if METRIC in row:
            found.setdefault((row[METRIC], row.get("tracking_rms_mm", 0.0)), method)
    if not found:
        raise InputFault(f"no hold runs on the scene: {next(iter(rows.values()))['message']}")
    return list(found.values())


def _chosen(
    title: str, ran: Sequence[Measured], screened: Mapping[Method, Row], limits: AcceptanceLimits
) -> Advice:
    able = [one for one in ran if one.admitted]
    if not able:
        best = max(ran, key=lambda one: (one.within, -float(np.median(one.error_mm))))
        rest = [one for one in ran if one is not best]
        return Advice(title, best, (), tuple(rest), screened, limits)
    logs = [np.log(np.maximum(one.error_mm, 1e-9)) for one in able]
    mean = np.mean(logs, axis=0)
    first, *others = sorted(range(len(able)), key=lambda i: float(np.median(logs[i] - mean)))
    ties = [able[i] for i in others if np.quantile(logs[i] - logs[first], 0.25) <= 0.0]
    rest = [one for one in ran if one is not able[first] and one not in ties]
    return Advice(title, able[first], tuple(ties), tuple(rest), screened, limits)
