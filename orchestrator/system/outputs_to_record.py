"""What a scene's [record] names: outputs, and other variables of FMUs, which are then read as
outputs are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from hapticlink.orchestrator.base.errors import near
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
        can_be = not s.clocks and s.causality != "independent"
        return can_be and _find_pattern(patterns, fmu, s) is not None

    texts = {s.port for s in fmu.description.strings if is_named(s)}
    fmu = with_texts(fmu, connections, texts)
    asked = {s.name for s in fmu.description.scalars if s.causality != "output" and is_named(s)}
    if not asked:
        return fmu
    scalars = tuple(replace(s, recorded=s.name in asked) for s in fmu.description.scalars)
    return replace(fmu, description=replace(fmu.description, scalars=scalars))


def _names(fmu: Fmu, s: Scalar) -> tuple[str, ...]:
    """What a variable is called; all outputs of an FMU by its name, too."""
    names = (fmu.name, f"{fmu.name}.{s.port}", f"{fmu.name}.{s.name}")
    return names[s.causality != "output" :]


def _find_pattern(patterns: Iterable[str], fmu: Fmu, s: Scalar) -> str | None:
    """The first pattern that a variable fits."""
    return next((pattern for pattern in patterns if _fits(pattern, _names(fmu, s))), None)


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
        f"{fmu.name}.{s.name}": _names(fmu, s)
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
        by_name = isinstance(record.signals, Mapping)
        known = [*dict.fromkeys(chain(*called.values()))]
        chosen = {name for name in known if any(_fits(asked, [name]) for asked in record.signals)}
        problems += [
            (("record", "signals", name if by_name else i), _why_nothing(name, system, known))
            for i, name in enumerate(record.signals)
            if not _fits(name, known)
        ]
    return tuple(name for name, names in called.items() if chosen.intersection(names))


def choose_slower(
    record: RecordTable, system: System, problems: list[Problem]
) -> dict[str, SlowerTable]:
    """The tables, `<clock>_<rate>hz`, of outputs with a rate of rows below that of their clock;
    those with a higher one have its. Adds a problem for each that is, to six digits, no whole part
    of the clock's."""
    tables: dict[str, SlowerTable] = {}
    told = set[tuple[str, str]]()
    asked = record.signals if isinstance(record.signals, Mapping) else {}
    for fmu in system.fmus:
        clock = system.timeline.clock(fmu.clock)
        for s in fmu.description.outputs if asked else ():
            if (pattern := _find_pattern(asked, fmu, s)) is None or (pattern, clock.name) in told:
                continue
            own = clock.period and float(1 / (clock.period * system.timeline.base))
            every = max(round(own / asked[pattern]), 1) if own else 0
            if not own or f"{own / every:g}" != f"{min(asked[pattern], own):g}":
                told.add((pattern, clock.name))
                why = _why_not_at(asked[pattern], clock.name, own)
                problems.append((("record", "signals", pattern), why))
            elif every > 1:
                table = f"{clock.name}_{own / every:g}hz"
                before = tables[table].outputs if table in tables else ()
                outputs = (*before, f"{fmu.name}.{s.name}")
                tables[table] = SlowerTable(clock.name, every, outputs)
    return tables


def _why_not_at(rate: float, clock: str, own: float | None) -> str:
    if not own:
        return f"the rate of {clock} varies, of which {rate:g} Hz is no part: take `every`"
    less, more = own / math.ceil(own / rate), own / math.floor(own / rate)
    return (
        f"{rate:g} Hz is no whole part of the {own:g} Hz of {clock}, at whose communication points "
        f"rows are: take {less:g} or {more:g}"
    )


def _why_nothing(name: str, system: System, known: Sequence[str]) -> str:
    """Why nothing that is recorded fits, and what was meant: there are too many outputs to list."""
    fmus = [fmu.name for fmu in system.fmus]
    if name in fmus:
        return f"{name!r} has no output; '{name}.*' are all of its variables"
    hint = near(name, [*fmus, *known])
    if hint.startswith("there are"):
        hint = f"the FMUs are {', '.join(fmus)}; --explain tells what is recorded"
    return f"{name!r} is no FMU, nor variable of one; {hint}"
