"""One experiment from scene to folder: build, run, `run.json`."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

from hapticlink.orchestrator import folders, rooms, scene_file, told, watchdog
from hapticlink.orchestrator.blocks import blocks, fmu_files
from hapticlink.orchestrator.faults import Fault
from hapticlink.orchestrator.instances import isolated
from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.rates import VariableRate
from hapticlink.orchestrator.results import Results, load, write_json, write_over
from hapticlink.orchestrator.run import Outcome, Progress, run
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.schemes import order
from hapticlink.orchestrator.stamps import delays
from hapticlink.orchestrator.system import System, from_scene
from hapticlink.orchestrator.timeline import timeline

PACKAGES = ("hapticlink", "casadi", "fmpy", "pythonfmu", "numpy")
ROOM = 1 << 14
"""Bytes that run.json keeps for its end, so that a disk which fills up meanwhile has them."""


@dataclass(frozen=True)
class Experiment:
    """A finished run: its results on disk and how it ended."""

    scene: Scene
    system: System
    outcome: Outcome
    folder: Path

    @property
    def results(self) -> Results:
        return load(self.folder)


def simulate(
    scene: str | Scene,
    folder: Path | str,
    options: Sequence[str] = (),
    progress: Progress | None = None,
) -> Experiment:
    """Run a scene (a name, a path, or a Scene) with `--set` options into `folder`.

    Raises InputFault before anything runs; a fault of the run itself is in the outcome, and
    its results are kept.
    """
    begin = perf_counter()
    read = scene if isinstance(scene, Scene) else scene_file.load(scene, options)
    folder = Path(folder)
    with rooms.room() as room:
        time = timeline(read)
        system = from_scene(read, time, fmu_files(read, time, room))
        plan = Plan(system)
        ages = delays(plan)  # makes all blocks: a ring of sampled blocks is found here
        built = perf_counter() - begin
        folders.clear(folders.made(folder))
        story = _story(read, system, options) | {"delays": {k: asdict(v) for k, v in ages.items()}}
        write_json(folder / "run.json", story | {"end": {"reason": "running"}}, ROOM)
        alone = isolated(system.units)
        risky = any(fmu.name not in alone for fmu in read.fmu)
        with watchdog.beside(folder) if risky else nullcontext():
            outcome = run(plan, folder, progress)
    try:
        write_json(folder / "run.json", story | _ending(system, outcome, built))
    except OSError as error:
        if outcome.fault is None:
            outcome.fault = Fault(f"{folder}: {error.strerror or error}")
            outcome.reason = "fault"
        ending = _ending(system, outcome, built)
        least = {key: ending[key] for key in ("end", "fault")}
        with suppress(OSError):  # a disk that does not write in place keeps "running"
            write_over(folder / "run.json", story | ending, story | least)
    return Experiment(read, system, outcome, folder)


def _story(scene: Scene, system: System, options: Sequence[str]) -> dict[str, Any]:
    base = system.timeline.base
    return {
        "scene": asdict(scene),
        "options": list(options),
        "versions": {name: version(name) for name in (*PACKAGES, *_compilers(scene))}
        | {"python": platform.python_version()},
        "seeds": _seeds(scene, system),
        "files": ["run.json", *(f"{c.name}.csv" for c in system.timeline.clocks)],
        "rates": [c.name for c in system.timeline.clocks],
        "clocks": told.clocks(system.timeline),
        "base": f"{base.numerator}/{base.denominator} s",
        "fmus": {u.name: {"rate": u.clock, "timing": u.description.timing} for u in system.units},
        "coupling": system.coupling,
        "loops": [asdict(loop) for loop in order.loops(system)],
        "connections": [c.name for c in system.connections],
    } | told.holds(system)


def _compilers(scene: Scene) -> tuple[str, ...]:
    return ("ziglang",) if scene.packaging == "native" and blocks(scene) else ()


def _seeds(scene: Scene, system: System) -> dict[str, int]:
    rates = {"graphics.rate": scene.graphics.rate} if scene.graphics else {}
    rates |= {f"fmu.{fmu.name}.rate": fmu.rate for fmu in scene.fmu}
    seeds = {name: r.seed for name, r in rates.items() if isinstance(r, VariableRate)}
    return seeds | {c.name: c.latency.seed for c in system.connections if c.latency}


def _ending(system: System, outcome: Outcome, built: float) -> dict[str, Any]:
    fault = outcome.fault
    failed = fault and {
        "kind": type(fault).__name__,
        "time": getattr(fault, "time", None),
        "message": str(fault),
    }
    return {
        "end": {"reason": outcome.reason, "time": outcome.end_time},
        "fault": failed,
        "calls": outcome.calls,
        "links": outcome.links,
        "isolated": outcome.isolated,
        "held_outputs": outcome.held,
        "smaller_steps": outcome.smaller_steps,
        "timings": {
            "build": built,
            "run": outcome.wall_time,
            "steps": outcome.step_time,
        },
        "iterations": outcome.iterations and asdict(outcome.iterations),
        "controlled_steps": {clock: asdict(steps) for clock, steps in outcome.steps.items()},
    } | told.energies(system, outcome.energies)
