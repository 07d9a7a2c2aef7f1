"""Repetitions of a sweep's points: the same scene with other seeds of what is drawn in it, and the
median and quartiles of what they measure."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hapticlink.analysis.sweep.grid import MAX_RUNS, Point
from hapticlink.analysis.sweep.row import FAILED, METRIC, WHOLE, Row
from hapticlink.analysis.sweep.table import HEADS, NOT_REPRODUCIBLE, few_lines
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene.rates import VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Latency

REPETITION = "repetition"
"""The column that numbers the runs of a point, from 0."""
QUARTILES = {"q25": 0.25, "median": 0.5, "q75": 0.75}


def seeds(scene: Scene) -> dict[str, int]:
    """The seed of each draw of a run, by its key as `--set` takes it: of rates that vary, of
    latencies that vary or lose samples, and of noise. Empty if nothing is drawn: two runs of the
    scene are then equal, but for what FMUs of others draw themselves."""
    rates = {"graphics.rate": scene.graphics.rate} if scene.graphics else {}
    rates |= {f"fmu.{_quoted(fmu.name)}.rate": fmu.rate for fmu in scene.fmu if fmu.rate}
    drawn: dict[str, Any] = {
        key: rate
        for key, rate in rates.items()
        if isinstance(rate, VariableRate) and exact(rate.min) < exact(rate.max)
    }
    drawn |= {
        f"delays.{_quoted(name)}": late
        for name, late in scene.delays.items()
        if isinstance(late, Latency) and (late.loss or (late.max or 0.0) > late.min)
    }
    drawn |= {
        f"at.{i}": event
        for i, event in enumerate(scene.at)
        if event.noise and event.time < scene.stop_time
    }
    return {f"{key}.seed": draw.seed for key, draw in drawn.items()}


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name) else json.dumps(name)


def seed(own: int, repetition: int) -> int:
    """The seed of a repetition: in the first, 0, the scene's `own`; then the first word of numpy's
    SeedSequence of both, so that draws with the same seed keep having the same."""
    if repetition == 0:
        return own
    return int(np.random.SeedSequence([own, repetition]).generate_state(1)[0])


def repeat(points: Sequence[tuple[Mapping[str, str], Scene | None]], count: int) -> list[Point]:
    """The points of `count` runs each, with the number of the repetition and the seeds; one of
    which nothing is drawn, or whose scene was refused, is run once. Raises InputFault if nothing
    is drawn at any point, if a seed is varied, and for too many runs."""
    if len(points) * count > MAX_RUNS:
        raise InputFault(f"--repeat {count}: {len(points) * count} runs; at most {MAX_RUNS}")
    drawn = [(point, seeds(scene) if scene else {}) for point, scene in points]
    if twice := next((key for point, own in drawn for key in own if key in point), None):
        raise InputFault(f"--repeat: sets {twice}, which is varied: take one of both")
    if not any(own for _, own in drawn):
        raise InputFault(
            f"--repeat {count}: nothing in this scene is random, so that all repetitions are equal;"
            " give it a rate that varies (e.g. --set 'graphics.rate={ min = 25, max = 35 }'), a"
            " latency that varies or loses samples, or noise, or take --repeat away"
        )
    return [
        {**point, REPETITION: str(k), **{key: str(seed(s, k)) for key, s in own.items()}}
        for point, own in drawn
        for k in range(count if own else 1)
    ]


def spread(rows: Sequence[Row], keys: Sequence[str]) -> list[Row]:
    """A row for each point of a repeated sweep: the varied `keys`, the number of its `runs`, how
    many of them lasted (`whole_runs`), and of these the quartiles of each column of numbers,
    by linear interpolation as numpy's `quantile`.

    A run that failed or ended early has no number that is comparable, so that quartiles are those
    of the runs that lasted alone.
    """
    points: dict[tuple[Any, ...], dict[str, Row]] = {}
    for row in rows:
        given = tuple(row.get(key) for key in keys)
        points.setdefault(given, {})[row.get(REPETITION, "0")] = row
    return [_quartiles([*runs.values()], keys) for runs in points.values()]


def _quartiles(runs: Sequence[Row], keys: Sequence[str]) -> Row:
    whole = [row for row in runs if row["end"] in WHOLE]
    found: Row = {key: runs[0][key] for key in keys if key in runs[0]}
    found |= {"runs": len(runs), "whole_runs": len(whole)}
    for name in dict.fromkeys(name for row in whole for name in row if name != NOT_REPRODUCIBLE):
        values = [v for row in whole if isinstance(v := row.get(name), int | float)]
        if values and all(map(math.isfinite, values)):
            quantiles = np.quantile(values, [*QUARTILES.values()])
            found |= {f"{name} {q}": float(v) for q, v in zip(QUARTILES, quantiles, strict=True)}
    return found


def lines(rows: Sequence[Row], keys: Sequence[str]) -> Iterator[str]:
    """The result as text: a line for each point, with median and quartiles of the main numbers."""
    points = spread(rows, keys)
    bad = sum(row["end"] in FAILED for row in rows)
    yield (
        f"{len(rows)} runs of {len(points)} points over {', '.join(keys)}, {bad} failed: "
        "median (quartiles) of whole runs"
    )
    shown = {n: h for n, h in HEADS.items() if any(f"{n} median" in point for point in points)}
    shown.pop("end_time_s", None)  # of runs that lasted it is the scene's
    cells = []
    for point in points:
        named = [str(point.get(key, "")) for key in keys]
        count = f"{point['whole_runs']} of {point['runs']}"
        cells.append([*named, count, *(_cell(point, name) for name in shown)])
    order = [point.get(f"{METRIC} median", math.inf) for point in points]
    yield from few_lines([*keys, "whole runs", *shown.values()], cells, order)


def _cell(point: Row, name: str) -> str:
    """Energies in mJ, as in all that is read."""
    if f"{name} median" not in point:
        return ""
    scale = 1e3 if name.endswith("_J") else 1.0
    low, middle, high = (short(scale * point[f"{name} {q}"]) for q in QUARTILES)
    return f"{middle} ({low} to {high})"
