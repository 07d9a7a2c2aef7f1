"""Which hold and gains suit a scene: all are run on it, and the best few on draws around it.

A method is a hold of all connections across rates with gains of the virtual coupling. It is within
the limits of a draw if the run reaches its end with tracking errors below APART and generates at
the user's port no more than is allowed (`findings/user_port.py`). A round runs the ROUND next best
of the scene itself on all draws, until one is within the limits of each; with several, the one with
the smallest median of log(error/mean of the draw) is advised, and those whose error is not larger
in more than three quarters of the draws are within the spread.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.advise.draws import draws
from hapticlink.analysis.findings.user_port import allowed, hand_work
from hapticlink.analysis.sweep import row as sweep_row
from hapticlink.analysis.sweep.job import job
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.analysis.sweep.run_sweep import sweep
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene.scene import Scene

PASSIVE = tuple(f"holds.virtual_mechanism.{w}=passive" for w in ("F_hand", "F_drift"))
SLOPE = (
    'holds."virtual_mechanism.x -> controller.x_S"=foh',
    'holds."virtual_mechanism.v -> controller.v_S"=slope',
)

HOLDS: dict[str, tuple[str, ...]] = {
    "zoh": ("hold=zoh",),
    "foh": ("hold=foh",),
    "foh-derivative": ("hold=foh-derivative",),
    "foh, slope": ("hold=foh", *SLOPE),
    "second-order": ("hold=second-order",),
    "delayed": ("hold=delayed",),
    "zoh, mean": ("hold=zoh", "downsampling=mean"),
    "passive": ("hold=passive",),
    "foh-derivative, passive": ("hold=foh-derivative", *PASSIVE),
    "pspm, passive": ("hold=pspm", *PASSIVE),
}
"""From the simplest on: of equally good ones the first is advised. `a, b`: hold a from slow to
fast, b from fast to slow (`slope`: of the velocity, from slow to fast)."""
GAINS: dict[str, tuple[str, ...]] = {
    name: (f"controller.teleoperation.stiffness={k}", f"controller.teleoperation.damping={b}")
    for name, k, b in (
        ("soft", [25.0, 25.0, 0.01], [5.0, 5.0, 0.002]),
        ("medium", [100.0, 100.0, 0.1], [20.0, 20.0, 0.02]),
        ("stiff", [100.0, 100.0, 0.5], [70.0, 70.0, 0.375]),
    )
}
"""K_pc and B_pc; stiff: those of section B.6; medium: those of the scene closed-loop-direct."""
APART = 42.0, 1.0
"""Tracking errors (mm, the length of a link, and rad) from which on a run counts as unstable."""
PEAK, WORK = "port_peak_J", "hand_work_J"
ALIKE = 1.1
"""Ratio of tracking errors up to which it does not matter which hold is taken."""
ROUND = 8
"""Methods of a round."""
OWN = "own"
"""The gains of the scene."""


@dataclass(frozen=True)
class Method:
    """A hold and gains, by their names in HOLDS and GAINS."""

    hold: str
    gains: str

    @property
    def name(self) -> str:
        return f"{self.hold}; gains: {self.gains}"

    @property
    def options(self) -> tuple[str, ...]:
        """The options that it consists of."""
        return (*HOLDS[self.hold], *GAINS.get(self.gains, ()))


@dataclass(frozen=True, eq=False)
class Measured:
    """A method on the draws, of which `within` keep the limits: largest distances of handle and
    operational point (mm), and energies at the user's port as shares of what is allowed."""

    method: Method
    error_mm: np.ndarray
    energy: np.ndarray
    within: int

    @property
    def admitted(self) -> bool:
        return self.within == len(self.error_mm)

    @property
    def line(self) -> str:
        low, middle, high = np.quantile(self.error_mm, [0.0, 0.5, 1.0])
        return (
            f"{self.method.name}: error {short(middle)} mm ({short(low)} to {short(high)}), energy "
            f"at most {short(100 * float(self.energy.max()))} % of the limit, {self.within} of "
            f"{len(self.error_mm)} draws within the limits"
        )


@dataclass(frozen=True)
class Advice:
    """What is advised for a scene; `ties` are within the spread, `others` are the rest of what was
    run on all draws, and `scene` are the gains and holds of the scene itself."""

    title: str
    taken: Measured
    ties: tuple[Measured, ...]
    others: tuple[Measured, ...]
    screened: Mapping[Method, Row]

    def lines(self) -> Iterator[str]:
        """The result as text."""
        if not self.taken.admitted:
            yield "nothing keeps the limits in every draw; take a higher rate. What comes nearest:"
        own = [row[METRIC] for m, row in self.screened.items() if m.gains == OWN and within(row)]
        if len(own) > 1 and max(own) <= ALIKE * min(own):
            yield (
                f"the hold matters little here: with the scene's own gains all {len(own)} leave "
                f"{short(min(own))} to {short(max(own))} mm"
            )
        yield f"take {self.taken.line}"
        yield from (f"  --set '{option}'" for option in self.taken.method.options)
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


def advise(
    scene: str | Path | Scene,
    options: Sequence[str],
    folder: Path,
    *,
    processes: int = 1,
    count: int = 8,
    seed: int = 0,
    tell: Callable[[int, int], object] = lambda done, of: None,
) -> Advice:
    """The advice for a scene; rows are kept in `folder`, where a later call continues. count: of
    draws, `seed` draws them; tell: numbers of finished and of all runs so far.

    Raises InputFault for a scene without a device, a controller, a hand or anything that is held.
    """
    read = open_scene.load(scene, options)
    methods = all_methods(read)
    around = list(draws(read, count, seed))

    def run(of: Sequence[Method], drawn: Sequence[Sequence[str]]) -> dict[Method, list[Row]]:
        return on_draws(scene, options, of, drawn, folder, processes=processes, tell=tell)

    screened = {method: rows[0] for method, rows in run(methods, [()]).items()}
    ranked = _distinct(sorted(methods, key=lambda m: _rank(screened[m])), screened)
    ran: list[Measured] = []
    while ranked and not any(one.admitted for one in ran):
        these, ranked = ranked[:ROUND], ranked[ROUND:]
        for method, rows in run(these, around).items():
            ran.append(_measured(method, [screened[method], *rows]))
    return _chosen(read.title, ran, screened)


def all_methods(read: Scene) -> list[Method]:
    """The methods of a scene. Raises InputFault where there are none."""
    if not (read.device and read.controller and read.hand and read.linkage):
        raise InputFault(
            "nothing to advise: a [linkage], [device], [controller], [hand] are needed"
        )
    if read.graphics is None:
        raise InputFault("nothing to advise: without [graphics] there is one rate, and no hold")
    gains = (OWN, "soft", "medium") if read.controller.teleoperation else (OWN,)
    return [Method(hold, of) for hold in HOLDS for of in gains]


def on_draws(
    scene: str | Path | Scene,
    options: Sequence[str],
    methods: Sequence[Method],
    drawn: Sequence[Sequence[str]],
    folder: Path,
    *,
    processes: int = 1,
    tell: Callable[[int, int], object] = lambda done, of: None,
) -> dict[Method, list[Row]]:
    """The rows of methods on a scene with the options of each draw, in the order of the draws."""
    jobs = [
        job(scene, (*options, *draw, *method.options), _point(method, draw))
        for method in methods
        for draw in drawn
    ]

    def progress(done: int) -> None:
        tell(done, len(jobs))

    rows = sweep(jobs, folder, processes, tell=progress, measure=measured)
    n = len(drawn)
    return {method: rows[i * n : (i + 1) * n] for i, method in enumerate(methods)}


def _point(method: Method, draw: Sequence[str]) -> dict[str, str]:
    return {"method": method.name, "draw": " ".join(draw)}


def measured(experiment: Experiment) -> Row:
    """The row of a run, with the work of the hand."""
    return sweep_row.measure(experiment) | {WORK: hand_work(experiment.results)}


def energy(row: Row) -> float:
    """The peak of the energy generated at the user's port, relative to what is allowed."""
    return max(0.0, float(row.get(PEAK, 0.0))) / allowed(float(row.get(WORK, 0.0)))


def within(row: Row) -> bool:
    """Whether a run keeps the limits."""
    if row["end"] != "duration" or METRIC not in row:
        return False
    near = row[METRIC] < APART[0] and row["theta_max_rad"] < APART[1]
    return bool(near) and energy(row) <= 1.0


def _rank(row: Row) -> tuple[bool, float]:
    return not within(row), float(row.get(METRIC, np.inf))


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


def _measured(method: Method, rows: Sequence[Row]) -> Measured:
    errors = np.array([float(row.get(METRIC, np.inf)) for row in rows])
    return Measured(method, errors, np.array([energy(row) for row in rows]), sum(map(within, rows)))


def _chosen(title: str, ran: Sequence[Measured], screened: Mapping[Method, Row]) -> Advice:
    able = [one for one in ran if one.admitted]
    if not able:
        best = max(ran, key=lambda one: (one.within, -float(np.median(one.error_mm))))
        return Advice(title, best, (), tuple(o for o in ran if o is not best), screened)
    logs = [np.log(np.maximum(one.error_mm, 1e-9)) for one in able]
    mean = np.mean(logs, axis=0)
    first, *others = sorted(range(len(able)), key=lambda i: float(np.median(logs[i] - mean)))
    ties = [able[i] for i in others if np.quantile(logs[i] - logs[first], 0.25) <= 0.0]
    rest = [one for one in ran if one is not able[first] and one not in ties]
    return Advice(title, able[first], tuple(ties), tuple(rest), screened)
