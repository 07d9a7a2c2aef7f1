"""How whole scenes are timed: by processor time, which other processes hardly change, in rounds of
all forms by turns."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

from benchmarks.page import Progress
from benchmarks.rows import Rows
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.run import execute_plan

SCENES = (
    ("closed-loop-ideal", ()),
    ("closed-loop-ideal", ("hold=foh",)),
    ("closed-loop-direct", ("hold=passive",)),
    ("two-users", ()),
    ("pendulum", ()),
)
ROUNDS = 15
Row = dict[str, str]


def measured_scenes(
    folder: Path,
    quick: bool,
    progress: Progress,
    columns: tuple[str, ...],
    measure: Callable[[str, tuple[str, ...], int], Iterable[tuple[object, ...]]],
) -> list[Row]:
    """The rows of `folder`/runs.csv, each known by scene and form, which are made anew: those that
    `measure` gives for a scene, options and a number of rounds."""
    (folder / "runs.csv").unlink(missing_ok=True)
    rows = Rows(folder / "runs.csv", columns, 2)
    scenes = SCENES[:1] if quick else SCENES
    for k, (scene, options) in enumerate(scenes):
        title = " ".join((scene, *options))
        progress(title, k, len(scenes))
        for row in measure(scene, options, 3 if quick else ROUNDS):
            rows.add(title, *row)
    return [*rows.rows.values()]


def simulated(
    scene: Any,
    folder: Path,
    options: Sequence[str] = (),
    *,
    csv: bool = True,
    clock: Callable[[], float] = process_time,
) -> Experiment:
    """A run without fault whose `outcome.wall_time` is the time of its loop by `clock`."""
    with loop_timed_by(clock):
        made = simulate(scene, folder, options, csv=csv)
    assert made.outcome.fault is None, made.outcome.fault
    return made


@contextmanager
def loop_timed_by(clock: Callable[[], float] = process_time) -> Iterator[None]:
    """Within, `outcome.wall_time` of a run is the time of its loop by `clock`."""
    with patch.object(execute_plan, "perf_counter", clock):
        yield


def made_anew(make: Callable[[], object], cache: Path) -> float:
    """Processor time (s) of this process and its children to make something with the empty cache of
    FMUs `cache`."""
    from hapticlink.orchestrator.run.compiled.library import load

    load()  # is compiled once
    begin = sum(os.times()[:4])
    with patch.dict("os.environ", {"HAPTICLINK_CACHE": str(cache)}):
        make()
    return sum(os.times()[:4]) - begin
