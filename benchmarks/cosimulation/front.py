"""The measured points with their intervals, and the Pareto front among them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

from benchmarks.cosimulation.measure import APART, SETTINGS
from benchmarks.cosimulation.points import NONE, Point
from benchmarks.rows import Rows, quartiles

REFUSED = "refused"
WORTH = 0.02


@dataclass(frozen=True)
class Measured:
    """A point; run times (s) of its rounds, and its errors (mm): the largest in the first second
    and over the run, the RMS over the run. Of an unstable run they go to its end."""

    point: Point
    times: tuple[float, ...]
    first: float
    most: float
    rms: float
    end: str

    @property
    def unstable(self) -> bool:
        """Whether the run ended early, or the handle left the reference by a link's length."""
        return self.end != "duration" or not self.most < APART

    @property
    def time(self) -> tuple[float, float, float]:
        """Quartiles of the run time (s)."""
        return quartiles(self.times)

    @property
    def kind(self) -> str:
        """The choice for which a figure has a colour."""
        point = self.point
        if point.model == "held":
            return "local model"
        if point.scheme not in ("gauss-seidel", "gauss-seidel-plants"):
            return point.scheme
        if point.frames == NONE:
            return "nothing held"
        return "held, zoh" if point.hold == "zoh" else "held, other holds"


def measured(rows: Rows, scene: str) -> list[Measured]:
    """The points of a scene, without those that were refused."""
    groups: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for key, row in rows.rows.items():
        if row["scene"] == scene and row["end"] != REFUSED:
            groups.setdefault(key[:-1], []).append(row)
    return [_measured(key, of) for key, of in groups.items()]


def _measured(key: Sequence[str], of: Sequence[dict[str, str]]) -> Measured:
    kinds = {name: type(default) for name, default in asdict(Point()).items()}
    settings = {n: kinds[n](v) for n, v in zip(SETTINGS, key, strict=True)}
    first, most, rms = (float(of[0][name]) for name in ("first_mm", "max_mm", "rms_mm"))
    times = tuple(float(row["run_s"]) for row in of)
    return Measured(Point(**settings), times, first, most, rms, of[0]["end"])


def front(found: Iterable[Measured]) -> list[Measured]:
    """The stable points that no other beats in median run time and in largest error, from the
    fastest on; errors within WORTH of each other count as equal."""
    kept: list[Measured] = []
    for each in sorted((m for m in found if not m.unstable), key=lambda m: (m.time[1], m.most)):
        if not kept or each.most < (1 - WORTH) * kept[-1].most:
            kept.append(each)
    return kept
