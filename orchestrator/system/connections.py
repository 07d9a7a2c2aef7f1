"""Resolves the haptic loop's wires and [[connection]] tables to variables of the FMUs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.units import SAME, Linear, conversion
from hapticlink.orchestrator.fmi.variables import WRITTEN, Scalar
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, collect_problem
from hapticlink.orchestrator.system.fmu_tables import outputs, settable
from hapticlink.orchestrator.system.system import Connection, Fmu


def connect(
    wires: Iterable[tuple[Path, Wire]],
    described: Mapping[str, Description],
    problems: list[Problem],
) -> Iterator[tuple[Path, Connection]]:
    """The connection, without a hold yet, of each wire between the `described` FMUs. What cannot be
    connected is appended to `problems`, at the wire's path."""
    fed: dict[tuple[str, str], str] = {}
    for path, wire in wires:
        (source, output), (target, entry) = (e.split(".", 1) for e in (wire.from_, wire.to))
        scalars: tuple[Scalar, ...] = ()
        inputs: tuple[Scalar, ...] = ()
        with collect_problem(problems, (*path, "from")):
            scalars = outputs(described[source], output)
        with collect_problem(problems, (*path, "to")):
            inputs = settable(described[target], entry)
        if not scalars or not inputs:
            continue
        converted: tuple[Scalar, ...] = ()
        with collect_problem(problems, path):
            converted = _convert(wire, described[source], scalars, described[target], inputs)
        if not (inputs := converted):
            continue
        twice = [s.name for s in inputs if (target, s.name) in fed]
        if twice:
            message = f"{target}.{twice[0]} is fed by {fed[target, twice[0]]} already; keep one"
            problems.append(((*path, "to"), message))
            continue
        fed |= {(target, s.name): wire.from_ for s in inputs}
        yield path, Connection(source, output, target, entry, scalars, inputs)


def with_texts(fmu: Fmu, connections: Iterable[Connection], recorded: Collection[str]) -> Fmu:
    """The FMU with those Strings and Binaries among its scalars that are connected or `recorded`:
    each is read or set at every communication point, by Python."""
    taken = [s for c in connections if c.source == fmu.name for s in c.outputs]
    given = [s for c in connections if c.target == fmu.name for s in c.inputs]
    texts = {s.port for s in (*taken, *given) if s.type in WRITTEN} | {*recorded}
    if not texts:
        return fmu
    scalars, strings = list(fmu.description.scalars), list[Scalar]()
    for s in fmu.description.strings:
        (scalars if s.port in texts else strings).append(s)
    about = replace(fmu.description, scalars=tuple(scalars), strings=tuple(strings))
    return replace(fmu, description=about)


def check_partial_vectors(
    asked: Iterable[tuple[Path, Connection]],
    rows: Iterable[Wire],
    described: Mapping[str, Description],
) -> Iterator[Problem]:
    """A finding for each connection to only some entries of a vector that the haptic loop's `rows`
    feed: it replaces the row, and would leave the other entries without a source."""
    sources, asked = {row.to: row.from_ for row in rows}, tuple(asked)
    fed = {(c.target, s.name) for _, c in asked for s in c.inputs}
    for path, c in asked:
        port = c.inputs[0].port
        source = sources.get(f"{c.target}.{port}")
        entries = described[c.target].port(port, "input")
        if source and any((c.target, s.name) not in fed for s in entries):
            message = f"the other entries of {port} lose their source, {source}; connect all"
            yield (*path, "to"), message


def _convert(
    wire: Wire,
    source: Description,
    outputs: tuple[Scalar, ...],
    target: Description,
    inputs: tuple[Scalar, ...],
) -> tuple[Scalar, ...]:
    """The inputs with the conversion of the wire: units, then its factor and offset, then what the
    scene's `map` makes of the input. Raises
    ValueError for different sizes, texts, and units that cannot be converted."""
    text = next((s for s in (*outputs, *inputs) if s.type in WRITTEN), None)
    if text and {(s.type, s.causality) for s in inputs} != {(outputs[0].type, "input")}:
        what = f"a {text.type} output is connected to a {text.type} input only"
        table = "; a String input also takes a table of texts, those of a CSV in quotes"
        raise ValueError(f"{text.name} is a {text.type}: {what}{table * (text in inputs)}")
    if len(outputs) != len(inputs):
        sizes = f"{wire.from_} has {len(outputs)} numbers, {wire.to} takes {len(inputs)}"
        raise ValueError(f"{sizes}; connect their entries one by one")
    converted = []
    for a, b in zip(outputs, inputs, strict=True):
        if (a.type == "Clock") != (b.type == "Clock"):
            clock = a if a.type == "Clock" else b
            raise ValueError(f"{clock.name} is a clock, which is connected to a clock only")
        units = SAME
        if wire.convert:
            try:
                units = conversion(source.unit(a), target.unit(b), a.relative or b.relative)
            except ValueError as error:
                raise ValueError(
                    f"{a.name} is in {a.unit}, {b.name} in {b.unit}: {error}; connect quantities "
                    "of one dimension, or write convert = false"
                ) from None
        given = b.conversion.after(Linear(wire.factor, wire.offset).after(units))
        converted.append(b if b.conversion == given else replace(b, conversion=given))
    return tuple(converted)
