"""Creates the instances of FMUs, by FMI version, in this process or isolated in their own."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.fmi.fault_policy import Faults
from hapticlink.orchestrator.fmi.instance import Instance, Vector
from hapticlink.orchestrator.fmi.isolated import Isolated
from hapticlink.orchestrator.fmi.versions import IN_PROCESS
from hapticlink.orchestrator.run.python_modules import clashes
from hapticlink.orchestrator.system.system import Fmu


def isolated(fmus: Iterable[Fmu]) -> dict[str, str]:
    """The FMUs that run in a process of their own, by name, with the reason."""
    fmus = tuple(fmus)
    return {u.name: "asked for" for u in fmus if u.isolate} | clashes(fmus)


def instance(fmu: Fmu, outputs: Vector, policy: Faults, alone: bool) -> Instance:
    """The instance of `fmu`, not loaded yet, that fills `outputs`."""
    kind = Isolated if alone else IN_PROCESS[fmu.description.fmi]
    made = kind(fmu.name, fmu.description, outputs, fmu.starts, policy)
    made.seldom = fmu.seldom
    return made
