"""How the FMUs of a system are opened: by FMI version, and here or each in its own process."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.instance import Instance, Vector
from hapticlink.orchestrator.fmi.instance3 import Instance3
from hapticlink.orchestrator.fmi.isolated import Isolated
from hapticlink.orchestrator.run.python_modules import clashes
from hapticlink.orchestrator.system.system import Unit

KINDS = {"2": Instance, "3": Instance3}


def isolated(units: Iterable[Unit]) -> dict[str, str]:
    """Why each FMU that runs in a process of its own does, by name."""
    units = tuple(units)
    return {u.name: "asked for" for u in units if u.isolate} | clashes(units)


def instance(unit: Unit, outputs: Vector, policy: Faults, alone: bool) -> Instance:
    """The instance of `unit`, not loaded yet, that fills `outputs`."""
    made = Isolated if alone else KINDS[unit.description.fmi]
    return made(unit.name, unit.description, outputs, unit.starts, policy)
