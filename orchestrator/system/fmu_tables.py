"""Reads the FMUs of [[fmu]] tables: descriptions, start values, and the scalars behind a name."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import attrgetter
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.fmi.description import Description, describe
from hapticlink.orchestrator.fmi.process_cache import describe_once
from hapticlink.orchestrator.fmi.start_values import Starts, fit_start_value
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import ForeignFmu, Value
from hapticlink.orchestrator.scene.toml_keys import Problem, collect_problem
from hapticlink.orchestrator.system.port_map import (
    Mapped,
    UnfitMap,
    in_units_of,
    map_ports,
    rename_ports,
    with_declarations,
)

if TYPE_CHECKING:
    from hapticlink.components.component import Component


def fmus(
    scene: Scene,
    files: Mapping[str, FilePath],
    replaced: Mapping[str, Component],
    problems: list[Problem],
) -> Iterator[tuple[ForeignFmu, Description, Starts, Mapped]]:
    """Each FMU that can be read, with its description, start values, and the ports that it calls
    otherwise than the block that it replaces; `files` are the FMUs built for blocks. Findings are
    appended to `problems`."""
    for i, fmu in enumerate(scene.fmu):
        try:
            description = _describe(files.get(fmu.name) or FilePath(fmu.path or ""), fmu)
        except InputFault as fault:
            problems.append((("fmu", i, "path"), str(fault)))
            continue
        block, names = replaced.get(fmu.name), Mapped()
        if block:
            try:
                names = map_ports(description, block, fmu.map)
            except UnfitMap as fault:
                problems.append((("fmu", i, "map", fault.port), str(fault)))
                continue
            description = in_units_of(rename_ports(description, names, block), block)
            description = with_declarations(description, block)
        if fmu.timing:
            description = replace(description, timing=fmu.timing)
        elif block and not description.declares_timing:
            description = replace(description, timing=block.timing)
        if fmu.tolerance is not None:
            description = replace(description, tolerance=fmu.tolerance)
        for name, derivative in fmu.derivatives.items():
            with collect_problem(problems, ("fmu", i, "derivatives", name)):
                description = _with_derivative(description, name, derivative)
        starts: Starts = ()
        for name, value in fmu.start.items():
            with collect_problem(problems, ("fmu", i, "start", name)):
                starts += _start(description, name, value)
        yield fmu, description, starts, names


def _describe(path: FilePath, fmu: ForeignFmu) -> Description:
    """The FMU with the sizes that `start` gives it by structural parameters. Raises InputFault."""
    description = describe_once(path, fmu.interface)
    structural = {s.name for s in description.scalars if s.structural}
    sizes = {n: v for n, v in fmu.start.items() if n in structural and type(v) is int}
    return describe(path, sizes, fmu.interface) if sizes else description


def _with_derivative(description: Description, name: str, derivative: str) -> Description:
    """The description with `derivative` declared as the derivative of `name`. Raises ValueError
    unless both are outputs of one size."""
    entries, slopes = outputs(description, name), outputs(description, derivative)
    if len(entries) != len(slopes):
        raise ValueError(f"{derivative} has {len(slopes)} entries for the {len(entries)} of {name}")
    declared = {a.name: b.name for a, b in zip(entries, slopes, strict=True)}
    return replace(description, derivatives={**description.derivatives, **declared})


def _start(description: Description, name: str, value: Value) -> Starts:
    """The start value of each scalar of `name`. Raises ValueError for a name that takes no start
    value, and for a value of a different size, type or range."""
    scalars = settable(description, name, start=True)
    given = entries_for(scalars, value, name)
    return tuple((s, fit_start_value(s, entry)) for s, entry in given)


def entries_for(scalars: Sequence[Scalar], value: Any, name: str) -> list[tuple[Scalar, Any]]:
    """The scalars of `name`, each with its entry of a value. Raises ValueError for a value of
    another size."""
    values = [*_entries_of(value, scalars[-1].indices, name)]
    if len(values) != len(scalars):
        raise ValueError(f"{len(values)} values for the {len(scalars)} of {name}")
    return [*zip(scalars, values, strict=True)]


def _entries_of(value: Any, shape: tuple[int, ...], name: str) -> Iterator[Any]:
    """The entries of a value, row by row. Raises ValueError for rows that do not fit `shape`."""
    if not isinstance(value, tuple):
        yield value
    elif not any(isinstance(row, tuple) for row in value):
        yield from value
    else:
        rows, size = (shape[0], math.prod(shape[1:])) if shape else (1, 1)
        entries = [tuple(_entries_of(row, shape[1:], name)) for row in value]
        sizes = [len(row) for row in entries]
        if sizes != [size] * rows:
            raise ValueError(f"rows of {sizes} values for the {rows} rows of {size} of {name}")
        yield from chain.from_iterable(entries)


def outputs(description: Description, name: str) -> tuple[Scalar, ...]:
    """The scalars of the output `name`. Raises ValueError where there is no such output."""
    texts = (s for s in description.strings if s.name == name and s.causality == "output")
    entries = description.port(name, "output") or tuple(texts)
    if not entries:
        others = [s for s in description.scalars if name in (s.name, s.port)]
        if others:
            raise ValueError(f"{name} is no output, its causality is {others[0].causality}")
        raise ValueError(
            unknown("output", name, dict.fromkeys(s.port for s in description.outputs))
        )
    return entries


def settable(description: Description, name: str, start: bool = False) -> tuple[Scalar, ...]:
    """The scalars of the input or parameter `name`: those that can be connected, or with `start`,
    those that take a start value. Raises ValueError where there are none."""
    able = attrgetter("startable" if start else "settable")
    every = (*description.scalars, *description.strings)
    named = [s for s in every if name in (s.name, s.port)]
    if not named:
        known = dict.fromkeys(s.port for s in filter(able, every))
        raise ValueError(unknown("input or parameter", name, known))
    if scalars := sorted(filter(able, named), key=lambda s: s.indices):
        return tuple(scalars)
    what = named[0].causality
    what = what if named[0].variability != "constant" else f"constant {what}"
    hint = ""
    if start:
        others = ", ".join(dict.fromkeys(s.port for s in description.scalars if able(s))) or "none"
        hint = (
            ", and the FMU gives it no start value (initial exact or approx); variables that take "
            f"one: {others}"
        )
    raise ValueError(f"{name} cannot be set: its causality is {what}{hint}")
