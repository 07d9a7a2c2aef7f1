"""Builds the FMU of a scene as one program."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from hapticlink.components.component import Component
from hapticlink.fmus import cache, model_description
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.blocks import component
from hapticlink.fmus.description_common import CAPABILITIES
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.fmus.native.compiler import (
    FLAGS,
    PLATFORMS,
    PLATFORMS_3,
    binaries,
    compiler_version,
    host_platform,
)
from hapticlink.fmus.native.fmi3_interface import fmi3_sources
from hapticlink.fmus.reproducible_zip import digest, guid_of
from hapticlink.fmus.write_fmu import write_fmu
from hapticlink.orchestrator.base import interrupt, temporary_folders
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.fmi.description import ONCE, SERIALISED, STATE
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.step_sizes import sizes
from hapticlink.programs.description import describe_program, make_documentation
from hapticlink.programs.foreign import write_files
from hapticlink.programs.ports import ports
from hapticlink.programs.resolve_scene import Resolved, resolve_scene
from hapticlink.programs.sources import identifiers, write_sources

OPTIONS = ("-DEXPORT=",)
"""The functions of the loop are not exported."""

Pictures = Callable[[], Mapping[str, bytes]]


def build_program(
    scene: Scene,
    name: str | Path,
    *,
    out: str | Path,
    without: str | None = None,
    all_platforms: bool = False,
    fmi: int = 2,
    pictures: Pictures = dict,
) -> Path:
    """Write a scene as one native FMU into the folder `out`, and return its path. It needs no
    Python, and its outputs have the bits of a run of the scene.

    name: of the scene or its file, by which the FMU is called.

    without: a block to leave out, whose outputs that others need are inputs of the FMU.
    all_platforms: compiles for Linux, Windows and macOS instead of this machine alone. fmi: 2 or 3,
    the version of the standard. pictures: gives PNGs for its page of documentation, by caption.
    Raises InputFault if the scene is invalid or cannot become a program, with what stands in the
    way; Fault if the compiler fails.
    """
    identifier = _identifier(name)
    with temporary_folders.temporary_folder() as room:
        try:
            compiler_version()
            every = PLATFORMS if fmi == 2 else PLATFORMS_3
            platforms = every if all_platforms else (host_platform(fmi),)
            files = program_files(scene, identifier, without, fmi, pictures)
            material = {"block": identifier, "program": digest(files), "platforms": platforms,
                        "compiler": [compiler_version(), *FLAGS]}  # fmt: skip

            def make(folder: Path) -> Path:
                return _build_and_check(files, identifier, platforms, folder)

            path = cache.get_or_build(material, make, room, interrupt.raise_if_interrupted)
        except CompilerError as error:
            interrupt.raise_if_interrupted()
            raise Fault(str(error)) from error
        except FmuError as error:
            raise InputFault(str(error)) from error
        target = folders.ensure(out) / f"{identifier}.fmu"
        with atomic_file(target) as unfinished:
            shutil.copyfile(path, unfinished)
    return target


def _identifier(name: str | Path) -> str:
    """The C identifier by which the FMU is called."""
    known = str(name).endswith((".toml", ".ssp"))
    plain = re.sub(r"\W", "_", Path(name).stem if known else Path(name).name, flags=re.ASCII)
    return plain if plain.isidentifier() else f"scene_{plain}"


def program_files(
    scene: Scene,
    identifier: str,
    without: str | None = None,
    fmi: int = 2,
    pictures: Pictures = dict,
) -> dict[str, bytes]:
    """All files of the FMU but its binaries. Raises InputFault as `build_program`."""
    with resolve_scene(scene, without) as program:
        blocks_of_members = components(program)
        variables = ports(program, blocks_of_members)
        texts = write_sources(program, blocks_of_members, variables)
        capable, resources = capabilities(program), dict(_resources(program))
        haptic = program.system.timeline.clocks[0]
        step_size = program.system.timeline.seconds(haptic.longest)
    if fmi == 3:
        texts |= fmi3_sources(variables)
    compiled = sorted(name for name in texts if name.endswith(".c") and "/" not in name)
    about = describe_program(scene, identifier, variables, capable=capable, step_size=step_size)
    content = {f"sources/{name}": text.encode() for name, text in texts.items()} | resources
    content |= make_documentation(scene, variables, pictures())
    whole = digest(content | model_description.files(about, "", fmi, compiled))
    guid = guid_of(whole)
    content["sources/scene.h"] = f'#define GUID "{guid}"\n'.encode() + content["sources/scene.h"]
    return content | model_description.files(about, guid, fmi, compiled)


def components(program: Resolved) -> dict[str, Component]:
    """The component of each member that is a block of this project, with the step sizes of the
    scene."""
    timeline, plans = program.system.timeline, {b.name: b for b in blocks(program.scene).built}
    by_member = {}
    for name in (n for n in program.members if n not in program.foreign):
        plan = plans[name]
        known = component(plan.block, plan.settings)
        steps = sizes(timeline.of[name], timeline)
        given = {v.name: (steps[v.name],) for v in known.parameters if v.name in steps}
        by_member[name] = component(plan.block, plan.settings, given) if given else known
    return by_member


def capabilities(program: Resolved) -> dict[str, str]:
    """What of CAPABILITIES the FMUs of others leave a program, as FMI 2.0 calls it."""
    flags = [foreign.description.flags for foreign in program.foreign.values()]
    capable = dict(CAPABILITIES)
    for name in (STATE["2"], SERIALISED):
        capable[name] = str(all(name in of for of in flags)).lower()
    capable[ONCE] = str(any(ONCE in of for of in flags)).lower()
    if flags:
        capable["canNotUseMemoryManagementFunctions"] = "false"
    return capable


def _resources(program: Resolved) -> Iterator[tuple[str, bytes]]:
    """The resources of FMUs of others, each in a folder of its own."""
    for fmu, id_ in identifiers(program.members).items():
        if fmu in program.foreign:
            for name, content in program.foreign[fmu].resources.items():
                yield f"resources/{id_}/{name}", content


def _build_and_check(
    files: Mapping[str, bytes], identifier: str, platforms: Sequence[str], folder: Path
) -> Path:
    """The FMU with a binary for each platform, written once FMPy finds nothing wrong with it."""
    with tempfile.TemporaryDirectory(dir=folder) as name:
        listed = (e for e in files if e.startswith("sources/"))
        texts = {e.removeprefix("sources/"): files[e].decode() for e in listed}
        room, compiled = Path(name), write_files(texts, Path(name))
        entries = {**files, **dict(binaries(compiled, identifier, room, platforms, OPTIONS))}
    return write_fmu(entries, folder, identifier)
