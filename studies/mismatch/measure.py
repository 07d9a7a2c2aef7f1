"""What the study measures of a run, and at rest.

Tracking: |x_S - x_D| (mm). Coupling: distance of the handle from that of the same blocks run
continuously, with their own Lambda^-1 and nothing held, over the first second, on one grid up to
the first end. Energy: the peak of what the user's port generated beyond what the hand put in,
against the work of the hand on the handle, its absolute values summed. Margin: minus the growth
rate (1/s) of the leading mode of the lifted map.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hapticlink.analysis.maps import run_checks
from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.analysis.sweep import row as sweep_row
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.read_results import Vector
from studies.mismatch.design import CONTINUOUS, FLOOR, REFERENCE

GRID = 64
"""Rate (Hz) of the grid on which paths of the handle are compared; it divides all haptic rates."""
PATH, COUPLING, PEAK, WORK = "handle", "coupling_1s_mm", "port_peak_J", "hand_work_J"
MARGIN, RUN = "margin_1_per_s", "run_verdict"
KICK = 0.05
"""Velocity of the first joint (rad/s) that a run at rest starts with."""
KEPT = ("end", "end_time_s", METRIC, "theta_max_rad", PEAK)
APART = 42.0, 1.0
"""Tracking errors (mm, the length of a link, and rad) from which on a run counts as unstable."""


def of_run(experiment: Experiment) -> Row:
    """The row of a run, with the handle's path."""
    whole = sweep_row.measure(experiment)
    found = {k: whole[k] for k in KEPT if k in whole}
    table = experiment.results.haptics
    handle, force = table["haptic_device.x_true"], table["hand.F"]
    if not len(handle):
        return found
    work = np.abs((force[:-1] * np.diff(handle, axis=0)).sum(axis=1)).sum()
    every = int(experiment.scene.haptics.rate) // GRID
    return found | {WORK: float(work), PATH: handle[: every * GRID + 1 : every, :2].tolist()}


def at_rest(experiment: Experiment) -> Row:
    """The row of a scene at rest: the verdict of its lifted map, with the arm's target at the pose
    where the mechanism was assembled, and that of a run after a small kick."""
    scene = experiment.scene
    assert scene.linkage is not None
    target = f"hand.target={[[0.0, *map(float, _first(experiment))]]}"
    with SceneVariants(scene) as session:
        found = session.judge([target])
    joint = scene.linkage.joint[0].name
    kicked = open_scene.load(scene, [target, f"linkage.start_velocity.{joint}={KICK}"])
    _, run = run_checks.of_run(kicked, found.growth)
    return {"end": "duration", "verdict": found.verdict, MARGIN: -found.growth, RUN: run}


def _first(experiment: Experiment) -> Vector:
    results = experiment.results
    tables = (results.haptics, results.graphics)
    name = "virtual_mechanism.x"
    pose: Vector = next(t[name][0] for t in tables if name in t)
    return pose


def stable(row: Row) -> bool:
    """Whether a run reaches its end with tracking errors below APART."""
    whole = row["end"] == "duration" and METRIC in row
    return whole and row[METRIC] < APART[0] and row["theta_max_rad"] < APART[1]


def draw(row: Row) -> str:
    """The name of the draw of a row, which is the same for all methods."""
    return f"{row['case']}, seed {row['seed']}"


def compared(rows: Sequence[Row]) -> list[Row]:
    """The rows with their coupling errors, without the paths."""
    continuous = {
        (draw(r), r["bias"]): r
        for r in rows
        if r["arrangement"] == CONTINUOUS and r["rate"] == str(REFERENCE)
    }
    found = []
    for r in rows:
        row = {k: v for k, v in r.items() if k not in (PATH, "message", "run_time_s")}
        if PATH in r and PATH in (other := continuous[draw(r), r["bias"]]) and r is not other:
            a, b = (np.array(each[PATH]) for each in (r, other))
            apart = np.linalg.norm(a[: len(b)] - b[: len(a)], axis=1)
            row[COUPLING] = 1e3 * float(apart.max())
        found.append(row)
    return found


def floor(rows: Iterable[Row]) -> list[float]:
    """The coupling errors (mm) of the runs at half the reference's rate: smaller errors cannot be
    distinguished from zero."""
    half = (r for r in rows if r["arrangement"] == CONTINUOUS and r["rate"] == str(FLOOR))
    return [r[COUPLING] for r in half]


def rounded(row: Row) -> Row:
    """A row with four digits, for a table under version control."""
    return {k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in row.items()}
