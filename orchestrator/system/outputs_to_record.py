"""The outputs that a scene's [record] names."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.orchestrator.base.errors import near
from hapticlink.orchestrator.fmi.variables import WRITTEN
from hapticlink.orchestrator.scene.scene_tables import RecordTable
from hapticlink.orchestrator.scene.toml_keys import Problem
from hapticlink.orchestrator.system.system import System


def choose_outputs(
    record: RecordTable, system: System, problems: list[Problem]
) -> tuple[str, ...] | None:
    """The outputs that are written, `fmu.output`, in the order of the FMUs; None for all. Texts are
    not. Adds a problem for each name that is none of an FMU, a port or an output."""
    called = {
        f"{fmu.name}.{s.name}": {fmu.name, f"{fmu.name}.{s.port}", f"{fmu.name}.{s.name}"}
        for fmu in system.fmus
        for s in fmu.description.outputs
        if s.type not in WRITTEN
    }
    if record.signals == "all":
        every = sum(len(fmu.description.outputs) for fmu in system.fmus)
        return None if len(called) == every else tuple(called)
    if record.signals == "none":
        chosen: set[str] = set()
    elif record.signals == "connected":
        chosen = {f"{c.source}.{s.name}" for c in system.connections for s in c.outputs}
    else:
        chosen = {*record.signals}
        known = list(dict.fromkeys(name for names in called.values() for name in sorted(names)))
        problems += [
            (
                ("record", "signals", i),
                f"{name!r} is no FMU or output of this scene; {_hint(name, known)}",
            )
            for i, name in enumerate(record.signals)
            if name not in known
        ]
    return tuple(name for name, names in called.items() if names & chosen)


def _hint(name: str, known: Sequence[str]) -> str:
    """What was meant: there are too many outputs to list."""
    hint = near(name, known)
    if not hint.startswith("there are"):
        return hint
    fmus = (n for n in known if "." not in n)
    return f"the FMUs are {', '.join(fmus)}; --explain tells what is recorded"
