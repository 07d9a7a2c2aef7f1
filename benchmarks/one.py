"""A scene as one FMU beside its run through FMUs: time for a haptic tick, size, and time to build.

Forms take turns in rounds, and the least time of each counts: processor time of the process, so
that what other processes take is no part of it. `run` is the loop of `hapticlink run` alone, with
native FMUs, all outputs recorded. One FMU is stepped by FMPy from Python, as other tools step it,
without reading outputs, by 1 or 16 ticks a doStep. It is built without a cache of FMUs, and has the
bits of the run (tests/programs).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from time import process_time

from benchmarks.page import Progress, table
from benchmarks.timing import Row, made_anew, measured_scenes, simulated
from hapticlink.fmus.check import session
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.programs.build import build_program

FORMS = {"run": 0, "one FMU, 1 tick a step": 1, "one FMU, 16 ticks a step": 16}
COLUMNS = ("scene", "form", "tick_us", "times_real_time", "bytes", "build_s")


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes runs.csv into `folder`."""
    return _page(measured_scenes(folder, quick, progress, COLUMNS, _measured), command)


def _measured(scene: str, options: tuple[str, ...], rounds: int) -> Iterator[tuple[object, ...]]:
    times: dict[str, list[float]] = {form: [] for form in FORMS}
    with temporary_folders.temporary_folder() as room:
        path = room / f"{scene.replace('-', '_')}.fmu"

        def build() -> None:
            build_program(open_scene.load(scene, options), scene, out=room)

        spent = made_anew(build, room / "cache")
        for _ in range(rounds):
            given = ("packaging=native", *options)
            experiment = simulated(scene, room / "run", given, csv=False)
            for form, ticks in FORMS.items():
                run = experiment.outcome.wall_time
                times[form].append(_stepped(path, experiment, ticks) if ticks else run)
        size = path.stat().st_size
    timeline = experiment.system.timeline
    count = round(experiment.outcome.end_time / _period(experiment))
    duration = timeline.seconds(count * timeline.clocks[0].longest)
    for form, t in times.items():
        of_file = (size, spent) if FORMS[form] else ("", "")
        yield form, 1e6 * min(t) / count, duration / min(t), *of_file


def _period(experiment: Experiment) -> float:
    timeline = experiment.system.timeline
    return float(timeline.seconds(timeline.clocks[0].longest))


def _stepped(path: Path, experiment: Experiment, ticks: int) -> float:
    """Time (s) of the doSteps up to the end of the run, by so many haptic ticks each."""
    step = ticks * _period(experiment)
    count = int(experiment.outcome.end_time / step + 1e-9)
    with session(path) as opened:
        slave = opened.initialized()
        begin = process_time()
        for k in range(count):
            slave.doStep(k * step, step)
        return (process_time() - begin) * experiment.outcome.end_time / (count * step)


def _page(rows: list[Row], command: str) -> str:
    times = [float(row["times_real_time"]) for row in rows[: len(FORMS)]]
    run, one, sixteen = times
    method = " ".join((__doc__ or "").partition("\n\n")[2].split())
    text = f"""# A scene as one FMU

{rows[0]["scene"]} as one FMU runs {sixteen:.0f} times real time in steps of 16 haptic ticks and {one:.0f} in steps of one, stepped from Python; its run through FMUs {run:.0f} times: {sixteen / run:.2f} and {one / run:.2f} times as fast.

Made by `{command}`. {method} Measured on a machine with much other work, which shares caches and cores: ratios hold, absolute times do not. All rows: [runs.csv](runs.csv).

"""  # noqa: E501
    heads = (
        "scene | form | us a haptic tick | times real time | kB, with sources | "
        "s of processors to build"
    )
    return text + "\n".join(table(heads, "llrrrr", map(_cells, rows))) + "\n"


def _cells(row: Row) -> list[str]:
    tick, times = float(row["tick_us"]), float(row["times_real_time"])
    size = f"{int(row['bytes']) / 1000:.0f}" if row["bytes"] else ""
    build = f"{float(row['build_s']):.1f}" if row["build_s"] else ""
    return [row["scene"], row["form"], f"{tick:.2f}", f"{times:.0f}", size, build]
