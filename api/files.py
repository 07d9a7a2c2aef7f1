"""Files built from a scene: its FMUs, and its SSP."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.native.compiler import PLATFORMS, PLATFORMS_3
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.run import start_parameters
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.build_system import build_system
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.timeline import timeline

BLOCKS = "Blocks, with their rates, signals and holds."
SHOWN = {
    "mechanism": "The mechanism in a reference run of the scene.",
    "distance": "Distance of handle and operational point in this run.",
}
"""Figures of a run, with their captions, on the page of a scene as one FMU."""
DPI = 90
"""Of these pictures, which are a part of the file."""


def build(
    scene: str | Path | Scene,
    options: Options = (),
    *,
    out: str | Path,
    all_platforms: bool = False,
    as_one: bool = False,
    without: str | None = None,
    fmi: int = 2,
) -> dict[str, Path]:
    """Build the FMUs of a scene, changed by `options`, in the folder `out`: `<block>.fmu` for each
    block. Returns the paths by block.

    The FMUs start as in the scene: the start value of a parameter that a connection of the scene
    sets once (the device's `x_start`) is the value that it gets there.

    `all_platforms` compiles native FMUs for Linux, Windows and macOS instead of this machine only.
    `as_one` builds one native FMU that holds all blocks with their rates and holds, by the name of
    the scene's file; without: a block that it leaves out, whose outputs become its inputs.
    `fmi`, 2 or 3, is the version of the standard of one FMU and of native ones; Python FMUs are of
    FMI 2.0.

    Raises InputFault if the scene is invalid, has nothing to build, cannot become one FMU, or `out`
    cannot be written to; Fault if the compiler fails.
    """
    if fmi not in (2, 3):
        raise InputFault(f"--fmi: {fmi!r} is not 2 or 3")
    read = open_scene.load(scene, options)
    if as_one:
        from hapticlink.programs.build import build_program  # loads casadi

        name = scene if isinstance(scene, str | Path) else read.title
        path = build_program(
            read,
            name,
            out=out,
            without=without,
            all_platforms=all_platforms,
            fmi=fmi,
            pictures=lambda: _pictures(read),
        )
        return {path.stem: path}
    if without:
        raise InputFault("--without leaves a block out of one FMU: add --as-one")
    for option, given in (("--all-platforms", all_platforms), ("--fmi 3", fmi == 3)):
        if given and read.packaging != "native":
            raise InputFault(f"{option} compiles: add --set packaging=native")
    planned = blocks(read)
    if not planned.built:
        raise InputFault(f"{read.title}: nothing to build: its FMUs are given as files")
    folder = folders.ensure(out)
    starts = _starts(read)
    with temporary_folders.temporary_folder() as room:
        platforms = {2: PLATFORMS, 3: PLATFORMS_3}[fmi] if all_platforms else ()
        files = fmu_files(read, planned, timeline(read, planned), room, platforms, starts, fmi)
        for name, path in files.items():
            with atomic_file(folder / f"{name}.fmu") as unfinished:
                shutil.copyfile(path, unfinished)
    return {name: folder / f"{name}.fmu" for name in files}


def export(scene: str | Path | Scene, options: Options = (), *, out: str | Path) -> Path:
    """Write a scene, changed by `options`, as the SSP `out`, and return its path: FMUs, connections
    and start values for other tools; rates and holds, which the standard does not have, in an
    annotation. `run` can read the SSP.

    Raises InputFault for a scene that cannot be run, or if `out` cannot be written.
    """
    from hapticlink.orchestrator.ssp import write  # its XML parsers are slow to load

    read = open_scene.load(scene, options, takes=("start_time",))
    with build_system(read, _starts(read)) as system:
        for line in uneven(system.timeline):
            logging.getLogger(__name__).warning(line)
        return write.write_ssp(read, start_parameters.apply_initial_connections(system), Path(out))


def _pictures(scene: Scene) -> dict[str, bytes]:
    """PNGs by caption: the blocks of a scene and, as far as it gets, a reference run of it."""
    from hapticlink.orchestrator.experiment import simulate
    from hapticlink.visualization.figure_files import encode
    from hapticlink.visualization.figures import block_diagram, run_figures

    with temporary_folders.temporary_folder() as room:
        run = simulate(scene, room, in_memory=True, csv=False)
        pictures = {BLOCKS: encode(block_diagram.figure(run.system, scene.title), "png", DPI)}
        drawn = run_figures.drawings(run.results)
        return pictures | {
            caption: encode(drawn[name](), "png", DPI)
            for name, caption in SHOWN.items()
            if name in drawn
        }


def uneven(timeline: Timeline) -> Iterator[str]:
    """A line for each rate whose steps are no whole number of haptic ones: tools that take whole
    decimation factors step it at other instants than `run` does."""
    haptics, *others = timeline.clocks
    for clock in others:
        if clock.longest != clock.shortest or clock.longest % haptics.longest:
            factor = float(Fraction(clock.longest, haptics.longest))
            yield (
                f"a step of {clock.name} is {factor:.4g} of the haptic ones: tools that step FMUs "
                "at whole multiples of the fastest rate, such as libcosim, run them at other "
                f"instants; take a {clock.name} rate that divides the haptic one"
            )


def _starts(scene: Scene) -> dict[str, dict[str, tuple[float, ...]]]:
    if not (scene.device or scene.connection or scene.fmu):
        return {}  # a mechanism alone, which no connection starts: its FMU is built once
    # Python FMUs give the same values as native ones, and need no compiler.
    with build_system(replace(scene, packaging="python")) as system:
        return start_parameters.by_port(system)
