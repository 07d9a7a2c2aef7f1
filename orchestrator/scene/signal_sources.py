"""Connections from what is no FMU: a table, a recorded log, a formula over time.

    [[connection]]
    from = { table = { path = "log.csv", columns = ["time", "u"] }, interpolation = "hold" }
    to = "plant.u"

is an [[fmu]] with the block `signal` and these settings, and a connection from its output y. A
table of texts is the start value of its String, and an [[at]] for each other text that follows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field

from hapticlink.components.specs.paths import Interpolation
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.extends import tables_of
from hapticlink.orchestrator.scene.recorded_tables import (
    RecordedTable,
    read_recorded_table,
    read_recorded_texts,
    si_unit,
)
from hapticlink.orchestrator.scene.scene_tables import OWN, Wire
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, collect_problem

BLOCK = "signal"
_Row = tuple[Annotated[float, Quantity(OWN)] | str, ...]


@dataclass(frozen=True, kw_only=True)
class SignalSource:
    """A signal over time in the place of an output. A value acts from the target's step on that
    begins at its time or after."""

    table: tuple[_Row, ...] | RecordedTable | None = None
    """Rows of time (s) and values, sorted by time, the ends held; or a recorded log,
    `{ path, columns, units }`, such as the CSV of another run. Texts of a String are held until the
    next row."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next (steps)."""
    formula: str | tuple[str, ...] | None = None
    """In place of a table, a formula of t (s) in Python's notation, or one for each entry:
    `0.5*sin(2*pi*3*t)`, `where(t % 1 < 0.5, 1, 0)`."""
    units: tuple[str, ...] = ()
    """The SI unit of each value, for rows and formulas; without, they are in the input's."""


@dataclass(frozen=True, kw_only=True)
class WrittenWire(Wire):
    """A connection of a scalar or a whole vector, between any FMUs of the scene, or from a signal
    over time. A connection to an input of a block replaces the one that the haptic loop has
    there."""

    from_: Annotated[str | SignalSource, Field(alias="from")]  # type: ignore[assignment]
    """The output, `fmu.variable`; or [a table, log or formula](scenarios.md#inputs-over-time)."""


def with_signals(
    data: Mapping[str, Any], start: float, problems: list[Problem]
) -> tuple[dict[str, Any], dict[Path, int]]:
    """The scene's tables with an FMU for each connection from a signal, which takes its steps with
    the target, and with an [[at]] for each change of a text; and of these, and of the connections
    that are left, by their place the index of the connection. Adds a problem for each table of
    texts that cannot be read. start: of the run (s)."""
    wires, fmus, events = (tables_of(data, name) for name in ("connection", "fmu", "at"))
    rates = {f.get("name", f.get("replaces")): f.get("rate") for f in fmus}
    made: dict[int, dict[str, Any]] = {}
    texts = set[int]()
    moved: dict[Path, int] = {}
    for i, wire in enumerate(wires):
        if not isinstance(source := wire.get("from"), dict):
            continue
        target = str(wire.get("to"))
        rows: list[list[Any]] | None = []
        with collect_problem(problems, ("connection", i, "from", "table")):
            rows = _read_texts(source)
            if rows is not None and [w.get("to") for w in wires].count(target) > 1:
                raise ValueError(f"{target} is fed by another [[connection]] already; keep one")
        if rows is not None:
            texts.add(i)
            first = len(events)
            events += _set_texts(rows, start, target, fmus)
            moved |= {("at", n): i for n in range(first, len(events))}
            name, _, port = target.partition(".")
            moved |= {("fmu", n, "start", port): i for n in _find_fmu(name, fmus)}
            continue
        name = re.sub(r"\W+", "_", target).strip("_")
        while name in rates:
            name += "_"
        rates[name] = rate = rates.get(target.partition(".")[0])
        made[i] = {"name": name, "block": BLOCK, "settings": source}
        made[i] |= {} if rate is None else {"rate": rate}
        wires[i] = {"convert": _has_units(source), **wire, "from": f"{name}.y"}
    if not (made or texts):
        return dict(data), {}
    moved |= {("fmu", len(fmus) + n): i for n, i in enumerate(made)}
    left = [i for i in range(len(wires)) if i not in texts]
    moved |= {("connection", n): i for n, i in enumerate(left)}
    changed = {"fmu": [*fmus, *made.values()], "connection": [wires[i] for i in left]}
    return {**data, **changed, **({"at": events} if events else {})}, moved


def _read_texts(source: Mapping[str, Any]) -> list[list[Any]] | None:
    """The rows (time, texts) of a table of texts; None of other signals. Raises as
    `read_recorded_table` does, and ValueError for a key that texts do not have."""
    table = source.get("table")
    rows: list[list[Any]] | None = None
    if isinstance(table, dict) and "path" in table:
        rows = read_recorded_texts(table)
    elif isinstance(table, list) and all(isinstance(row, list) for row in table):
        rows = table if any(isinstance(x, str) for row in table for x in row[1:]) else None
    if rows is None:
        return None
    for key, value in source.items():
        if key != "table" and (key, value) != ("interpolation", "hold"):
            raise ValueError(f"{key} = {value!r}: texts are held until the next: leave it out")
    for k, row in enumerate(rows):
        if [*map(type, row[1:])] != [str] or type(row[0]) not in (int, float):
            raise ValueError(f"row {k + 1}, {row}: with texts a row is a time (s) and one text")
        if k and row[0] <= rows[k - 1][0]:
            raise ValueError(f"row {k + 1}: {row[0]} does not come after {rows[k - 1][0]}")
    return rows


def _set_texts(
    rows: list[list[Any]], start: float, target: str, fmus: list[dict[str, Any]]
) -> Iterator[dict[str, Any]]:
    """The [[at]] of texts from a start (s) on, of which the first is a start value of the FMU."""
    name, _, port = target.partition(".")
    before = sum(time <= start for time, _ in rows) or 1
    for n in _find_fmu(name, fmus) if rows else ():
        fmus[n]["start"] = {**(fmus[n].get("start") or {}), port: rows[before - 1][1]}
    for (_, text), (time, newer) in pairwise(rows[before - 1 :]):
        if newer != text:
            yield {"time": time, "set": {target: newer}}


def _find_fmu(name: str, fmus: list[dict[str, Any]]) -> list[int]:
    return [n for n, fmu in enumerate(fmus) if name in (fmu.get("name"), fmu.get("replaces"))]


def _has_units(source: Mapping[str, Any]) -> bool:
    table = source.get("table")
    return bool(source.get("units") or (isinstance(table, dict) and table.get("units")))


def read_log(settings: dict[str, Any]) -> None:
    """Puts the rows of a recorded log into the settings of a signal, with the units of its values.
    Raises as `read_recorded_table` does."""
    given = settings.pop("table")  # so that what cannot be read is told once
    settings["table"] = read_recorded_table(given)
    if units := given.get("units"):
        settings["units"] = [si_unit(unit) for unit in units[1:]]
