"""A point of a sweep beside the loop of its run, and beside FMPy.

For each key, draws of its values in one process: as the points of a sweep (`sweep`), which keep
what they share and, where they share their events, take steps of FMUs for eight runs at once; as
such points one after the other (`one by one`); and as runs of which each stands alone (`runs
alone`), from the scene's tables to the row of measures. Native FMUs that the cache has, with their
steps of several instances, results in memory. The loop is what a point spends in the event loop one
by one. FMPy runs the scene as one FMU in the way of its own example of parameter studies:
unpacked and instantiated once, reset for each point, with start values, and the poses of which
tracking is measured as outputs; of rates and holds such a FMU has one. Forms take turns; processor
time of the process, whose median over rounds counts. OMSimulator is no part of it: its package on
PyPI fetches the program from a server while it is installed.
"""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from os import times
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

import hapticlink.analysis
import hapticlink.orchestrator
from benchmarks import code_version
from benchmarks.page import Progress, load_average, system, table
from benchmarks.rows import Rows
from hapticlink.analysis.sweep import run_sweep
from hapticlink.analysis.sweep.job import job
from hapticlink.analysis.sweep.run_sweep import TOGETHER
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt, process, temporary_folders
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.run.compiled import lanes
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.programs.build import build_program

SCENE = "closed-loop-ideal"
FIXED = ("packaging=native",)
HOLDS = ("zoh", "foh", "lead", "delayed", "smooth")
JOINTS = {"shoulder1": 0.785, "elbow1": -1.571, "shoulder2": -1.257, "elbow2": 1.571}
WARM, POINTS, ROUNDS = TOGETHER // 2, 2 * TOGETHER, 5
"""Points of a round, behind as many as a process gets at a time."""
COLUMNS = ("key", "form", "point_ms", "loop_ms")
Point = dict[str, str]
Run = Callable[[list[Point]], object]


def _draw(key: str, draw: random.Random) -> Point:
    """A point of a key."""
    match key:
        case "rates":
            return {"graphics.rate": f"{draw.uniform(20, 60):.1f}"}
        case "holds":
            return {"hold": draw.choice(HOLDS)}
        case "gains":
            gain = draw.uniform(40, 80)
            return {"controller.teleoperation.damping": f"[{gain:.3f}, {gain:.3f}, 0.3]"}
        case "hand":
            x, y, turn = draw.uniform(-0.5, 0.0), draw.uniform(-0.1, 0.1), draw.uniform(-0.3, 0.3)
            return {"hand.wrench": f"[{x:.4f}, {y:.4f}, {turn / 100:.6f}]"}
    return {
        f"linkage.start.{name}": f"{value + draw.uniform(-0.1, 0.1):.4f}"
        for name, value in JOINTS.items()
    }


KEYS = ("rates", "holds", "gains", "hand", "start")
SIDE_BY_SIDE = ("gains", "hand", "start")
"""Those of points that share their events."""
PARAMETERS = {
    "controller.teleoperation.damping": "controller.B_pc",
    "hand.wrench": "hand.wrench",
}
"""The parameters of one FMU by the scene's keys."""


def bench(folder: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes points.csv into `folder`."""
    code_version.begin(folder, ("points.csv",), hapticlink.orchestrator, hapticlink.analysis)
    rows = Rows(folder / "points.csv", COLUMNS, 2)
    rounds, count = (1, TOGETHER) if quick else (ROUNDS, POINTS)
    process.raise_gc_threshold()
    load = load_average()
    with ExitStack() as stack:
        room = stack.enter_context(temporary_folders.temporary_folder())
        stack.enter_context(one_blas_thread())
        loop = _LoopTime(stack)
        source = open_scene.source_of(SCENE)

        def ours(points: list[Point]) -> None:
            options = ([f"{key}={value}" for key, value in point.items()] for point in points)
            jobs = [job(source, [*FIXED, *o], p) for o, p in zip(options, points, strict=True)]
            together = partial(run_sweep.run_together, compiles=True)
            for row in run_sweep.work_together(jobs, room, run_sweep.run, together):
                interrupt.raise_if_interrupted()
                assert row["end"] == "duration", row

        def kept(points: list[Point], at_once: int) -> tuple[float, float]:
            batches = [points[i : i + at_once] for i in range(0, len(points), at_once)]
            with process_cache.keep_unpacked():
                for batch in batches[: 2 * WARM // at_once]:
                    ours(batch)
                return loop.of(ours, batches[2 * WARM // at_once :])

        forms: dict[str, Callable[[list[Point]], tuple[float, float]]] = {
            "sweep": partial(kept, at_once=TOGETHER),
            "one by one": partial(kept, at_once=1),
            "runs alone": lambda points: loop.of(ours, [[p] for p in points[2 * WARM :]]),
            "FMPy": _fmpy(room, stack),
        }
        for i, key in enumerate(KEYS):
            progress(key, i, len(KEYS))
            if (key, "sweep") in rows:
                continue
            found: dict[str, list[tuple[float, float]]] = {form: [] for form in forms}
            for turn in range(rounds):
                draw = random.Random(turn)
                points = [_draw(key, draw) for _ in range(2 * WARM + count)]
                for form, run in forms.items():
                    if form != "FMPy" or key in SIDE_BY_SIDE:
                        found[form].append(run(points))
            for form, each in found.items():
                if each:
                    point, inside = (median(found) for found in zip(*each, strict=True))
                    rows.add(key, form, point, inside if form != "FMPy" else "")
    if ("imports", "a worker") not in rows:
        rows.add("imports", "a worker", _imports(), "")
    return _page([*rows.rows.values()], command, load)


class _LoopTime:
    """Processor time of runs, and what of it their event loops take."""

    def __init__(self, stack: ExitStack) -> None:
        self._inside = 0.0
        for owner, name in ((CompiledLoop, "run"), (lanes, "run_side_by_side")):
            inner = getattr(owner, name)
            stack.callback(setattr, owner, name, inner)
            setattr(owner, name, self._timed(inner))

    def _timed(self, inner: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*given: Any) -> Any:
            begin = process_time()
            try:
                return inner(*given)
            finally:
                self._inside += process_time() - begin

        return timed

    def of(self, run: Run, batches: list[list[Point]]) -> tuple[float, float]:
        """Both (ms) for a point."""
        self._inside, begin = 0.0, process_time()
        for batch in batches:
            run(batch)
        each = 1e3 / sum(map(len, batches))
        return each * (process_time() - begin), each * self._inside


def _fmpy(room: Path, stack: ExitStack) -> Callable[[list[Point]], tuple[float, float]]:
    """Points by FMPy, in one instance of the scene as one FMU."""
    path = build_program(open_scene.load(SCENE), SCENE, out=room)
    about = fmpy.read_model_description(path)
    unpacked = fmpy.extract(path, unzipdir=str(room / "unpacked"))
    instance = fmpy.instantiate_fmu(unpacked, about, "CoSimulation")
    assert isinstance(instance, FMU2Slave)
    stack.callback(instance.freeInstance)
    poses = [f"{name}[{i}]" for name in ("virtual_mechanism.x", "haptic_device.x") for i in (1, 2)]

    def run(point: Point) -> float:
        instance.reset()
        made = fmpy.simulate_fmu(
            unpacked,
            start_values=dict(_parameters(point)),
            output=poses,
            model_description=about,
            fmu_instance=instance,
            output_interval=float(about.defaultExperiment.stepSize),
        )
        apart = [made[poses[i]] - made[poses[2 + i]] for i in range(2)]
        return float(np.hypot(*apart).max())

    def timed(points: list[Point]) -> tuple[float, float]:
        begin = process_time()
        for point in points[2 * WARM :]:
            run(point)
        return 1e3 * (process_time() - begin) / len(points[2 * WARM :]), 0.0

    return timed


def _parameters(point: Point) -> Iterator[tuple[str, float]]:
    """The start values of parameters that a point of gains, hands or poses sets."""
    for key, text in point.items():
        if key in PARAMETERS:
            for i, value in enumerate(text.strip("[]").split(",")):
                yield f"{PARAMETERS[key]}[{i + 1}]", float(value)
        else:
            place = [*JOINTS].index(key.rpartition(".")[2])
            for block in ("virtual_mechanism", "virtual_environment"):
                yield f"{block}.q_start[{place + 1}]", float(text)


def _imports() -> float:
    """Processor time (ms) of a Python that imports what a worker of a sweep does, and ends."""
    begin = sum(times()[2:4])
    subprocess.run([sys.executable, "-c", f"import {run_sweep.__name__}"], check=True)
    return 1e3 * (sum(times()[2:4]) - begin)


def _page(rows: list[dict[str, str]], command: str, load: float) -> str:
    point = {(row["key"], row["form"]): float(row["point_ms"]) for row in rows}
    loop = {row["key"]: float(row["loop_ms"]) for row in rows if row["form"] == "one by one"}
    ratios = [point[key, "sweep"] / loop[key] for key in KEYS]
    inside = {row["key"]: float(row["loop_ms"]) for row in rows if row["form"] == "sweep"}
    beside = [loop[key] / inside[key] for key in SIDE_BY_SIDE]
    peer = [point[key, "FMPy"] / point[key, "sweep"] for key in KEYS if (key, "FMPy") in point]
    method = " ".join((__doc__ or "").partition("\n\n")[2].split())
    text = f"""# Points of sweeps

A point of {SCENE} takes {min(ratios):.2f} to {max(ratios):.2f} times what its event loop takes, which eight runs side by side go through {min(beside):.2f} to {max(beside):.2f} times as fast; FMPy takes {min(peer):.2f} to {max(peer):.2f} times as long for a point; the imports of a worker take as long as {point["imports", "a worker"] / point["hand", "sweep"]:.0f} points.

Made by `{command}`. {method} On {system()}, with a load average of {load:.1f} before. All rows: [points.csv](points.csv).

"""  # noqa: E501
    lines = (
        (row["key"], row["form"], f"{float(row['point_ms']):.1f}", *_of_loop(row, loop))
        for row in rows
    )
    return text + "\n".join(table("key | form | ms a point | times the loop", "llrr", lines)) + "\n"


def _of_loop(row: dict[str, str], loop: dict[str, float]) -> tuple[str]:
    of = loop.get(row["key"])
    return (f"{float(row['point_ms']) / of:.2f}" if of else "",)
