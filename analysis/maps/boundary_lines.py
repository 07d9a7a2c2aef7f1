"""Lines of a map: the points along one key, and where the verdict changes between neighbours."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

from scipy.optimize import brentq

from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.analysis.sweep.grid import Axis, Point
from hapticlink.analysis.sweep.job import Job, job
from hapticlink.analysis.sweep.row import DONE, REFUSED, Row
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.scene.scene import Scene

FINE = 2e-4
"""Of a value at the boundary, relative."""


@dataclass(frozen=True)
class Line(Job):
    """A job that judges the scene at `values` of the key `along`, and follows the pairs `edges` of
    values, between which the verdict changes, to the boundary."""

    along: str = ""
    values: tuple[str, ...] = ()
    edges: tuple[tuple[str, str], ...] = ()


def along(
    scene: str | Path | Scene,
    options: Sequence[str],
    panel: Point,
    axis: Axis,
    other: Axis | None,
) -> Iterator[Line]:
    """The lines along `axis`, one for each value of the `other` one."""
    for value in other.values if other else ("",):
        point = {**panel, **({other.key: value} if other else {})}
        yield line(scene, options, point, axis.key, axis.values)


def across(
    scene: str | Path | Scene, options: Sequence[str], rows: Sequence[Row], x: Axis, y: Axis
) -> list[Line]:
    """The lines along x with the pairs of neighbours whose verdicts differ in `rows`."""
    if not refined(x.key):
        return []
    known = {}
    for row in rows:
        if row.get("at") == "grid":
            panel = tuple((k, row[k]) for k in row if k not in (x.key, y.key) and k in _keys(row))
            known[panel, row[y.key], row[x.key]] = row["verdict"]
    found = []
    for panel, value in dict.fromkeys((panel, value) for panel, value, _ in known):
        edges = tuple(
            pair
            for pair in pairwise(x.values)
            if {known.get((panel, value, at)) for at in pair} == {"stable", "unstable"}
        )
        if edges:
            point = {**dict(panel), y.key: value}
            found.append(line(scene, options, point, x.key, edges=edges))
    return found


def _keys(row: Row) -> set[str]:
    return set(row) - set(COLUMNS)


def line(
    scene: str | Path | Scene,
    options: Sequence[str],
    point: Mapping[str, str],
    key: str = "",
    values: tuple[str, ...] = (),
    edges: tuple[tuple[str, str], ...] = (),
) -> Line:
    """The line of a scene at a point. Raises InputFault where it is refused there."""
    made = job(scene, [*options, *(f"{k}={v}" for k, v in point.items())], point)
    if made.scene is None:
        raise InputFault(made.refusal)
    own = sha256(repr((made.key, key, values, edges)).encode()).hexdigest()
    return Line(point, made.scene, own, "", made.plugins, key, values, edges)


def refined(key: str) -> bool:
    """Whether the boundary is followed along a key. A rate is scanned only: with rates that do not
    divide, the period in which all repeats has no bound, and stability is not monotone in it."""
    return key.rpartition(".")[2] != "rate"


COLUMNS = ("at", "along", "verdict", "spectral_radius", "uncertainty", "growth_rate", "message")


def judged(session: SceneVariants, at: str, options: Sequence[str]) -> Row:
    """The columns of a point of the kind `at`. A variant without a verdict, such as one that
    diverges at its start, is "refused", with the reason."""
    try:
        found = session.judge(options)
    except (InputFault, FmuFault) as fault:
        return {"at": at, "verdict": REFUSED, "message": " ".join(str(fault).split())}
    return {
        "at": at,
        "verdict": found.verdict,
        "spectral_radius": found.radius,
        "uncertainty": found.uncertainty,
        "growth_rate": found.growth,
    }


@one_blas_thread()
def judge(each: Line, _: Path) -> Row:
    """The row of a line, with those of its points."""
    assert each.scene is not None
    rows: list[Row] = []
    with SceneVariants(each.scene) as session:

        def at(value: str, where: str) -> Row:
            found = judged(session, where, [f"{each.along}={value}"])
            return {each.along: value, "along": each.along, **found}

        rows += [at(value, "grid") for value in each.values]
        edges = list(each.edges)
        if refined(each.along):
            edges += [
                (low[each.along], high[each.along])
                for low, high in pairwise(rows)
                if {low["verdict"], high["verdict"]} == {"stable", "unstable"}
            ]
        for low, high in edges:
            rows += _boundary(at, low, high)
    return {"end": DONE, "rows": rows}


def _boundary(at: Callable[[str, str], Row], low: str, high: str) -> list[Row]:
    """The row of the point between two values at which the radius is 1, if there is one."""

    def growth(value: float) -> float:
        row = at(f"{value:.8g}", "boundary")
        if "growth_rate" not in row:
            raise _Lost
        return float(row["growth_rate"])

    a, b = float(low), float(high)
    fine = FINE * max(abs(a), abs(b)) * 0.5
    try:
        found = brentq(growth, a, b, xtol=fine, rtol=FINE)
    except (_Lost, ValueError):  # no verdict on the way, or a jump across 1
        return []
    return [at(f"{found:.6g}", "boundary")]


class _Lost(Exception):
    """A variant on the way to the boundary has no verdict."""
