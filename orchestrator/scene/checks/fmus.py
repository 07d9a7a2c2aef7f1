"""What [[fmu]], [[connection]] and [faults] must say before any FMU is opened; `wiring` checks them
against the FMUs themselves. Each check yields (path in the file, message with remedy)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path as FilePath

from hapticlink.orchestrator.base.faults import unknown
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check(scene: Scene) -> Iterator[Problem]:
    """Every fault found, in the order of the file."""
    taken = [b.name for b in blocks(scene)]
    for i, fmu in enumerate(scene.fmu):
        path: Path = ("fmu", i)
        if not re.fullmatch(r"\w+", fmu.name):
            yield (*path, "name"), f"{fmu.name!r}: letters, digits and _ only; others write name.y"
        elif fmu.name in taken:
            yield (*path, "name"), f"{fmu.name!r} is taken: give every FMU and block its own name"
        taken.append(fmu.name)
        if not FilePath(fmu.path).is_file():
            yield (*path, "path"), f"there is no file {fmu.path}"
    for i, wire in enumerate(scene.connection):
        for key, end in (("from", wire.from_), ("to", wire.to)):
            fmu_name, dot, variable = end.partition(".")
            if not dot or not variable:
                yield ("connection", i, key), f"{end!r}: write fmu.variable"
            elif fmu_name not in taken:
                yield ("connection", i, key), unknown("FMU", fmu_name, taken)
        if wire.hold is not None and wire.hold not in HOLDS:
            yield ("connection", i, "hold"), unknown("hold", wire.hold, HOLDS)
        if wire.factor == 0:
            yield ("connection", i, "factor"), "0.0 passes nothing on: take the connection out"
