"""Files made from a scene: its FMUs, and its SSP."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.native import PLATFORMS
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.run import start_parameters
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.built import built
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.timeline import timeline


def build(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    out: str | Path,
    all_platforms: bool = False,
) -> dict[str, Path]:
    """Build the FMUs of a scene into the folder `out`: the file `<block>.fmu` of each block.

    Each starts where the scene does: a parameter that a connection of the scene sets once (the
    device's `x_start`) has the value that it carries as its start.

    `all_platforms` compiles native FMUs for Linux, Windows and macOS, not for this machine alone.
    Raises InputFault where there is nothing to build, or `out` cannot be written to.
    """
    read = open_scene.load(scene, options)
    if all_platforms and read.packaging != "native":
        raise InputFault("--all-platforms compiles: add --set packaging=native")
    if not blocks(read):
        raise InputFault(f"{read.title}: nothing to build: its FMUs are given as files")
    folder = folders.ensure(out)
    starts = _starts(read)
    with temporary_folders.room() as room:
        platforms = PLATFORMS if all_platforms else ()
        files = fmu_files(read, timeline(read), room, platforms, starts)
        for name, path in files.items():
            with atomic_file(folder / f"{name}.fmu") as unfinished:
                shutil.copyfile(path, unfinished)
    return {name: folder / f"{name}.fmu" for name in files}


def export(scene: str | Path | Scene, options: Options = (), *, out: str | Path) -> Path:
    """Write a scene as the SSP `out`: FMUs, connections and start values for other tools; rates and
    holds, which the standard does not know, in an annotation. `run` reads it back.

    Raises InputFault for a scene that cannot be run, or where `out` cannot be written.
    """
    from hapticlink.orchestrator.ssp import write  # its XML parsers take a while to load

    read = open_scene.load(scene, options)
    with built(read, _starts(read)) as system:
        return write.write(read, start_parameters.settled(system), Path(out))


def _starts(scene: Scene) -> dict[str, dict[str, tuple[float, ...]]]:
    # Python FMUs give the same values as native ones, and need no compiler.
    with built(replace(scene, packaging="python")) as system:
        return start_parameters.by_port(system)
