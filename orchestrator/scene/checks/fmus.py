"""Checks [[fmu]] and [[connection]] before any FMU is opened; `system` checks them against the FMUs
themselves. Each check yields (path in the file, message with remedy)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.base.signal_names import SHARED
from hapticlink.orchestrator.scene.blocks import Blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import ForeignFmu
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check_fmus(scene: Scene, blocks: Blocks) -> Iterator[Problem]:
    taken = dict.fromkeys(b.name for b in blocks.own)
    for i, fmu in enumerate(scene.fmu):
        path: Path = ("fmu", i)
        if not re.fullmatch(r"\w+", fmu.name):
            yield (*path, "name"), f"{fmu.name!r}: letters, digits and _ only; others write name.y"
        elif fmu.name in taken:
            yield (*path, "name"), f"{fmu.name!r} is taken: give every FMU and block its own name"
        taken[fmu.name] = None
        yield from _source(path, fmu)
        yield from _velocity(path, fmu, scene)
        if fmu.map and fmu.replaces is None:
            yield (*path, "map"), "is of an FMU that replaces a block: lead [[connection]]s instead"
        if fmu.replaces is not None:
            yield from _replacement(path, fmu, [b.name for b in blocks.loop])
    for i, wire in enumerate(scene.connection):
        for key, end in (("from", wire.from_), ("to", wire.to)):
            fmu_name, dot, variable = end.partition(".")
            if not dot or not variable:
                yield ("connection", i, key), f"{end!r}: write fmu.variable"
            elif fmu_name not in taken:
                yield ("connection", i, key), unknown("FMU", fmu_name, taken)
        if wire.factor == 0:
            yield ("connection", i, "factor"), "0.0 passes nothing on: take the connection out"


def _source(path: Path, fmu: ForeignFmu) -> Iterator[Problem]:
    """Problems unless the FMU is a file, a block to build or one by an engine."""
    if fmu.engine is not None:
        if fmu.replaces not in SHARED:
            file = f"give `path`, an FMU with the ports of {fmu.replaces}"
            remedy = file if fmu.replaces else "say which by `replaces`"
            can_be = f"{fmu.engine} can be {' and '.join(SHARED)} alone"
            yield (*path, "engine"), f"{can_be}: {remedy}"
        for key in ("path", "block", "settings", "tolerance"):
            if getattr(fmu, key):
                yield (
                    (*path, key),
                    "is not for an FMU by an engine: take one of them out",
                )
        return
    if fmu.path is None and fmu.block is None:
        yield (*path, "block"), "is missing, and so is path: give a block to build or an FMU's file"
    if fmu.path is not None and not text_files.exists(fmu.path):
        yield (*path, "path"), f"there is no file {fmu.path}"
    if fmu.block is not None and fmu.tolerance is not None:
        yield (*path, "tolerance"), "is for a solver in a file: take it out, or give path for block"
    for key in ("block", "settings"):
        if fmu.path is not None and getattr(fmu, key):
            yield (*path, key), "is not for an FMU that is a file: take it out, or take path out"


def _velocity(path: Path, fmu: ForeignFmu, scene: Scene) -> Iterator[Problem]:
    """A problem if a wall's damper acts on a measured velocity that nothing feeds."""
    settings = fmu.settings or {}
    acts = settings.get("damping") is not None or settings.get("pulse") is not None
    if fmu.block != "virtual_wall" or settings.get("velocity") != "measured" or not acts:
        return
    if "v" not in fmu.start and all(wire.to != f"{fmu.name}.v" for wire in scene.connection):
        yield (
            (*path, "settings", "velocity"),
            f"'measured', but nothing feeds {fmu.name}.v, so that its damper never acts: connect "
            "a velocity to it, or take velocity = 'difference'",
        )


def _replacement(path: Path, fmu: ForeignFmu, known: Collection[str]) -> Iterator[Problem]:
    """Problems unless it replaces one of the `known` blocks under that one's name."""
    assert fmu.replaces is not None
    if fmu.replaces not in known:
        yield (*path, "replaces"), unknown("block", fmu.replaces, known)
    elif fmu.name != fmu.replaces:
        yield (*path, "name"), f"{fmu.name!r}: it has that of {fmu.replaces}; leave it out"
