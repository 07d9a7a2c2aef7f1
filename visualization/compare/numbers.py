"""Numbers of runs beside each other, in the order in which one asks: what ran, its outcome, its
performance, energies, stability, timing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.tracking import of_port
from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.base.signal_names import POINT_POSE
from hapticlink.orchestrator.base.terminal_output import align_columns
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.compare.settings import one_mechanism

NONE = "-"
"""Stands for a number that a run does not have."""
PERFORMANCE = "Performance"
"""The title of the section with tracking errors and forces begins so."""
Numbers = Iterator[tuple[str, str]]
"""Labels and values of a run."""


class Row(NamedTuple):
    """A label, and the value of each run."""

    label: str
    values: tuple[str, ...]


def sections(runs: Sequence[Results]) -> dict[str, list[Row]]:
    """Rows by the question that they answer. Paths and forces are compared until the first end of
    the runs."""
    ends = {run.last_time for run in runs}
    until = min(ends)
    performance = f"{PERFORMANCE}, all until {short(until)} s" if len(ends) > 1 else PERFORMANCE
    measures = [Measures(run, until) for run in runs]
    return {
        "What ran": _rows(map(_ran, runs)),
        "Outcome": _rows(map(_outcome, runs)),
        performance: _rows(map(_performance, measures)) + _point_distances(runs),
        "Energies, of the whole run": _rows(map(_energies, runs, measures)),
        "Stability and steps": _rows(map(_stability, runs)),
        "Timing": _rows(map(_timing, runs)),
    }


def _rows(runs: Iterable[Numbers]) -> list[Row]:
    by_run = [dict(numbers) for numbers in runs]
    labels = dict.fromkeys(label for numbers in by_run for label in numbers)
    return [Row(label, tuple(run.get(label, NONE) for run in by_run)) for label in labels]


def as_text(names: Sequence[str], tables: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """The rows in which the runs differ, and how many there are in which they do not."""
    for title, rows in tables.items():
        if differing := [row for row in rows if len({*row.values}) > 1]:
            yield title
            table = [("", *names), *((row.label, *row.values) for row in differing)]
            yield from (f"  {line}" for line in align_columns(table))
            yield ""
    same = sum(len({*row.values}) == 1 for rows in tables.values() for row in rows)
    yield f"{same} rows are the same for all: `hapticlink report` has them"


def _ran(run: Results) -> Numbers:
    record = run.record
    yield "scene", record.scene["title"]
    yield "options", ", ".join(record.options) or "none"
    for name, clock in record.clocks.items():
        steps = (clock.shortest, clock.longest)
        rates = sorted({short(1 / step) for step in steps if step}, key=float)
        yield f"rate of {name}", f"{' to '.join(rates)} Hz"
    yield "coupling", record.coupling
    for name, hold in record.holds.items():
        yield f"hold of {name}", hold
    yield "versions", ", ".join(f"{name} {v}" for name, v in record.versions.items())


def _outcome(run: Results) -> Numbers:
    yield "end", summary.ending(run)
    if fault := run.record.fault:
        yield "fault", fault.message
    lines = run.record.warnings or ()
    warnings = [line for line in lines if line.startswith("warning: ")]
    yield "warnings", "; ".join(w.removeprefix("warning: ") for w in warnings) or "none"
    yield "notes", "; ".join(line for line in lines if line not in warnings) or "none"


def _performance(measures: Measures) -> Numbers:
    for user, error in measures.tracking.items():
        of = user and f"{user}: "
        yield f"{of}tracking error, largest (mm)", short(error.max_mm)
        yield f"{of}tracking error, RMS (mm)", short(error.rms_mm)
        yield f"{of}tracking error, largest angle (rad)", short(error.max_rad)
    for name, force in measures.forces.items():
        yield f"largest force, {name} (N)", short(force)
    for user, share in measures.motors.items():
        of = user and f"{user}: "
        yield f"{of}motors, largest share of their torque (%)", short(100 * share)
    if measures.closure_m is not None:
        yield "closure error, largest (m)", f"{measures.closure_m:.2g}"
    if counts := measures.constrained:
        for number, share in counts.shares_percent.items():
            yield f"samples with {number:.0f} constrained directions (%)", short(share)
    off, frames = measures.folded
    if frames:
        yield "graphics copy folded, frames", f"{off} of {frames}"


def _energies(run: Results, measures: Measures) -> Numbers:
    if port := measures.port:
        yield "user's port, largest generated (mJ)", short(1e3 * port.peak)
        yield "user's port, generated at the end (mJ)", short(1e3 * port.generated)
        for name, block in port.blocks.items():
            yield f"of it at the end, {name} (mJ)", short(1e3 * block.generated)
    yield "connections that carry power across rates", str(len(run.record.across) or "none")
    for name, energy in run.record.meters.items():
        yield f"hold of {name}", summary.describe_generated(energy.peak, energy.generated)


def _stability(run: Results) -> Numbers:
    yield "holds generate more than is put in", run.record.unstable or "no"
    for name, errors in run.record.step_errors.items():
        yield f"error of the steps of {name}, sum (%)", short(100 * errors.sum)
    if counts := run.record.iterations:
        yield "iterated steps that did not converge", f"{counts.unconverged} of {counts.steps}"


def _timing(run: Results) -> Numbers:
    record = run.record
    if wall_time := record.timings.run:
        yield "run time (s)", short(wall_time)
        yield "times real time", short((run.last_time - record.begun) / wall_time)
    for name, age in record.delays.items():
        if age.max > 0:
            ages = f"{short(1e3 * age.min)} to {short(1e3 * age.max)}"
            yield f"age of the sample of {name} (ms)", ages
    if report := record.real_time:
        yield "deadlines missed", f"{report['deadlines_missed']} of {report['ticks']}"
        for key in ("step_time", "lateness"):
            yield f"largest {key.replace('_', ' ')} (ms)", short(1e3 * report[key]["max"])


def _point_distances(runs: Sequence[Results]) -> list[Row]:
    """The largest distance (mm) of the operational point from that of the first run at the same
    times, until the first end; none where a run has no such point, or another mechanism."""
    tables = [table for run in runs if (table := of_port(run, POINT_POSE))]
    comparable = len(tables) == len(runs) > 1 and one_mechanism(runs)
    if not comparable or not all(len(table["time"]) for table in tables):
        return []
    first, *others = tables
    time = first["time"]
    time = time[time <= min(table["time"][-1] for table in tables)]
    distances = [NONE]
    for table in others:
        point = [np.interp(time, table["time"], entry) for entry in table[POINT_POSE].T]
        offset = PLANE.difference(np.column_stack(point), first[POINT_POSE][: len(time)])
        distances.append(short(1e3 * float(PLANE.distance(offset).max())))
    if not any(map(float, distances[1:])):
        return []
    label = "operational point from that of the first run, largest (mm)"
    return [Row(label, tuple(distances))]
