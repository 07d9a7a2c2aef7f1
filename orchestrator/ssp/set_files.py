"""Parameter sets in files of their own (.ssv) as options of a scene: start values of its FMUs.

A file is bound to the root system of an SSP, after all bindings in it (`parameters`). In any other
scene `fmu.variable` is a variable of an [[fmu]].
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from urllib.parse import quote
from xml.etree.ElementTree import Element

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.ssp import read
from hapticlink.orchestrator.ssp.connections import Wires
from hapticlink.orchestrator.ssp.parameters import Parameters
from hapticlink.orchestrator.ssp.tree import File, SsdElement


def options(scene: Scene, files: Iterable[Path]) -> tuple[str, ...]:
    """The options `fmu.NAME.start.VARIABLE=value` that the sets in `files` amount to, later ones
    last. Values that match nothing are logged. Raises InputFault for a file that cannot be read."""
    bindings = tuple(map(_binding, files))
    path = Path(scene.source.name if scene.source else scene.title)
    if path.suffix == ".ssp":
        with read.structure(path) as (_, system, described):
            bound = replace(system.everywhere(bindings=()), bindings=bindings)
            wires = Wires(path, bound, described)
            names = read.names(described)
    else:
        own = {(f.name,): f for f in scene.fmu if f.path}
        described = {place: describe(Path(str(f.path))) for place, f in own.items()}
        described = read.resize_arrays(described, {place: f.start for place, f in own.items()})
        parts = tuple(SsdElement(place, {}, ()) for place in own)
        wires = Wires(path, SsdElement((), {}, bindings, parts=parts), described)
        names = {place: f.name for place, f in own.items()}
    return overrides.write_options(
        {
            f"fmu.{names[place]}.start.{json.dumps(variable)}": value
            for place, starts in Parameters(wires).starts().items()
            for variable, value in starts.items()
        }
    )


def _binding(path: Path) -> tuple[File, Element]:
    """A parameter binding of the set in a file, as if that were in an archive."""
    archive = zipfile.ZipFile(BytesIO(), "a")
    archive.filename = str(path)
    try:
        archive.writestr(zipfile.ZipInfo(path.name), path.read_bytes())  # dated by no clock
    except OSError as error:
        raise InputFault(f"--set-file {path}: {error.strerror}; give an .ssv") from None
    return File(path, archive), Element("ParameterBinding", source=quote(path.name))
