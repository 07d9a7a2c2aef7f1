"""What stands in the way of making one program of a scene."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.system import System
from hapticlink.programs.foreign import Foreign, read_foreign


def of_scene(scene: Scene) -> None:
    """Raises InputFault for what only Python does."""
    reasons = []
    if scene.start_time:
        reasons.append("start_time: whoever runs the FMU gives it (setupExperiment), leave it out")
    if scene.at:
        why = "what happens at given times is done by Python"
        reasons.append(str(scene.place(("at", 0), why)))
    reasons += [f"{fmu.name} is made by {fmu.engine}" for fmu in scene.fmu if fmu.engine]
    if scene.coupling == "iterated":
        reasons.append("coupling = 'iterated': steps are repeated by Python")
    refuse(scene.title, reasons)


def of_system(system: System, outside: str | None, scene: Scene) -> dict[str, Foreign]:
    """The FMUs of others that a program holds. Raises InputFault where one cannot be compiled in,
    and for a block to leave out that the scene does not have."""
    if outside is not None and outside not in system.fmu:
        raise InputFault(f"{scene.title}: {unknown('block', outside, [*system.fmu])}")
    if outside is not None and len(system.fmus) == 1:
        raise InputFault(f"{scene.title}: without {outside} there is no block left")
    foreign, reasons = dict[str, Foreign](), []
    for name in (fmu.name for fmu in scene.fmu if fmu.path and fmu.name != outside):
        description = system.fmu[name].description
        try:
            foreign[name] = read_foreign(description)
        except InputFault as why:
            reasons.append(f"{name} ({description.path}) is an FMU that exists already, and {why}")
    if reasons:
        reasons.append(f"an FMU can be left out: --without {reasons[0].partition(' ')[0]}")
    refuse(scene.title, reasons)
    return foreign


def of_simulation(simulation: Simulation, title: str) -> None:
    """Raises InputFault for FMUs in processes of their own."""
    reasons = [
        f"{fmu} runs in a process of its own: {why}" for fmu, why in simulation.isolated.items()
    ]
    refuse(title, reasons)


def refuse(title: str, reasons: Iterable[str]) -> None:
    """Raises InputFault where there are reasons."""
    if lines := [f"  {reason}" for reason in reasons]:
        raise InputFault("\n".join([f"{title} cannot become one program:", *lines]))
