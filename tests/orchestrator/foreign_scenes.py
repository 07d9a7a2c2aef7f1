"""Scenes of FMUs of others, written as text, and their runs."""

import os
import subprocess
import sys
from pathlib import Path

from hapticlink.orchestrator.experiment import Experiment, simulate
from hapticlink.orchestrator.results import read_results

ISOLATED = "isolate = true\n"
COMMAND = [sys.executable, "-m", "hapticlink"]
RUN = [*COMMAND, "run", "--no-figures"]


def fmu_table(name: str, path: str, more: str = "") -> str:
    """An [[fmu]] table of a scene, with further lines."""
    return f'[[fmu]]\nname = "{name}"\npath = "{path}.fmu"\n{more}'


def wire_table(source: str, target: str, more: str = "") -> str:
    """A [[connection]] table of a scene, with further lines."""
    return f'[[connection]]\nfrom = "{source}"\nto = "{target}"\n{more}'


PAIR = (
    "\n"
    + fmu_table("gives", "Gives")
    + fmu_table("takes", "Takes")
    + wire_table("gives.y", "takes.u")
)


def scene(folder: Path, text: str, rate: int = 64, duration: float = 0.5) -> Path:
    """A scene file of [[fmu]] and [[connection]] tables."""
    path = folder / "scene.toml"
    head = f'title = "test"\nduration = {duration}\nhaptics.rate = {rate}\n'
    path.write_text(head + text)
    return path


def run(folder: Path, text: str, *options: str) -> tuple[Experiment, read_results.Results]:
    experiment = simulate(str(scene(folder, text)), folder / "out", options)
    return experiment, experiment.results


def process(path: Path | str, out: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """`hapticlink run` of a scene, in a process of its own."""
    command, environment = [*RUN, str(path), "--out", str(out)], os.environ | environment
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def ran(folder: Path, text: str, *options: str) -> read_results.Results:
    """The results of a run without a fault."""
    experiment, results = run(folder, text, *options)
    assert experiment.outcome.fault is None
    return results


def fault(folder: Path, text: str, *options: str) -> str:
    """What a run says of the fault that ended it."""
    experiment, _ = run(folder, text, *options)
    assert experiment.outcome.fault is not None
    return str(experiment.outcome.fault)


def hostile_scene(folder: Path, name: str, lines: str = "", fmu: str = "hostile") -> Path:
    """A scene in which the hostile FMU of that name gets the output of another one that behaves
    well; `lines` are further keys of it, `fmu` is its file."""
    both = fmu_table(name, fmu, f"{lines}\n") + fmu_table("source", "hostile")
    return scene(folder, both + wire_table("source.y", f"{name}.u"))
