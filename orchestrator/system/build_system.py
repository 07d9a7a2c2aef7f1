"""Builds the system of a scene, the start of a run, of `info` and of an export: FMUs, connections,
holds, and their checks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from hapticlink.fmus.blocks import Starts
from hapticlink.orchestrator.base import plugins, shelf, temporary_folders
from hapticlink.orchestrator.base.errors import Finding, SceneFault
from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    DEVICE,
    HAND,
    block_of_user,
    user_of_block,
)
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.boards.board import ENDS, describe_board
from hapticlink.orchestrator.boards.driver import find_misfits
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.process_cache import describe_once
from hapticlink.orchestrator.fmi.start_values import Starts as StartValues
from hapticlink.orchestrator.scene.blocks import BlockPlan, Blocks, blocks, driver_of
from hapticlink.orchestrator.scene.conditions import Condition, parse_condition
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.scene.toml_keys import Path as Keys
from hapticlink.orchestrator.scene.toml_keys import Problem, path_of_user
from hapticlink.orchestrator.system import (
    checks,
    fmu_tables,
    haptic_loop,
    replacements,
    timed_events,
)
from hapticlink.orchestrator.system.assign_holds import assign, find_energy_ports
from hapticlink.orchestrator.system.connections import check_partial_vectors, connect
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.outputs_to_record import (
    choose_outputs,
    choose_slower,
    read_recorded,
)
from hapticlink.orchestrator.system.start_values import separate_start_values
from hapticlink.orchestrator.system.step_sizes import sizes, too_long, with_sizes
from hapticlink.orchestrator.system.system import (
    Connection,
    Coupling,
    Fmu,
    InputChange,
    Recording,
    System,
)
from hapticlink.orchestrator.system.timeline import timeline


@contextmanager
def build_system(scene: Scene, starts: Mapping[str, Starts] | None = None) -> Iterator[System]:
    """The system of `scene`, with its FMU files built or taken from the cache. `starts` is for FMUs
    that other tools run (`fmu_files`).

    Files that are not in the cache exist only within the context. Raises InputFault where no FMU
    can be built from the settings, SceneFault where FMUs and connections do not fit.
    """
    with temporary_folders.folder_if_needed() as room:
        planned = blocks(scene)
        if starts is not None:
            time = timeline(scene, planned)
            files = fmu_files(scene, planned, time, room, starts=starts)
            yield _assemble(scene, planned, time, files, exported=True)
            return
        planned = separate_start_values(planned)
        made_of = MadeOf.of(scene, planned)
        known = made_of and _find_known(made_of, scene, planned)
        time = known.system.timeline if known else timeline(scene, planned)
        files = fmu_files(scene, planned, time, room)
        described = [describe_once(files[b.name]) for b in planned.own]
        if known and known.described == described:
            system = _with_starts(scene, planned, known.system, known.system.timeline)
        else:
            system = _assemble(scene, planned, timeline(scene, planned) if known else time, files)
            if made_of:
                _SYSTEMS.put(Assembled(made_of, described, system))
        yield system


def build_again(scene: Scene) -> System | None:
    """The system of a scene that differs in start values and rates alone from one that
    `build_system` has just made, without a look at the FMU files; None where this process keeps
    none."""
    planned = separate_start_values(blocks(scene))
    made_of = MadeOf.of(scene, planned)
    known = made_of and _find_known(made_of, scene, planned)
    return _with_starts(scene, planned, known.system, known.system.timeline) if known else None


MAX_SYSTEMS = 32
"""Systems that a process keeps; those that differ in start values alone count as one."""


class MadeOf(NamedTuple):
    """What a system follows from but start values: its rates, the scene without these, its events
    as text, in which 0.0 is not -0.0, nor 1 true, and the common settings of its blocks."""

    rates: tuple[object, object]
    scene: Scene
    events: str
    settings: Sequence[tuple[str, Mapping[str, Any]]]

    @classmethod
    def of(cls, scene: Scene, planned: Blocks) -> MadeOf | None:
        """None where this process keeps no system, or FMUs of others may change."""
        if not shelf.is_keeping() or scene.fmu or scene.connection or plugins.list_plugins():
            return None
        rates = scene.haptics.rate, scene.graphics and scene.graphics.rate
        common = replace(
            scene.plain(),
            haptics=replace(scene.haptics, rate=1),
            graphics=scene.graphics and replace(scene.graphics, rate=1),
            title="",
            description="",
            hand=None,
            hands={},
            controller=None,
            controllers={},
            linkage=scene.linkage and replace(scene.linkage, start={}),
        )
        return cls(rates, common, repr(scene.at), [(b.name, b.settings) for b in planned.own])


@dataclass(frozen=True)
class Assembled:
    """A system that this process keeps for others that differ in start values alone, what it is
    made of, and what its FMU files contain."""

    made_of: MadeOf
    described: Sequence[Description]
    system: System


_SYSTEMS: shelf.Shelf[Assembled] = shelf.Shelf(MAX_SYSTEMS)


def _find_known(made_of: MadeOf, scene: Scene, planned: Blocks) -> Assembled | None:
    """What this process keeps for a scene's system, perhaps as it follows from another's."""
    known = _SYSTEMS.take(lambda item: item.made_of == made_of)
    if not known and (other := _SYSTEMS.take(lambda item: item.made_of[1:] == made_of[1:])):
        _SYSTEMS.put(other)
        system = _with_starts(scene, planned, other.system, timeline(scene, planned))
        if _follows_from(scene, system, other.system):
            known = Assembled(made_of, other.described, system)
    if known:
        _SYSTEMS.put(known)
    return known


def _follows_from(scene: Scene, system: System, other: System) -> bool:
    """Whether `_assemble` makes a system as this one, which has all of another but start values and
    timeline: where it asks no more of the clocks than which is slower. The FMUs are this project's,
    which take steps of any size."""

    def order(time: Timeline) -> object:
        return time.of, [[a.longest > b.longest for b in time.clocks] for a in time.clocks]

    return (
        order(system.timeline) == order(other.timeline)
        and not (other.early or scene.at or isinstance(scene.record.signals, Mapping))
        and not any(any(too_long(fmu)) for fmu in system.fmus)
    )


def _with_starts(scene: Scene, planned: Blocks, system: System, time: Timeline) -> System:
    """A system with the timeline, and the start values that a scene gives its blocks."""
    by_name = {b.name: b for b in planned.own}
    starts = (_restarts(fmu, by_name[fmu.name], time) for fmu in system.fmus)
    energy = partial(find_energy_ports, scene, connections=system.connections)
    return system.restarted(starts, energy, time)


def _restarts(fmu: Fmu, block: BlockPlan, time: Timeline) -> StartValues:
    given = sizes(fmu.clock, time) | {s.name: value for s, value in _starts(fmu, block)}
    return tuple((s, given.get(s.name, value)) for s, value in fmu.starts)


def _assemble(
    scene: Scene,
    planned: Blocks,
    time: Timeline,
    files: Mapping[str, Path],
    exported: bool = False,
) -> System:
    """The system of `scene`; `files` are the FMU files of its blocks, by name, which already start
    as in the scene where they are `exported`.

    Raises SceneFault with every finding: FMUs that cannot be read or used, connections and holds
    that do not fit, and, if all FMUs can be read, names in the scene that they do not have.
    """
    problems: list[Problem] = []
    replaced, rows = replacements.find_replaced_blocks(planned.replaced), haptic_loop.rows(scene)
    of, order = time.of, {b.name: i for i, b in enumerate(planned.loop)}
    ours = [Fmu(b.name, describe_once(files[b.name]), of[b.name]) for b in planned.own]
    if not exported:
        started = zip(ours, planned.own, strict=True)
        ours = [replace(fmu, starts=_starts(fmu, block)) for fmu, block in started]
        ours = [_with_board(fmu, scene, problems) for fmu in ours]
    tables = [*fmu_tables.fmus(scene, files, replaced, problems)]
    foreign = (
        Fmu(t.name, about, of[t.name], starts, t.isolate, t.hardware)
        for t, about, starts, _ in tables
    )
    every = sorted((*ours, *foreign), key=lambda u: order.get(u.name, len(order)))
    alone = (replace(u, isolate=u.isolate or scene.isolate) for u in every)
    fmus = tuple(with_sizes(u, time) for u in alone)
    problems += (((), why) for fmu in fmus for why in too_long(fmu))
    connections = _connections(scene, fmus, rows, problems)
    fmus = tuple(read_recorded(u, scene.record, connections) for u in fmus)
    if len(tables) < len(scene.fmu):  # what names an FMU that cannot be read may be right
        raise _faults(scene, problems)
    energy = find_energy_ports(scene, fmus, connections)
    assigned, refused = assign(fmus, connections, time, scene, energy)
    condition = parse_condition(scene.ends_when) if scene.ends_when else None
    if condition and not _has_output(fmus, condition):
        if scene.stop_when is not None:
            problems.append((("stop_when",), f"{condition}: there is no such output"))
        condition = None
    read_again = (*scene.get_after_set, *_read_again(scene, ours))
    system = System(
        fmus,
        assigned,
        time,
        Coupling(scene.coupling, scene.iteration, scene.substeps, read_again),
        condition,
        scene.faults,
        energy,
        refused=refused,
    )
    problems += checks.check_system(scene, system)
    problems += replacements.check_replacements(scene, replaced, rows, system)
    changes = (*_coupling_ramps(scene, system), *timed_events.changes(scene, system, problems))
    written = choose_outputs(scene.record, system, problems)
    slower = choose_slower(scene.record, system, problems)
    if problems:
        raise _faults(scene, problems)
    mapped = {
        table.name: {port: tuple(map(str, terms)) for port, terms in names.items()}
        for table, *_, names in tables
    }
    return replace(
        system,
        recording=Recording(written, scene.record.every, slower),
        replacements=replacements.replacements(replaced, rows, system, mapped),
        changes=changes,
    )


RAMP_STEPS = 16
TORQUE_RISE = 5e-3
"""Time (s) in which the torques of a board may grow to their limit."""
COUPLING_GAINS = ("K_pc", "B_pc")


def _coupling_ramps(scene: Scene, system: System) -> Iterator[InputChange]:
    """The changes by which the coupling of a mechanism with a board's handle grows from the start
    on, on both of its sides: a ramp of the motors alone lets the handle leave the mechanism."""
    for user in scene.all_controllers:
        driver, name = driver_of(scene, user), block_of_user(CONTROLLER, user)
        if not (driver and driver.ramp and name in system.fmu):
            continue
        fmu = system.fmu[name]
        gains = tuple(s for k in COUPLING_GAINS for s in fmu.description.port(k, "parameter"))
        starts = {s: float(v) for s, v in ({s: s.start for s in gains} | dict(fmu.starts)).items()}
        for k in range(RAMP_STEPS):
            share = (k + 1) / RAMP_STEPS
            begin = driver.ramp * k / RAMP_STEPS
            values = tuple(share * starts[s] for s in gains)
            text = f"coupling of {name} at {100 * share:.3g} %"
            yield InputChange(begin, begin, text, name, gains, values)


def _with_board(fmu: Fmu, scene: Scene, problems: list[Problem]) -> Fmu:
    """A device's FMU, with the board in its place where the scene has one."""
    user = user_of_block(fmu.name, DEVICE)
    if user is None or not (driver := driver_of(scene, user)):
        return fmu
    motors, encoders = (len(fmu.description.port(*port)) for port in ENDS)
    table = (*path_of_user("device", user), "driver")
    problems += (((*table, key), why) for key, why in find_misfits(driver, motors, encoders))
    most = driver.torque_limit or scene.all_devices[user].torque_limit
    rate = driver.torque_rate or most / TORQUE_RISE
    driver = replace(driver, torque_limit=most, torque_rate=rate)
    about = describe_board(fmu.description)
    return replace(fmu, description=about, hardware=True, in_its_place=driver)


def _starts(fmu: Fmu, block: BlockPlan) -> StartValues:
    """The start values that a block's settings give parameters of its FMU."""
    return tuple(
        (s, value)
        for port, values in block.starts.items()
        if (scalars := fmu.description.port(port, "parameter", "input"))
        for s, value in zip(scalars, values, strict=True)
    )


def _faults(scene: Scene, problems: Iterable[Problem]) -> SceneFault:
    found: dict[object, Finding] = {}
    for path, why in problems:
        finding = scene.place(path, why)
        # Of a table of texts the start value and each entry of `at` may be one: the first tells.
        found.setdefault(finding.key if finding.key.endswith("from.table") else finding, finding)
    return SceneFault(scene.title, [*found.values()])


def _read_again(scene: Scene, ours: Iterable[Fmu]) -> Iterator[str]:
    """The hands that are plants, in iterated coupling: their force depends directly on the handle,
    and errs to order 1 unless it is read with the inputs at the end of the step."""
    hands = [u.name for u in ours if u.description.block == HAND and not u.sampled]
    if scene.coupling == "iterated":
        yield from (name for name in hands if name not in scene.get_after_set)


def _connections(
    scene: Scene, fmus: Iterable[Fmu], rows: Iterable[Wire], problems: list[Problem]
) -> tuple[Connection, ...]:
    """The connections of [[connection]], and those `rows` of the haptic loop that are to inputs
    that no [[connection]] feeds."""
    described = {u.name: u.description for u in fmus}
    wires: list[tuple[Keys, Wire]] = [
        (("connection", i), wire)
        for i, wire in enumerate(scene.connection)
        if all(end.split(".")[0] in described for end in (wire.from_, wire.to))
    ]  # an FMU that cannot be read has its own finding already
    asked = tuple(connect(wires, described, problems))
    fed = {f"{c.target}.{s.port}" for _, c in asked for s in c.inputs}
    own = {f.name for f in scene.fmu if not f.replaces}
    rows = haptic_loop.wires(rows, {n: d for n, d in described.items() if n not in own})
    paths: dict[str, Keys] = {f.name: ("fmu", i) for i, f in enumerate(scene.fmu)}
    wires = [(_path(w, paths), w) for w in rows if w.to not in fed]
    loop = tuple(connect(wires, described, problems))
    problems += check_partial_vectors(asked, rows, described)
    return tuple(c for _, c in (*loop, *asked))


def _path(wire: Wire, paths: Mapping[str, Keys]) -> Keys:
    """Where a connection of the loop comes from a scene's table: from that of a replacement."""
    ends = (end.partition(".")[0] for end in (wire.from_, wire.to))
    return next(((*paths[end], "replaces") for end in ends if end in paths), ())


def _has_output(fmus: Iterable[Fmu], condition: Condition) -> bool:
    named = (u for u in fmus if u.name == condition.fmu)
    return any(s.name == condition.variable for u in named for s in u.description.outputs)
