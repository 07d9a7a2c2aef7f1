"""Connections of the loop's own rows and of [[connection]] tables: two ends, found in the FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import SAME, Linear, conversion
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.records import Wire
from hapticlink.orchestrator.scene.toml_keys import Path, Problem
from hapticlink.orchestrator.system.fmu_tables import outputs, settable
from hapticlink.orchestrator.system.system import Connection


def connect(
    wires: Iterable[tuple[Path, Wire]],
    described: Mapping[str, Description],
    problems: list[Problem],
) -> Iterator[tuple[Path, Connection]]:
    """The connection of each wire between `described` FMUs, on which no hold stands yet; those that
    cannot be go to `problems`, by the path of the wire."""
    fed: dict[tuple[str, str], str] = {}
    for path, wire in wires:
        (giver, output), (taker, entry) = (e.split(".", 1) for e in (wire.from_, wire.to))
        given: tuple[Scalar, ...] = ()
        inputs: tuple[Scalar, ...] = ()
        try:
            given = outputs(described[giver], output)
        except ValueError as error:
            problems.append(((*path, "from"), str(error)))
        try:
            inputs = settable(described[taker], entry)
        except ValueError as error:
            problems.append(((*path, "to"), str(error)))
        if not given or not inputs:
            continue
        try:
            inputs = _converted(wire, described[giver], given, described[taker], inputs)
        except ValueError as error:
            problems.append((path, str(error)))
            continue
        made = Connection(giver, output, taker, entry, given, inputs)
        twice = [s.name for s in inputs if (taker, s.name) in fed]
        if twice:
            message = f"{taker}.{twice[0]} is fed by {fed[taker, twice[0]]} already; keep one"
            problems.append(((*path, "to"), message))
            continue
        fed |= {(taker, s.name): wire.from_ for s in inputs}
        yield path, made


def whole(
    asked: Iterable[tuple[Path, Connection]],
    rows: Iterable[Wire],
    described: Mapping[str, Description],
) -> Iterator[Problem]:
    """Connections to some entries of a vector that the loop's own `rows` feed: they take the place
    of such a row, and the other entries would have no source."""
    sources, asked = {row.to: row.from_ for row in rows}, tuple(asked)
    fed = {(c.target, s.name) for _, c in asked for s in c.inputs}
    for path, c in asked:
        port = c.inputs[0].port
        source = sources.get(f"{c.target}.{port}")
        entries = described[c.target].port(port, "input")
        if source and any((c.target, s.name) not in fed for s in entries):
            message = f"the other entries of {port} lose their source, {source}; connect all"
            yield (*path, "to"), message


def _converted(
    wire: Wire,
    giver: Description,
    given: tuple[Scalar, ...],
    taker: Description,
    inputs: tuple[Scalar, ...],
) -> tuple[Scalar, ...]:
    """The inputs with what the connection does to their values. Raises ValueError."""
    if len(given) != len(inputs) or inputs[0].type == "String":
        sizes = f"{wire.from_} has {len(given)} numbers, {wire.to} takes {len(inputs)}"
        raise ValueError(f"{sizes}; connect their entries one by one")
    found = []
    for a, b in zip(given, inputs, strict=True):
        units = SAME
        if wire.convert:
            try:
                units = conversion(giver.unit(a), taker.unit(b), a.relative or b.relative)
            except ValueError as error:
                raise ValueError(
                    f"{a.name} is in {a.unit}, {b.name} in {b.unit}: {error}; connect signals of "
                    "one kind, or say convert = false"
                ) from None
        found.append(replace(b, conversion=Linear(wire.factor, wire.offset).after(units)))
    return tuple(found)
