"""The whole state of a run between two events, from which a run goes on to the same bytes: states
of FMUs, signals, holds with their queues, meters, step checks, iterations, timed changes that wait
or act, random streams, and where the clocks stand.

A run that goes on is begun as any other, and then put into the state. Its scene may differ from
that of the state in whatever acts from there on alone (`state_fits`).
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.description import SERIALISED
from hapticlink.orchestrator.fmi.event_mode import InProcessWithEvents
from hapticlink.orchestrator.fmi.transfer import as_signal, known_texts, number_of, text_of
from hapticlink.orchestrator.fmi.variables import WRITTEN
from hapticlink.orchestrator.holds.hold import Hold, HoldContext
from hapticlink.orchestrator.results.state_file import expect_state, read_state, write_state
from hapticlink.orchestrator.run.apply_changes import InputSetter
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold, array
from hapticlink.orchestrator.run.compiled.loop import CompiledLoop
from hapticlink.orchestrator.run.compiled.state import Saved, StateBlock
from hapticlink.orchestrator.run.open_fmus import find_isolated
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.system.system import Connection, Fmu, InputChange, System

PLACE = ("time", "begin", "size", "end", "ended", "gets", "sets", "steps", "saves", "rollbacks")
"""Of where an FMU stands, what it goes on from."""


@dataclass(frozen=True)
class RunState:
    """A state that was read. time: of the next event (s)."""

    path: Path
    content: Mapping[str, Any]

    @property
    def time(self) -> float:
        return float(self.content["time"])


def read(path: Path) -> RunState:
    """Raises InputFault where a file is no state, or was made by another version."""
    content = read_state(path)
    with expect_state(path):
        layout, version, _ = content["layout"], content["version"], float(content["time"])
        content["rows"] = {table: int(count) for table, count in content["rows"].items()}
    if layout != _layout():
        raise InputFault(
            f"{path}: made by another version of hapticlink ({version}), whose states have other "
            "contents: save it again with this one"
        )
    return RunState(path.absolute(), content)


@cache
def _layout() -> str:
    """What tells states with other contents apart: the code that runs a scene and its FMUs."""
    room = Path(__file__).parent
    files = sorted(p for folder in (room, room.parent / "fmi") for p in folder.rglob("*.*"))
    texts = (p.read_bytes() for p in files if p.suffix in (".py", ".c", ".h"))
    return hashlib.sha256(b"".join(texts)).hexdigest()


# --- what can be saved ------------------------------------------------------------------------


def require_savable(system: System) -> None:
    """Raises InputFault with all FMUs whose state cannot be saved to a file."""
    alone = find_isolated(system.fmus)
    reasons = {u.name: _why_unsavable(u, u.name in alone) for u in system.fmus}
    unable = [f"{name} ({why})" for name, why in reasons.items() if why]
    if unable:
        raise InputFault(f"the state of a run is saved with that of its FMUs: {'; '.join(unable)}")


def _why_unsavable(fmu: Fmu, is_isolated: bool) -> str:
    about = fmu.description
    if fmu.served:
        return "runs on another computer"
    if fmu.hardware:
        return "drives hardware"
    if about.equations:
        return "is for model exchange, and the history of its solver cannot be written to a file"
    if is_isolated and about.has_event_mode:
        return "has event mode in a process of its own"
    if not about.restores_state:
        return "cannot save its state (canGetAndSetFMUstate)"
    if not any(flag.lower() == SERIALISED.lower() for flag in about.flags):
        return "cannot write its state to a file (canSerializeFMUstate)"
    return ""


def state_blocks(simulation: Simulation, with_own: bool = False) -> dict[str, StateBlock]:
    """The states of the holds and the energy tanks of a simulation, by name. with_own: those of
    plugins' holds with their attributes."""
    tanks = {f"energy tank {i + 1}": tank for i, tank in enumerate(simulation.springs)}
    found = {
        name: StateBlock(hold.c, *([partial(getattr, hold, "own")] if with_own else ()))
        for name, hold in simulation.holds.items()
    }
    return found | {name: StateBlock(tank) for name, tank in tanks.items()}


# --- save -------------------------------------------------------------------------------------


def save(path: Path, scene: Mapping[str, Any], simulation: Simulation, loop: CompiledLoop) -> float:
    """Writes the state between two events; its time (s). scene: its tables. Raises InputFault for a
    plugin's hold with attributes that cannot be saved."""
    content = {"scene": scene, **_capture(simulation, loop)}
    write_state(path, content)
    return float(content["time"])


def _capture(simulation: Simulation, loop: CompiledLoop) -> dict[str, Any]:
    from hapticlink.fmus.versions import version

    system, signals = simulation.system, simulation.signals
    content = {
        "version": version("hapticlink"),
        "layout": _layout(),
        "time": simulation.time(loop.events.next),
        "begin": str(system.timeline.begin),
        "base": str(system.timeline.base),
        "events": loop.events.saved(),
        "coupling": order_of_calls(system),
        "fmus": {u.name: _capture_fmu(u, simulation) for u in system.fmus},
        "connections": {c.name: [c.hold, repr(c.latency), c.kind] for c in system.connections},
        "held": {
            c.name: signals.values[signals.hold(c.name)].copy()
            for c in system.connections
            if c.hold
        },
        "credits": [signals.values[signals.credit(i)] for i in range(len(system.energy.springs))],
        "blocks": {n: vars(b.save()) for n, b in state_blocks(simulation).items()},
        "holds": {name: _capture_hold(hold) for name, hold in simulation.holds.items()},
        "overdrawn": [array(tank.least, 1).copy() for tank in simulation.springs],
        "meters": {name: meter.saved() for name, meter in simulation.meters.of.items()},
        "checks": {name: check.saved() for name, check in simulation.step_checks.items()},
        "iterations": loop.operations.saved(),
        "balance": simulation.balance.begun,
        "changes": [_capture_change(*each) for each in simulation.changing],
        "rows": {name: r.count.value for name, r in simulation.recorders.items()},
    }
    texts = known_texts(_find_numbers(content)) if _has_texts(system) else {}
    return content | {"texts": [*texts.values()]}


def _find_numbers(content: Any) -> Iterator[float]:
    """All that may be numbers of texts: those wait in holds and queues, too."""
    if isinstance(content, Mapping | list | tuple | deque):
        each = content.values() if isinstance(content, Mapping) else content
        yield from chain.from_iterable(map(_find_numbers, each))
    elif isinstance(content, int | float | np.ndarray):
        yield from np.ravel(content).tolist()


def _has_texts(system: System) -> bool:
    return any(s.type in WRITTEN for u in system.fmus for s in u.description.scalars)


def order_of_calls(system: System) -> dict[str, str]:
    """What decides on the order of calls, by the scene's key."""
    of = system.coupling
    return {
        "coupling": of.scheme,
        "substeps": repr(dict(of.substeps)),
        "get_after_set": repr(of.get_after_set),
        "hold (steps that are taken early)": repr(sorted(system.early)),
    }


def _capture_fmu(fmu: Fmu, simulation: Simulation) -> dict[str, Any]:
    instance = simulation.instances[fmu.name]
    names = (s.name for s in fmu.description.outputs)
    found: dict[str, Any] = {
        "guid": fmu.description.guid,
        "clock": fmu.clock,
        "timing": fmu.description.timing,
        "starts": fmu.start_values,
        "state": instance.serialized(),
        "place": {name: getattr(instance.place, name) for name in PLACE},
        "outputs": dict(zip(names, instance.outputs.tolist(), strict=True)),
        "bounds": instance.bounds.saved(),
        "held": instance.held,
        "good": None if instance.good is None else instance.good.copy(),
    }
    if isinstance(instance, InProcessWithEvents) and instance.has_events:
        found["pending"] = instance.saved_events()
    return found


def _capture_hold(hold: CompiledHold) -> dict[str, Any]:
    counted = hold.counted()
    if hold.own:
        counted["own"] = _attributes(hold.own, f"hold {hold.parts.name!r}")
    return counted


def _capture_change(change: InputChange, setter: InputSetter) -> dict[str, Any]:
    told = {"text": change.text, "time": change.time, "begin": change.begin, "key": change.key}
    return {**told, **setter.saved()}


# --- plugins' holds ---------------------------------------------------------------------------

_SAME = {"same": True}
"""In the place of what the new hold has as well: its context, and functions."""


def _attributes(hold: Hold, of: str) -> dict[str, Any]:
    return {name: _plain_attribute(v, f"{of}: {name}") for name, v in vars(hold).items()}


def _plain_attribute(value: Any, of: str) -> Any:
    again = partial(_plain_attribute, of=of)
    match value:
        case HoldContext():
            return _SAME
        case Hold():
            return {"hold": _attributes(value, of)}
        case np.random.Generator():
            return {"generator": value.bit_generator.state}
        case None | bool() | int() | float() | str() | np.ndarray():
            return value
        case dict():
            return {"rows": [[again(k), again(v)] for k, v in value.items()]}
        case deque():
            return deque(map(again, value), value.maxlen)
        case list() | tuple():
            return type(value)(map(again, value))
    if callable(value):
        return _SAME
    raise InputFault(
        f"{of} is a {type(value).__name__}, which cannot be saved: keep numbers, arrays, lists, "
        "tables and generators of NumPy in a hold"
    )


def _put_attributes(hold: Hold, saved: Mapping[str, Any]) -> None:
    own = vars(hold)
    own.update({name: _put(own.get(name), value) for name, value in saved.items()})


def _put(there: Any, saved: Any) -> Any:
    match saved:
        case {"same": True}:
            return there
        case {"hold": dict(attributes)}:
            _put_attributes(there, attributes)
            return there
        case {"generator": dict(state)}:
            there.bit_generator.state = state
            return there
        case {"rows": list(rows)}:
            known = there if isinstance(there, dict) else {}
            return {_put(None, k): _put(known.get(k), v) for k, v in rows}
        case deque():
            return deque((_put(None, each) for each in saved), saved.maxlen)
        case list() | tuple():
            return type(saved)(_put(None, each) for each in saved)
    return saved


def require_plain_holds(simulation: Simulation) -> None:
    """Raises InputFault for a plugin's hold with attributes that cannot be saved."""
    for hold in simulation.holds.values():
        _capture_hold(hold)


# --- go on ------------------------------------------------------------------------------------


def restore(state: RunState, simulation: Simulation, loop: CompiledLoop) -> None:
    """Puts a run that was started, and whose system fits, into the state."""
    with expect_state(state.path):
        _restore(state, simulation, loop)


def _restore(state: RunState, simulation: Simulation, loop: CompiledLoop) -> None:
    saved, system, signals = state.content, simulation.system, simulation.signals
    newer = {c.name for c in with_other_holds(state, system)}
    for text in saved["texts"]:
        number_of(text)
    for u in system.fmus:
        _restore_fmu(u, simulation, saved["fmus"][u.name])
    blocks = state_blocks(simulation)
    for name, hold in simulation.holds.items():
        hold.restore_published(saved["holds"][name])
        if name not in newer:
            hold.restore_counted(saved["holds"][name])
            signals.values[signals.hold(name)] = saved["held"][name]
            if hold.own:
                _put_attributes(hold.own, saved["holds"][name]["own"])
    for name, block in blocks.items():
        if name not in newer:
            kept = saved["blocks"][name]
            block.restore(Saved(**kept), kept["numbers"])
    for i, tank in enumerate(simulation.springs):
        array(tank.least, 1)[:] = saved["overdrawn"][i]
    for i, credit in enumerate(saved["credits"]):
        signals.values[signals.credit(i)] = credit
    for name, meter in simulation.meters.of.items():
        meter.restore(saved["meters"][name])
    for name, check in simulation.step_checks.items():
        if name in saved["checks"]:
            check.restore(saved["checks"][name])
    for name, number in signals.text_values():
        text_of(number, name)
    loop.operations.restore(dict(saved["iterations"]))
    simulation.balance.begun = float(saved["balance"])
    loop.events.restore(saved["events"])
    for name in newer:
        _begin_hold(system.connection[name], simulation, loop)
    _restore_changes(state, simulation)


def _restore_fmu(fmu: Fmu, simulation: Simulation, saved: Mapping[str, Any]) -> None:
    instance = simulation.instances[fmu.name]
    instance.deserialize(saved["state"])
    for name, value in saved["place"].items():
        setattr(instance.place, name, value)
    outputs = saved["outputs"]
    known = [(i, s.name) for i, s in enumerate(fmu.description.outputs) if s.name in outputs]
    instance.outputs[[i for i, _ in known]] = [outputs[name] for _, name in known]
    instance.bounds.restore(saved["bounds"])
    instance.held = saved["held"]
    if instance.good is not None:
        instance.good[:] = instance.outputs if saved["good"] is None else saved["good"]
    if isinstance(instance, InProcessWithEvents) and "pending" in saved:
        instance.restore_events(saved["pending"])


def _begin_hold(c: Connection, simulation: Simulation, loop: CompiledLoop) -> None:
    """A hold that the state does not have begins with the newest sample of its source."""
    newest = loop.events.previous(simulation.system.fmu[c.source].clock)
    loop.change_hold(c.name, simulation.make_hold(c), newest)


def _restore_changes(state: RunState, simulation: Simulation) -> None:
    """Lets changes wait that come later, or that still act, and start values that are new act from
    the first step on."""
    saved = {each["key"]: each for each in state.content["changes"]}
    for instance in simulation.instances.values():
        instance.forget_settings()
    for change, setter in simulation.changing:
        if kept := saved.get(change.key):
            setter.restore(kept)
        else:
            setter.wait(change.begin)
    for change in new_starts(state, simulation.system):
        InputSetter(change, simulation).wait()


def new_starts(state: RunState, system: System) -> Iterator[InputChange]:
    """What sets the start values that differ from those of the state."""
    for u in system.fmus:
        before, now = state.content["fmus"][u.name]["starts"], u.start_values
        by_name = {s.name: s for s in (*u.description.scalars, *(s for s, _ in u.starts))}
        for name in sorted({*before, *now} & by_name.keys()):  # of one FMU: all of them
            value = now.get(name, by_name[name].start)
            if value != before.get(name, by_name[name].start):
                text = f"{u.name}.{name}"
                yield InputChange(
                    state.time,
                    state.time,
                    text,
                    u.name,
                    (by_name[name],),
                    (as_signal(by_name[name], value),),
                )


def with_other_holds(state: RunState, system: System) -> Iterator[Connection]:
    """The connections that have another hold or latency than in the state."""
    for c in system.connections:
        if state.content["connections"][c.name] != [c.hold, repr(c.latency), c.kind]:
            yield c
