"""Connections from what is no FMU: a table, a recorded log, a formula over time.

    [[connection]]
    from = { table = { path = "log.csv", columns = ["time", "u"] }, interpolation = "hold" }
    to = "plant.u"

is an [[fmu]] with the block `signal` and these settings, and a connection from its output y.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from hapticlink.components.specs.paths import Interpolation
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.extends import tables_of
from hapticlink.orchestrator.scene.recorded_tables import (
    RecordedTable,
    read_recorded_table,
    si_unit,
)
from hapticlink.orchestrator.scene.scene_tables import OWN, Wire

BLOCK = "signal"
_Row = tuple[Annotated[float, Quantity(OWN)], ...]


@dataclass(frozen=True, kw_only=True)
class SignalSource:
    """A signal over time in the place of an output. A value acts from the target's step on that
    begins at its time or after."""

    table: tuple[_Row, ...] | RecordedTable | None = None
    """Rows of time (s) and values, sorted by time, the ends held; or a recorded log,
    `{ path, columns, units }`, such as the CSV of another run."""
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


def with_signals(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[int, int]]:
    """The scene's tables with an FMU for each connection from a signal, which takes its steps with
    the target; and by the index of such an FMU that of its connection."""
    wires, fmus = tables_of(data, "connection"), tables_of(data, "fmu")
    rates = {f.get("name", f.get("replaces")): f.get("rate") for f in fmus}
    made: dict[int, dict[str, Any]] = {}
    for i, wire in enumerate(wires):
        if not isinstance(source := wire.get("from"), dict):
            continue
        target = str(wire.get("to"))
        name = re.sub(r"\W+", "_", target).strip("_")
        while name in rates:
            name += "_"
        rates[name] = rate = rates.get(target.partition(".")[0])
        made[i] = {"name": name, "block": BLOCK, "settings": source}
        made[i] |= {} if rate is None else {"rate": rate}
        wires[i] = {"convert": _has_units(source), **wire, "from": f"{name}.y"}
    if not made:
        return dict(data), {}
    moved = {len(fmus) + n: i for n, i in enumerate(made)}
    return {**data, "fmu": [*fmus, *made.values()], "connection": wires}, moved


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
