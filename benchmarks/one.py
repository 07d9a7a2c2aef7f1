"""A scene as one FMU beside its run through FMUs: time for a haptic tick, size, and time to build.

Forms take turns in rounds, and the least time of each counts: processor time of the process, so
that what other processes take is no part of it. `run` is the loop of `hapticlink run` alone, with
native FMUs, all outputs recorded. One FMU is stepped by FMPy from Python, as other tools step it,
without reading outputs, by 1 or 16 ticks a doStep. It is built without a cache of FMUs, and has the
bits of the run (tests/programs).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from time import process_time
from unittest.mock import patch

from benchmarks.rows import Rows
from hapticlink.fmus.check import initialize, session
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.run import execute_plan
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.programs.build import build_program

SCENES = (
    ("closed-loop", ()),
    ("closed-loop", ("hold=foh",)),
    ("closed-loop-direct", ("hold=passive",)),
    ("two-users", ()),
    ("pendulum", ()),
)
FORMS = {"run": 0, "one FMU, 1 tick a step": 1, "one FMU, 16 ticks a step": 16}
COLUMNS = ("scene", "form", "tick_us", "times_real_time", "bytes", "build_s")
ROUNDS = 15
Progress = Callable[[str, int, int], None]


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> Path:
    """Measures all scenes, and writes README.md and runs.csv into `folder`."""
    (folder / "runs.csv").unlink(missing_ok=True)
    rows = Rows(folder / "runs.csv", COLUMNS, 2)
    scenes = SCENES[:1] if quick else SCENES
    for k, (scene, options) in enumerate(scenes):
        progress(" ".join((scene, *options)), k, len(scenes))
        for row in _measured(scene, options, 3 if quick else ROUNDS):
            rows.add(*row)
    page = folder / "README.md"
    page.write_text(_page([*rows.rows.values()], command), encoding="utf-8")
    return page


def _measured(scene: str, options: tuple[str, ...], rounds: int) -> list[tuple[object, ...]]:
    given = ("packaging=native", *options)
    times: dict[str, list[float]] = {form: [] for form in FORMS}
    with temporary_folders.room() as name:
        room = Path(name)
        load()
        begin = sum(os.times()[:4])
        with patch.dict("os.environ", {"HAPTICLINK_CACHE": str(room / "cache")}):
            path = build_program(open_scene.load(scene, options), scene, out=room)
        build = sum(os.times()[:4]) - begin
        for _ in range(rounds):
            with patch.object(execute_plan, "perf_counter", process_time):
                experiment = simulate(scene, room / "run", given, csv=False)
            for form, ticks in FORMS.items():
                run = experiment.outcome.wall_time
                times[form].append(_stepped(path, experiment, ticks) if ticks else run)
        size = path.stat().st_size
    timeline = experiment.system.timeline
    count = round(experiment.outcome.end_time / _period(experiment))
    duration = timeline.seconds(count * timeline.clocks[0].longest)
    title = " ".join((scene, *options))
    return [
        (title, form, 1e6 * min(t) / count, duration / min(t), *(
            (size, build) if FORMS[form] else ("", "")))
        for form, t in times.items()
    ]  # fmt: skip


def _period(experiment: Experiment) -> float:
    timeline = experiment.system.timeline
    return float(timeline.seconds(timeline.clocks[0].longest))


def _stepped(path: Path, experiment: Experiment, ticks: int) -> float:
    """Time (s) of the doSteps up to the end of the run, by so many haptic ticks each."""
    step = ticks * _period(experiment)
    count = int(experiment.outcome.end_time / step + 1e-9)
    with session(path) as opened:
        slave = opened.instance()
        initialize(slave)
        begin = process_time()
        for k in range(count):
            slave.doStep(k * step, step)
        return (process_time() - begin) * experiment.outcome.end_time / (count * step)


def _page(rows: list[dict[str, str]], command: str) -> str:
    times = [float(row["times_real_time"]) for row in rows[: len(FORMS)]]
    run, one, sixteen = times
    method = " ".join((__doc__ or "").partition("\n\n")[2].split())
    text = f"""# A scene as one FMU

{rows[0]["scene"]} as one FMU runs {sixteen:.0f} times real time in steps of 16 haptic ticks and {one:.0f} in steps of one, stepped from Python; its run through FMUs {run:.0f} times: {sixteen / run:.2f} and {one / run:.2f} times as fast.

Made by `{command}`. {method} Measured on a machine with much other work, which shares caches and cores: ratios hold, absolute times do not. All rows: [runs.csv](runs.csv).

| scene | form | us a haptic tick | times real time | kB, with sources | s of processors to build |
|---|---|--:|--:|--:|--:|
"""  # noqa: E501
    return text + "".join(f"| {' | '.join(_cells(row))} |\n" for row in rows)


def _cells(row: dict[str, str]) -> list[str]:
    tick, times = float(row["tick_us"]), float(row["times_real_time"])
    size = f"{int(row['bytes']) / 1000:.0f}" if row["bytes"] else ""
    build = f"{float(row['build_s']):.1f}" if row["build_s"] else ""
    return [row["scene"], row["form"], f"{tick:.2f}", f"{times:.0f}", size, build]
