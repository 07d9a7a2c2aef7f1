"""Z-width of a scene: the largest value of a key, such as a wall's or a coupling's stiffness, with
which it is stable in its own hand, and with which the user's port is passive, over other keys.

Both are found by doubling or halving from a first value, and by bisection (search/search.py); a
search that ended before a limit is `at least`. A value that has no verdict counts as one that does
not hold; where such a value is next to the limit, that is `at least`, too. Below the limit
everything that was tried holds; an island of another verdict that was stepped over is not seen.
What an analysis is made without is told (frozen_nonlinearities.py): the limits of the hold
`passive` are those of `zoh`.

For a wall whose loop has a closed form, counts of its encoder add the largest stiffness without
limit cycles, 2 (f_c/quantum - B/T) (limit_cycles.py), and the longest cycle between two counts
that they keep up at the first stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hapticlink.analysis.maps import wall_closed_form
from hapticlink.analysis.search.search import Largest, largest_scale
from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.analysis.sweep.grid import Axis, grid
from hapticlink.analysis.sweep.job import Job, jobs
from hapticlink.analysis.sweep.row import DONE, REFUSED, Row
from hapticlink.analysis.sweep.run_sweep import Means, tabulate
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import FmuFault, InputFault
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import text
from hapticlink.orchestrator.scene.scene import Scene

FINE = 1e-3
"""Of the logarithm of a limit."""
STABLE, PASSIVE, QUIET = "stable", "passive", "without_cycles"
LIMIT, AT_LEAST, NONE = "limit", "at least", "none"


def compute_z_width(
    scene: str | Path | Scene,
    options: Sequence[str],
    first: str,
    axes: Sequence[Axis],
    means: Means,
) -> list[Row]:
    """A row for each point of `axes`, also in z-width.csv of the folder: the largest values, as
    that of the first entry of a list, and how they were found. `first` is `key=value`, where the
    search begins; a list is scaled as a whole. Raises InputFault for what is no positive number,
    and Unfinished if it is interrupted, after which the same call continues."""
    key, values = parse(first)
    points = jobs(scene, [*options, f"{key}={text(values, key)}"], grid(axes))
    judge = partial(_judge, key=key, values=values)
    return tabulate(points, means, judge, name="z-width.csv", each_time=True)


def parse(first: str) -> tuple[str, Any]:
    """Key and value of `key=value`. Raises InputFault for what is not a number above 0, or a list
    of numbers that are not negative, the first one above 0."""
    key, separator, _ = first.partition("=")
    value = overrides.parse(first)[1] if separator else None
    entries = value if isinstance(value, list) else [value]
    numbers = [e for e in entries if isinstance(e, int | float) and not isinstance(e, bool)]
    if len(numbers) != len(entries) or min(numbers) < 0 or not numbers[0] > 0:
        raise InputFault(
            f"--largest {first}: give key=value with the value at which the search begins, e.g. "
            "--largest fmu.wall.start.stiffness=1000"
        )
    return key, value


@one_blas_thread()
def _judge(job: Job, _: Path, key: str, values: Any) -> Row:
    """The row of a point."""
    assert job.scene is not None
    many = isinstance(values, list)

    def option(scale: float) -> str:
        scaled = [scale * v for v in values] if many else scale * values
        return f"{key}={text(scaled, key)}"

    unit = float(values[0] if many else values)
    row: Row = {"end": DONE}
    with SceneVariants(job.scene) as session:
        row |= _largest(STABLE, unit, lambda s: session.judge([option(s)]).verdict)
        passive = {True: PASSIVE, False: "not passive"}
        row |= _largest(PASSIVE, unit, lambda s: passive[bool(session.port([option(s)]).passive)])
        if session.removed:
            row["judged_without"] = "; ".join(session.removed)
    wall = wall_closed_form.counted_wall(job.scene)
    if wall and key == wall_closed_form.START.format(wall.name, "stiffness"):
        row |= {f"largest_{QUIET}": wall.counted.quiet, QUIET: LIMIT}
        if cycles := wall.counted.cycles():
            row |= {"cycle_hz": cycles[-1].frequency, "cycle_m": cycles[-1].amplitude}
    return row


def _largest(what: str, unit: float, verdict: Callable[[float], str]) -> Row:
    """The columns of a search for the largest value with the verdict `what`; where none has it,
    those that there were are told."""
    refused: dict[float, str] = {}
    others: dict[str, None] = {}

    def tried(scale: float) -> bool:
        try:
            given = verdict(scale)
        except (InputFault, FmuFault) as fault:
            refused[scale] = " ".join(str(fault).split())
            return False
        if given != what:
            others[given] = None
        return given == what

    found = largest_scale(tried, FINE)
    row: Row = {f"largest_{what}": unit * found.value, what: _kind(found, refused, bool(others))}
    said = []
    if others and not found.value:
        said.append(f"all that was tried is {' or '.join(others)}")
    if refused:
        said.append(f"without a verdict: {next(iter(refused.values()))}")
    return row | ({f"message_{what}": "; ".join(said)} if said else {})


def _kind(found: Largest, refused: dict[float, str], others: bool) -> str:
    """How a search ended that met refusals, and other verdicts than the one that it looks for."""
    if not found.value:
        return NONE if others else REFUSED
    near = any(found.value < scale < found.value * (1 + 2 * FINE) for scale in refused)
    return LIMIT if found.limited and not near else AT_LEAST
