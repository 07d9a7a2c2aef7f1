"""One experiment from scene to folder: build, run, `run.json`."""

from __future__ import annotations

from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import delays
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.results.files import write_json, write_over
from hapticlink.orchestrator.results.tables import Results, load
from hapticlink.orchestrator.run import crash_monitor
from hapticlink.orchestrator.run.event_loop import Outcome, Progress, run
from hapticlink.orchestrator.run.open_fmus import isolated
from hapticlink.orchestrator.run_json import _ending, _story
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.system import System

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
    scene: str | Path | Scene,
    folder: Path | str,
    options: Options = (),
    progress: Progress | None = None,
) -> Experiment:
    """Run a scene (a name, a path, or a Scene), changed by `options`, into `folder`.

    Raises InputFault before anything runs; a fault of the run itself is in the outcome, and
    its results are kept.
    """
    begin = perf_counter()
    read = open_scene.load(scene, options)
    folder = Path(folder)
    with built(read) as system:
        plan = Plan(system)
        ages = delays(plan)  # makes all blocks: a ring of sampled blocks is found here
        build_time = perf_counter() - begin
        folders.clear(folders.made(folder))
        story = _story(read, system) | {"delays": {k: asdict(v) for k, v in ages.items()}}
        write_json(folder / "run.json", story | {"end": {"reason": "running"}}, ROOM)
        alone = isolated(system.fmus)
        risky = any(fmu.name not in alone for fmu in read.fmu)
        with crash_monitor.beside(folder) if risky else nullcontext():
            outcome = run(plan, folder, progress)
    try:
        write_json(folder / "run.json", story | _ending(system, outcome, build_time))
    except OSError as error:
        if outcome.fault is None:
            outcome.fault = Fault(f"{folder}: {error.strerror or error}")
            outcome.reason = "fault"
        ending = _ending(system, outcome, build_time)
        least = {key: ending[key] for key in ("end", "fault")}
        with suppress(OSError):  # a disk that does not write in place keeps "running"
            write_over(folder / "run.json", story | ending, story | least)
    return Experiment(read, system, outcome, folder)
