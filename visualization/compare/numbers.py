"""What runs have come to, in the order in which one asks: what ran, whether it ended well, how well
it did, energies, stability, timing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.forces import all_wrenches, torques
from hapticlink.analysis.findings.tracking import (
    constrained,
    folded,
    further_users,
    has_tracking,
    of_block,
    pose_error,
)
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.loop_names import CLOSURE_ERROR, POINT_POSE
from hapticlink.orchestrator.results.numbers import last_time, short
from hapticlink.orchestrator.results.scene_part import scene_part
from hapticlink.orchestrator.results.tables import Results
from hapticlink.visualization.compare.settings import one_mechanism

NONE = "-"
"""Stands for a number that a run does not have."""


class Row(NamedTuple):
    """What is told, and the values of the runs."""

    label: str
    values: tuple[str, ...]


def sections(runs: Sequence[Results]) -> dict[str, list[Row]]:
    """Rows by the question that they answer. Paths and forces are compared until the first end of
    the runs."""
    until = min(last_time(run) for run in runs)
    several = len({last_time(run) for run in runs}) > 1
    how = f"How well, all until {short(until)} s" if several else "How well"
    asked: dict[str, Callable[[Results], Iterator[tuple[str, str]]]] = {
        "What ran": _ran,
        "Did it end well": _ended,
        how: lambda run: _did(run, until),
        "Energies, of the whole run": _energies,
        "Stability and steps": _stable,
        "Timing": _timing,
    }
    found = {title: _rows([dict(told(run)) for run in runs]) for title, told in asked.items()}
    found[how] += _apart(runs)
    return found


def _rows(told: Sequence[dict[str, str]]) -> list[Row]:
    labels = dict.fromkeys(label for each in told for label in each)
    return [Row(label, tuple(each.get(label, NONE) for each in told)) for label in labels]


def _ran(run: Results) -> Iterator[tuple[str, str]]:
    told = run.run
    yield "scene", told["scene"]["title"]
    yield "options", ", ".join(told["options"]) or "none"
    for name, clock in told["clocks"].items():
        rates = sorted(
            {short(1 / clock[k]) for k in ("shortest", "longest") if clock[k]}, key=float
        )
        yield f"rate of {name}", f"{' to '.join(rates)} Hz"
    yield "coupling", told.get("coupling", NONE)
    for name, hold in told["holds"].items():
        yield f"hold of {name}", hold
    yield "versions", ", ".join(f"{name} {v}" for name, v in told["versions"].items())


def _ended(run: Results) -> Iterator[tuple[str, str]]:
    yield "end", summary.ending(run)
    if fault := run.run.get("fault"):
        yield "fault", fault["message"]
    said = run.run.get("warnings", ())
    warnings = [line for line in said if line.startswith("warning: ")]
    yield "warnings", "; ".join(w.removeprefix("warning: ") for w in warnings) or "none"
    yield "notes", "; ".join(line for line in said if line not in warnings) or "none"


def _did(run: Results, until: float) -> Iterator[tuple[str, str]]:
    for user in ["", *further_users(run)] if has_tracking(run) else ():
        error, of = pose_error(run, user), user and f"{user}: "
        distance = error.distance_mm[kept := error.time_s <= until + 1e-12]
        if len(distance):
            yield f"{of}tracking error, largest (mm)", short(distance.max())
            yield f"{of}tracking error, RMS (mm)", short(float(np.sqrt(np.mean(distance**2))))
            yield f"{of}tracking error, largest angle (rad)", short(error.angle_rad[kept].max())
    for name, (time, force, _) in all_wrenches(run).items():
        if len(acting := force[time <= until + 1e-12]):
            yield f"largest force, {name} (N)", short(acting.max())
    device = scene_part(run, "device", Device)
    if device and (driven := torques(run, device)) and len(driven[0]):
        used = np.abs(driven[1][driven[0] <= until + 1e-12]).max(initial=0.0)
        yield "motors, largest share of their torque (%)", short(100 * used / device.torque_limit)
    if (table := of_block(run, CLOSURE_ERROR)) and len(table["time"]):
        closure = table[CLOSURE_ERROR][table["time"] <= until + 1e-12]
        yield "closure error, largest (m)", f"{closure.max(initial=0.0):.2g}"
    if (counted := constrained(run)) and len(counted[0]["time"]):
        count = counted[0][counted[1]][counted[0]["time"] <= until + 1e-12]
        for number in np.unique(count):
            share = 100 * float((count == number).mean())
            yield f"samples with {number:.0f} constrained directions (%)", short(share)
    off, frames = folded(run)
    if frames:
        yield "graphics copy folded, frames", f"{off} of {frames}"


def _energies(run: Results) -> Iterator[tuple[str, str]]:
    if port := user_port(run):
        told = port.told
        yield "user's port, largest generated (mJ)", short(1e3 * told["peak"])
        yield "user's port, generated at the end (mJ)", short(1e3 * told["generated"])
        for name, block in told["blocks"].items():
            yield f"of it at the end, {name} (mJ)", short(1e3 * block["generated"])
    across = run.run.get("energies", "none")
    yield (
        "connections that carry power across rates",
        "none" if across == "none" else str(len(across)),
    )
    every = ({} if across == "none" else across) | run.run.get("energies_within_a_rate", {})
    for name, energy in every.items():
        generated, peak = (short(1e3 * energy[key]) for key in ("generated", "peak"))
        yield f"hold of {name}, generated (mJ)", f"{generated}, at most {peak}"


def _stable(run: Results) -> Iterator[tuple[str, str]]:
    yield "holds generate more than is put in", run.run.get("unstable") or "no"
    for name, errors in run.run.get("step_errors", {}).items():
        yield f"error of the steps of {name}, sum (%)", short(100 * errors["sum"])
    if found := run.run.get("iterations"):
        yield "iterated steps that did not converge", f"{found['unconverged']} of {found['steps']}"


def _timing(run: Results) -> Iterator[tuple[str, str]]:
    timings: dict[str, Any] = run.run.get("timings", {})
    if timings.get("run"):
        yield "run time (s)", short(timings["run"])
        yield "times real time", short(last_time(run) / timings["run"])
    for name, age in run.run.get("delays", {}).items():
        if age["max"] > 0:
            ages = f"{short(1e3 * age['min'])} to {short(1e3 * age['max'])}"
            yield f"age of the sample of {name} (ms)", ages
    if paced := run.run.get("real_time"):
        yield "deadlines missed", f"{paced['deadlines_missed']} of {paced['ticks']}"
        for key in ("step_time", "lateness"):
            yield f"largest {key.replace('_', ' ')} (ms)", short(1e3 * paced[key]["max"])


def _apart(runs: Sequence[Results]) -> list[Row]:
    """The largest distance (mm) of the operational point from that of the first run at the same
    times, until the first end; none where a run has no such point, or another mechanism."""
    tables = [of_block(run, POINT_POSE, 3) for run in runs]
    if len(runs) < 2 or not one_mechanism(runs) or not all(t and len(t["time"]) for t in tables):
        return []
    first, *others = [t for t in tables if t]
    time = first["time"]
    time = time[time <= min(t["time"][-1] for t in (first, *others))]
    found = [NONE]
    for table in others:
        x = [np.interp(time, table["time"], table[POINT_POSE][:, i]) for i in (0, 1)]
        away = np.array(x) - first[POINT_POSE][: len(time), :2].T
        found.append(short(1e3 * float(np.hypot(*away).max())))
    return [Row("operational point from that of the first run, largest (mm)", tuple(found))]
