"""Power ports and springs that FMUs declare in their annotations, by their names in a system."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from hapticlink.orchestrator.scene.records import PowerPort, SetSpring
from hapticlink.orchestrator.system.system import Connection, Fmu


def power(fmus: Iterable[Fmu]) -> Iterator[PowerPort]:
    """The inputs that carry power, with their conjugate displacements."""
    for fmu in fmus:
        for port, declared in fmu.description.power.items():
            displacement = f"{fmu.name}.{declared.displacement}"
            yield PowerPort(
                effort=f"{fmu.name}.{port}", displacement=displacement, sign=declared.sign
            )


def springs(fmus: Iterable[Fmu], connections: Collection[Connection]) -> Iterator[SetSpring]:
    """The spring-dampers within FMUs, with the start values of their gains. Springs whose gains a
    connection sets are left out: their values are only known once the run begins."""
    fed = {(c.target, s.port) for c in connections if c.to_parameter for s in c.inputs}
    for fmu in fmus:
        for declared in fmu.description.springs:
            if not {(fmu.name, declared.stiffness), (fmu.name, declared.damping)} & fed:
                ports = ("set_position", "position", "set_velocity", "velocity", "force")
                given = {port: getattr(declared, port) for port in ports}
                yield SetSpring(
                    stiffness=_values(fmu, declared.stiffness),
                    damping=_values(fmu, declared.damping),
                    **{port: f"{fmu.name}.{name}" for port, name in given.items() if name},
                )


def _values(fmu: Fmu, parameter: str) -> tuple[float, ...]:
    given = {scalar.name: value for scalar, value in fmu.starts}
    entries = fmu.description.port(parameter, "parameter")
    return tuple(float(given.get(s.name, s.start)) for s in entries)
