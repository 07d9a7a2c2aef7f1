"""Reads an SSP as the tables of a scene. An exported scene is restored exactly; an SSP of another
tool may need a duration and a rate.

Components become [[fmu]], those of inner systems by their full names (`outer_inner`); connections
become [[connection]] (one for entries that form whole vectors), parameter values `start`.
Connections to the outside of the root system have no counterpart in a scene and are left out. What
cannot be read is an error.
"""

from __future__ import annotations

import atexit
import hashlib
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from hapticlink.fmus import cache
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.archive import open_archive
from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.ssp import annotation
from hapticlink.orchestrator.ssp.connections import Row, Wires
from hapticlink.orchestrator.ssp.names import SSD
from hapticlink.orchestrator.ssp.parameters import Parameters
from hapticlink.orchestrator.ssp.tree import File, Place, SsdElement, Tree, join_place


def tables(path: Path) -> dict[str, Any]:
    """The tables of the SSP's scene; its FMUs are unpacked into the cache. Raises InputFault, with
    file and element, for what is malformed or not supported."""
    with structure(path) as (root, system, described):
        wires = Wires(path, system, described)
        starts = Parameters(wires).starts()
    rest, named = annotation.read_run_annotation(path, root), names(described)
    tables: dict[str, Any] = {
        "title": root.get("description") or root.get("name") or path.stem,
        **rest,
    }
    about = rest.get("fmu", {})
    tables["fmu"] = [
        {"path": str(fmu.path), "start": starts[place], "name": named[place]}
        | ({"interface": "model-exchange"} if fmu.equations else {})
        | about.get(join_place(place), {})
        for place, fmu in described.items()
    ]
    tables["connection"] = [
        {"from": f"{named[a]}.{p}", "to": f"{named[b]}.{q}", **how}
        for (a, p), (b, q), how in _group_vectors(wires.rows, described)
    ] + rest.get("connection", [])
    _experiment(path, tables, root, described.values())
    return tables


@contextmanager
def structure(path: Path) -> Iterator[tuple[Element, SsdElement, dict[Place, Description]]]:
    """The content of SystemStructure.ssd, its root system with all files open, and the FMUs with
    arrays of the sizes that the parameters give them."""
    with open_archive(path, "SSP") as archive, _room() as room, ExitStack() as archives:
        root, system = Tree(archives).root(File(path, archive))
        described = _describe_components(system, room)
        # The ends of connections exist once arrays have their sizes.
        unconnected = Wires(path, system.everywhere(lines=()), described)
        yield root, system, resize_arrays(described, Parameters(unconnected).values())


@contextmanager
def _room() -> Iterator[Path]:
    """Where FMUs land with the cache off, to the end of this process, which may run the scene."""
    room = Path(temporary_folders.make_folder())
    atexit.register(shutil.rmtree, room, ignore_errors=True)
    try:
        yield room
    finally:
        with suppress(OSError):  # there is something in it
            room.rmdir()


def _experiment(
    path: Path, tables: dict[str, Any], root: Element, described: Iterable[Description]
) -> None:
    """Adds duration and rate where there is no annotation: the SSP's default experiment, and the
    shortest step size of the FMUs' default experiments. `open_scene` reports those that remain
    missing."""
    experiment = root.find(f"{{{SSD}}}DefaultExperiment")
    if experiment is not None:
        start, stop = experiment.get("startTime", "0"), experiment.get("stopTime")
        if float(start):
            tables["start_time"] = float(start)
        if "duration" not in tables and stop:
            try:
                tables["duration"] = float(exact(stop) - exact(start))
            except ValueError:  # an infinite one, which a scene refuses
                tables["duration"] = float(stop) - float(start)
    steps = [_seconds(d.step_size) for d in described if d.step_size]
    if "haptics" not in tables and steps and all(steps):
        tables["haptics"] = {"rate": str(1 / min(steps))}


def _seconds(text: str) -> Fraction:
    """A step size; 0 for what is none."""
    try:
        return max(exact(text), Fraction(0))
    except (ValueError, ZeroDivisionError):
        return Fraction(0)


def names(places: Iterable[Place]) -> dict[Place, str]:
    """The name of each component in [[fmu]]: its own, numbered where it is not unique."""
    named: dict[Place, str] = {}
    counts: dict[str, int] = {}  # by the names that are taken
    for place in places:
        name = wanted = re.sub(r"\W", "_", "_".join(place))
        while name in counts:
            counts[wanted] += 1
            name = f"{wanted}_{counts[wanted]}"
        counts[name], named[place] = 1, name
    return named


def _describe_components(system: SsdElement, room: Path) -> dict[Place, Description]:
    """The FMU of each component; an entry that several of them have is read once."""
    known: dict[tuple[Path, str, str | None], Description] = {}
    fmus = {}
    for part in system:
        if part.source:
            file, entry = part.source
            key = file.path, entry, part.interface
            if key not in known:
                unpacked = _unpack_fmu(room, file, entry, part.place)
                try:
                    known[key] = describe(unpacked, interface=part.interface)
                except InputFault as why:
                    cache.forget(unpacked)
                    where = f"{file.path}: {join_place(part.place)}: {entry}"
                    raise InputFault(str(why).replace(str(unpacked), where)) from None
            fmus[part.place] = known[key]
    return fmus


def resize_arrays(
    described: Mapping[Place, Description], starts: Mapping[Place, Mapping[str, Any]]
) -> dict[Place, Description]:
    """The FMUs with arrays of the sizes that their structural parameters get."""
    fmus = {}
    for place, description in described.items():
        structural = {s.name for s in description.scalars if s.structural}
        sizes = {n: int(v) for n, v in starts[place].items() if n in structural}
        fmus[place] = describe(description.path, sizes) if sizes else description
    return fmus


def _unpack_fmu(room: Path, file: File, source: str, place: Place) -> Path:
    """The FMU at an entry of the archive, in the cache, or in `room` where that is off."""
    archive = file.archive
    if source not in archive.NameToInfo:
        held = ", ".join(n for n in archive.namelist() if n.endswith(".fmu")) or "none"
        where = f"{file.path}: {join_place(place)}"
        raise InputFault(f"{where}: there is no {source!r} in it; FMUs in it: {held}")
    stem = re.sub(r"\W", "_", Path(source).stem)
    name = f"{stem[:100]}.fmu"
    with archive.open(source) as content:
        digest = hashlib.file_digest(content, "sha256").hexdigest()  # type: ignore[arg-type]

    def unpack(folder: Path) -> Path:
        with archive.open(source) as content, (folder / name).open("wb") as unpacked:
            shutil.copyfileobj(content, unpacked)
        return folder / name

    return cache.get_or_build({"ssp": digest, "file": name}, unpack, room)


def _group_vectors(rows: list[Row], described: Mapping[Place, Description]) -> Iterator[Row]:
    """Rows, with those that connect two whole vectors entry by entry replaced by one."""
    i = 0
    while i < len(rows):
        (a, p), (b, q), how = rows[i]
        whole = entry_of(p)[0], entry_of(q)[0]
        outputs = described[a].port(whole[0], "output")
        inputs = described[b].port(whole[1], "input")
        pairs = zip(outputs, inputs, strict=False)
        wanted = [((a, s.name), (b, t.name), how) for s, t in pairs]
        n = len(wanted)
        if n > 1 and len(outputs) == len(inputs) and rows[i : i + n] == wanted:
            yield (a, whole[0]), (b, whole[1]), how
            i += n
        else:
            yield rows[i]
            i += 1
