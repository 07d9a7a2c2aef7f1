"""What a scene's [record] names: outputs, and other variables of FMUs, which are then read as
outputs are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from hapticlink.orchestrator.base.errors import near
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.fmi.variables import WRITTEN, Scalar
from hapticlink.orchestrator.scene.scene_tables import RecordTable
from hapticlink.orchestrator.scene.toml_keys import Problem
from hapticlink.orchestrator.system.connections import with_texts
from hapticlink.orchestrator.system.system import Connection, Fmu, SlowerTable, System

ANYTHING = "*"


def read_recorded(fmu: Fmu, record: RecordTable, connections: Iterable[Connection]) -> Fmu:
    """The FMU, of which those variables are recorded that the scene names and that are no outputs:
    locals, inputs, parameters. What only an active clock lets be read is not. A text is recorded
    where it is named, an output, too."""
    patterns = () if isinstance(record.signals, str) else record.signals
    if not patterns:
        return with_texts(fmu, connections, set())

    def is_named(s: Scalar) -> bool:
        names = (fmu.name, f"{fmu.name}.{s.port}", f"{fmu.name}.{s.name}")
        named = any(_fits(pattern, names[s.causality != "output" :]) for pattern in patterns)
        return named and not s.clocks and s.causality != "independent"

    texts = {s.port for s in fmu.description.strings if is_named(s)}
    fmu = with_texts(fmu, connections, texts)
    asked = {s.name for s in fmu.description.scalars if s.causality != "output" and is_named(s)}
    if not asked:
        return fmu
    scalars = tuple(replace(s, recorded=s.name in asked) for s in fmu.description.scalars)
    return replace(fmu, description=replace(fmu.description, scalars=scalars))


def _fits(pattern: str, names: Iterable[str]) -> bool:
    """Whether one of the names is `pattern`, in which `*` stands for anything."""
    text = re.compile(".*".join(map(re.escape, pattern.split(ANYTHING))), re.DOTALL)
    return any(text.fullmatch(name) for name in names)


def choose_outputs(
    record: RecordTable, system: System, problems: list[Problem]
) -> tuple[str, ...] | None:
    """The variables that are written, `fmu.variable`, in the order of the FMUs; None for all
    outputs; texts where a list names them. Adds a problem for each name that is none of an FMU, a
    port or a variable, and each pattern that fits none."""
    called = {
        f"{fmu.name}.{s.name}": {fmu.name, f"{fmu.name}.{s.port}", f"{fmu.name}.{s.name}"}
        for fmu in system.fmus
        for s in fmu.description.outputs
        if s.type not in WRITTEN or not isinstance(record.signals, str)
    }
    if record.signals == "all":
        every = sum(len(fmu.description.outputs) for fmu in system.fmus)
        return None if len(called) == every else tuple(called)
    if record.signals == "none":
        chosen: set[str] = set()
    elif record.signals == "connected":
        chosen = {f"{c.source}.{s.name}" for c in system.connections for s in c.outputs}
    else:
        known = list(dict.fromkeys(name for names in called.values() for name in sorted(names)))
        chosen = {name for name in known if any(_fits(asked, [name]) for asked in record.signals)}
        problems += [
            (("record", "signals", i), _why_nothing(name, system, known))
            for i, name in _places(record.signals)
            if not _fits(name, known)
        ]
    return tuple(name for name, names in called.items() if names & chosen)


def choose_slower(
    record: RecordTable, system: System, problems: list[Problem]
) -> dict[str, SlowerTable]:
    """The tables, `<clock>_<rate>hz`, of outputs with a rate of rows below that of their clock;
    those with a higher one have its. Adds a problem for each that is no whole part of the
    clock's."""
    tables: dict[str, SlowerTable] = {}
    told = set[tuple[str, str]]()
    asked = record.signals if isinstance(record.signals, Mapping) else {}
    for fmu in system.fmus:
        clock = system.timeline.clock(fmu.clock)
        for s in fmu.description.outputs if asked else ():
            names = (fmu.name, f"{fmu.name}.{s.port}", f"{fmu.name}.{s.name}")
            pattern = next((p for p in asked if _fits(p, names[s.causality != "output" :])), None)
            if pattern is None or (pattern, clock.name) in told:
                continue
            rate = exact(asked[pattern])
            own = 1 / (clock.period * system.timeline.base) if clock.period else None
            if own is None or (own > rate and own % rate):
                told.add((pattern, clock.name))
                why = _why_not_at(rate, clock.name, own)
                problems.append((("record", "signals", pattern), why))
            elif own > rate:
                table = f"{clock.name}_{float(rate):g}hz"
                others = tables[table].outputs if table in tables else frozenset[str]()
                outputs = others | {f"{fmu.name}.{s.name}"}
                tables[table] = SlowerTable(clock.name, int(own / rate), outputs)
    return tables


def _why_not_at(rate: Fraction, clock: str, own: Fraction | None) -> str:
    if own is None:
        return f"the rate of {clock} varies, of which {float(rate):g} Hz is no part: take `every`"
    less, more = (float(own / n) for n in (math.ceil(own / rate), own // rate))
    return (
        f"{float(rate):g} Hz is no whole part of the {float(own):g} Hz of {clock}, at whose "
        f"communication points rows are: take {less:.6g} or {more:.6g}"
    )


def _places(asked: Sequence[str] | Mapping[str, float]) -> Iterable[tuple[int | str, str]]:
    return zip(asked, asked, strict=True) if isinstance(asked, Mapping) else enumerate(asked)


def _why_nothing(name: str, system: System, known: Sequence[str]) -> str:
    """Why nothing that is recorded fits, and what was meant: there are too many outputs to list."""
    fmus = [fmu.name for fmu in system.fmus]
    if name in fmus:
        return f"{name!r} has no output; '{name}.*' are all of its variables"
    hint = near(name, [*fmus, *known])
    if hint.startswith("there are"):
        hint = f"the FMUs are {', '.join(fmus)}; --explain tells what is recorded"
    return f"{name!r} is no FMU, nor variable of one; {hint}"
