"""Run time against error on mechanisms in the plane and in space: our integrators and four
multibody codes.

Every code starts from the same assembled pose and rates, and takes steps of equal length; only
stepping is timed. Runs are interleaved round by round and the least of the rounds counts. The
tip's error is taken at the end time, against the closed form (N-four-bar) or against two
formulations under DOP853, whose difference is the floor; in space against Pinocchio's terms, and
what a tenth of the accuracy changes is.
"""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import mechanisms
from benchmarks.maximal import Bodies
from benchmarks.mechanisms import bennett, bricard, falling
from benchmarks.our_mechanism import Ours
from benchmarks.page import Progress
from benchmarks.rows import Rows
from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.linkage import Linkage, Mechanism

PEERS = ("mujoco_peer", "pinocchio_peer", "exudyn_peer", "drake_peer")
EVALUATIONS = {
    "dormand-prince-8": 12,
    "rk4": 4,
    "heun": 2,
    "linearly-implicit": 2,
    "semi-implicit-euler": 1,
}
COLUMNS = ("case", "code", "method", "rate", "round", "seconds", "x", "y", "z")
NO_WRENCH = (0.0, 0.0, 0.0)
LOST = 0.1  # m; with a larger error the run has diverged
SLOW = 3.0  # s; a run this long is not repeated
MANY = 40  # bodies with which a step of a loop in Python takes 7 ms and more, and is left out
NATIVE, MACHINE = "ours, C", "ours, CasADi VM"
Run = Callable[[int], tuple[float, ...]]
"""(steps) -> the tip's place (m), x, y and in space z, and the time (s) that they took."""


@dataclass(frozen=True)
class Case:
    name: str
    linkage: Linkage
    end: float
    rates: tuple[int, ...]
    exact: Callable[[], tuple[np.ndarray, float]]
    settings: tuple[tuple[str, str], ...]
    wrench: tuple[float, float, float] = NO_WRENCH


PROJECTED = ("passive-midpoint",)
"""Integrators whose steps hold with projection alone."""
ALL = (
    *((i, s) for i in METHODS if i not in PROJECTED for s in ("none", "baumgarte", "projection")),
    *((i, "projection") for i in PROJECTED),
)
SPATIAL = tuple((i, "projection") for i in METHODS)
FEW = (("semi-implicit-euler", "baumgarte"), ("heun", "projection"), ("rk4", "projection"))


def setting(integrator: str, stabilization: str) -> Mechanism:
    return Mechanism(integrator=integrator, stabilization=stabilization)  # type: ignore[arg-type]


def cases(quick: bool) -> list[Case]:
    def closed_form(N: int) -> Callable[[], tuple[np.ndarray, float]]:
        # The root of the elliptic integral is good to a few units in the last place.
        return lambda: (np.array(mechanisms.n_four_bar_tip(N, 10.0)), 1e-14)

    wrench = (-0.5, 0.0, -0.0025)
    bar = mechanisms.five_bar()
    start = Ours(bar, wrench, Mechanism(), 1 / 512)
    exact = partial(tip, start, 3.0)
    rates: tuple[int, ...] = (128, 512, 2048) if quick else (128, 256, 512, 1024, 2048, 4096)
    found = [Case("five-bar, 3 s", bar, 3.0, rates, exact, ALL, wrench)]
    for N, rates, settings in (
        (2, (250, 1000) if quick else (125, 250, 500, 1000, 2000, 4000), ALL),
        *([] if quick else [(40, (250, 500, 1000), FEW)]),
    ):
        name, linkage = f"N-four-bar, N = {N}, 10 s", mechanisms.n_four_bar(N)
        found.append(Case(name, linkage, 10.0, rates, closed_form(N), settings))
    start = Ours(bricard(), NO_WRENCH, Mechanism(), 1 / 512)
    for name, linkage, end, exact in (
        ("Bricard", start.linkage, 4.0, partial(tip_in_space, start, 4.0)),
        ("Bennett", falling(bennett()), 2.0, partial(tip_of_bennett, 2.0)),
    ):
        rates = (250, 1000) if quick else (125, 250, 500, 1000, 2000, 4000)
        found.append(Case(f"{name}, in space, {end:.0f} s", linkage, end, rates, exact, SPATIAL))
    return found


def peers(missing: list[str]) -> list:
    """The installed peers; names of the others are added to `missing`."""
    found = []
    for name in PEERS:
        try:
            found.append(importlib.import_module(f"benchmarks.peers.{name}"))
        except ImportError as error:
            missing.append(f"{name.removesuffix('_peer')}: not installed ({error.name})")
    return found


def tasks(
    case: Case, codes: list, folder: Path
) -> Iterator[tuple[str, str, int, Callable[[], Run]]]:
    """(code, method, rate, prepare) of one case."""
    start = Ours(case.linkage, case.wrench, Mechanism(), 1 / 512).start
    q, qd = np.split(start, 2)

    for rate in case.rates:
        for chosen in case.settings:
            ours = Ours(case.linkage, case.wrench, setting(*chosen), 1 / rate)
            yield NATIVE, ", ".join(chosen), rate, partial(ours.native, folder)
            yield MACHINE, ", ".join(chosen), rate, ours.virtual_machine
        for peer in codes:
            for method in peer.METHODS:
                if "Python loop" not in method or len(case.linkage.body) < MANY:
                    arguments = case.linkage, np.array(case.wrench), q, qd, method, 1 / rate
                    yield peer.NAME, method, rate, partial(peer.prepare, *arguments)


def measure(out: Path, quick: bool, progress: Progress) -> tuple[dict[str, list[dict]], list[str]]:
    """Run the cases that runs.csv lacks; returns the aggregated rows by case and the codes that are
    not installed."""
    rows = Rows(out / "runs.csv", COLUMNS, keys=5)
    missing: list[str] = []
    codes, found = peers(missing), {}
    for case in cases(quick):
        listed = list(tasks(case, codes, out / ".compiled"))
        prepared: dict[tuple, Run] = {}
        rounds = 2 if quick else 5
        for number in range(rounds):
            for k, (code, method, rate, prepare) in enumerate(listed):
                progress(
                    f"{case.name}: {code}, {method}", number * len(listed) + k, rounds * len(listed)
                )
                key = (case.name, code, method, rate)
                first = rows.rows.get(tuple(map(str, (*key, 0))))
                if (*key, number) in rows or (first and float(first["seconds"]) > SLOW):
                    continue
                run = prepared.get(key) or prepared.setdefault(key, prepare())
                *place, seconds = run(round(case.end * rate))
                rows.add(*key, number, float(seconds), *map(float, _in_space(place)))
        exact, floor = _exact(case, out)
        found[case.name] = _aggregate(rows, case, exact, floor)
    return found, missing


def _exact(case: Case, out: Path) -> tuple[np.ndarray, float]:
    """The reference tip and its floor, kept in references.json."""
    path = out / "references.json"
    kept = json.loads(path.read_text()) if path.exists() else {}
    if case.name not in kept:
        exact, floor = case.exact()
        kept[case.name] = [*map(float, exact), floor]
        path.write_text(json.dumps(kept, indent=1))
    *known, floor = kept[case.name]
    return np.array(known), floor


def _in_space(place: Sequence[float] | np.ndarray) -> tuple[float, ...]:
    """A place with its z, which is 0 in the plane."""
    return (*place, 0.0)[:3]


def _aggregate(rows: Rows, case: Case, exact: np.ndarray, floor: float) -> list[dict]:
    groups: dict[tuple[str, str, int], list[dict[str, str]]] = {}
    for row in rows.rows.values():
        if row["case"] == case.name:
            groups.setdefault((row["code"], row["method"], int(row["rate"])), []).append(row)
    found = []
    for (code, method, rate), runs in groups.items():
        error = math.dist([float(runs[0][axis]) for axis in "xyz"], _in_space(exact))
        least = min(float(r["seconds"]) for r in runs)
        found.append(
            {
                "code": code,
                "method": method,
                "rate": rate,
                "evaluations": EVALUATIONS.get(method.split(",")[0], "") if "ours" in code else "",
                "us_per_step": least / (case.end * rate) * 1e6,
                "ms_per_s": least / case.end * 1e3,
                "error": error,
                "floor": floor,
                "rounds": len(runs),
            }
        )
    return found


def advantage(rows: list[dict], peer: str) -> list[tuple[float, float, float]]:
    """(error, ms per simulated s, its ratio to ours at this error or less) of each Pareto-optimal
    row of the peer; nan if none of ours is as accurate. Ours are taken for no more accurate than
    ten times the floor of the reference."""
    mine = [r for r in rows if r["code"] == NATIVE]
    # Bare calls of the same RK4 have no error of their own: ours with projection stands in.
    stand_in = {
        r["rate"]: r["error"]
        for r in mine
        if r["method"] == "rk4, projection" and r["error"] > 10 * r["floor"]
    }
    theirs = [
        r | {"error": stand_in.get(r["rate"], math.nan)} if "calls" in r["method"] else r
        for r in rows
        if r["code"] == peer
    ]
    theirs = [r for r in theirs if r["error"] < LOST]
    found = []
    for row in theirs:
        if any(o["error"] <= row["error"] and o["ms_per_s"] < row["ms_per_s"] for o in theirs):
            continue
        as_good = [r["ms_per_s"] for r in mine if max(r["error"], 10 * r["floor"]) <= row["error"]]
        ratio = row["ms_per_s"] / min(as_good) if as_good else math.nan
        found.append((row["error"], row["ms_per_s"], ratio))
    return found


def tip_of_bennett(end: float) -> tuple[np.ndarray, float]:
    """(x, y, z) of the point of `falling(bennett())` at `end` (s), and by how much it differs with
    a tenth of the accuracy: the loop has one motion, q(theta) in closed form (mechanisms.py), whose
    acceleration q' (D (q' theta'' + q'' theta'^2) + C q' theta' + g) = 0 has Pinocchio's terms."""
    from benchmarks.peers.pinocchio_peer import Terms

    terms = Terms(falling(bennett()))

    def f(_: float, x: np.ndarray) -> np.ndarray:
        q, slope, bend = mechanisms.bennett_motion(float(x[0]))
        at = terms.at(q, slope * x[1])
        pulls = at["nle"] + at["D"] @ bend * x[1] ** 2
        return np.array([x[1], -(slope @ pulls) / (slope @ at["D"] @ slope)])

    start = mechanisms.BENNETT_START, 0.0
    found = []
    for accuracy in (1, 10):
        tolerance = TOLERANCE | {"rtol": 1e-13 * accuracy}
        theta = solve_ivp(f, (0, end), start, **tolerance).y[0, -1]
        found.append(terms.at(mechanisms.bennett_motion(float(theta))[0], np.zeros(3))["x_h"])
    return found[0], float(np.linalg.norm(found[0] - found[1]))


TOLERANCE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}


def tip(ours: Ours, end: float) -> tuple[np.ndarray, float]:
    """(x, y) of the operational point at `end` (s), and the error floor (m), which is by how much
    two formulations differ: the component's own accelerations in joint coordinates, and every body
    in absolute coordinates, with multipliers by least squares."""
    first, second = _relative(ours, end), _maximal(ours, end)
    return second, float(np.linalg.norm(first - second))


def _relative(ours: Ours, end: float) -> np.ndarray:
    n = len(ours.start) // 2

    def f(_: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[n:], ours.outputs(x)["qdd"]]

    last = solve_ivp(f, (0, end), ours.start, **TOLERANCE).y[:, -1]
    return ours.outputs(last)["x"][: ours.linkage.dimension]


def tip_in_space(ours: Ours, end: float) -> tuple[np.ndarray, float]:
    """(x, y, z) of the operational point at `end` (s) by Pinocchio's terms, with multipliers by
    least squares, and by how much it differs with a tenth of the accuracy."""
    from benchmarks.peers.pinocchio_peer import REPEATED, Terms

    terms, n = Terms(ours.linkage), len(ours.start) // 2

    def f(_: float, x: np.ndarray) -> np.ndarray:
        at = terms.at(x[:n], x[n:])
        free = np.linalg.solve(at["D"], np.column_stack([-at["nle"], at["W"].T]))
        pulled, Y = free[:, 0], free[:, 1:]
        multipliers = np.linalg.lstsq(at["W"] @ Y, -at["w"] - at["W"] @ pulled, rcond=REPEATED)[0]
        return np.r_[x[n:], pulled + Y @ multipliers]

    found = []
    for accuracy in (1, 10):
        tolerance = TOLERANCE | {"rtol": 1e-13 * accuracy}
        last = solve_ivp(f, (0, end), ours.start, **tolerance).y[:, -1]
        found.append(terms.at(last[:n], last[n:])["x_h"])
    return found[0], float(np.linalg.norm(found[0] - found[1]))


def _maximal(ours: Ours, end: float) -> np.ndarray:
    bodies = Bodies(ours.linkage)
    joined, n = bodies.mechanism, bodies.mechanism.n
    wrench = np.array(ours.wrench)

    def f(_: float, y: np.ndarray) -> np.ndarray:
        z, zd = y[:n], y[n:]
        G, gamma = joined.closures(z, zd)
        J = joined.point(z, zd, bodies.tip)[1]
        force = bodies.weight.ravel() + J.T @ wrench
        return np.r_[zd, joined.accelerations(G, gamma[:, None], force[:, None])[:, 0]]

    first = np.concatenate(bodies.start(*np.split(ours.start, 2)))
    last = solve_ivp(f, (0, end), first, **TOLERANCE).y[:, -1]
    return joined.point(last[:n], last[n:], bodies.tip)[0][:2]
