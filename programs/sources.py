"""The C files of a program."""

from __future__ import annotations

import ctypes
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from hapticlink.fmus.cache import sha
from hapticlink.fmus.native.compiler import FMI2_HEADERS, HEADERS
from hapticlink.fmus.native.native_fmu_entries import INCLUDED, WRAPPER
from hapticlink.fmus.native.source import number, table
from hapticlink.fmus.reproducible_zip import guid_of
from hapticlink.orchestrator.fmi.description import SERIALISED, STATE
from hapticlink.orchestrator.run.compiled import build as loop
from hapticlink.orchestrator.run.compiled.regions import Regions
from hapticlink.programs.memory_as_c import TypedData
from hapticlink.programs.ports import Port
from hapticlink.programs.resolve_scene import Resolved

HERE = Path(__file__).parent
Source = tuple[str, Iterable[str]]
"""As of `component_source`."""
OWN = ("program.c", "prepared_changes.h", "platform.c")
LEFT_OUT = ("platform.c", "process_state.c", "lanes.c")
"""Files of the loop in whose place a program has its own platform.c, and that for several runs."""


def write_sources(
    resolved: Resolved,
    blocks: Mapping[str, Source],
    ports: Sequence[Port],
) -> dict[str, str]:
    """All C files by name; scene.h lacks the GUID. blocks: the members that are of this project."""
    files = {name: (loop.HERE / name).read_text() for name in loop.SOURCES if name not in LEFT_OUT}
    files |= {path.name: path.read_text() for path in INCLUDED}
    files["hold_table.h"] = loop.HOLD_TABLE
    files |= {name: (HERE / name).read_text() for name in OWN}
    files |= {name: (HEADERS / name).read_text(errors="replace") for name in FMI2_HEADERS}
    ids, guids = identifiers(resolved.members), {}
    listed = re.findall(r"X\(id, (\w+), (\w+)\)", files["program.c"])
    functions = {f"fmi2{name}": field for name, field in listed}
    for fmu, id_ in ids.items():
        if fmu in resolved.foreign:
            guids[fmu] = resolved.foreign[fmu].description.guid
            files |= resolved.foreign[fmu].sources(id_, {*functions})
        else:
            guids[fmu], own = _member(id_, *blocks[fmu])
            files |= own
    files["scene.h"] = _scene(resolved, ports, ids, guids, functions)
    return files


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """A C identifier for each block, by which its functions begin."""
    return {name: f"{re.sub(r'[^A-Za-z0-9]', '_', name)}_{i}" for i, name in enumerate(names)}


def _member(id_: str, header: str, pieces: Iterable[str]) -> tuple[str, dict[str, str]]:
    """The GUID of a block, and its files: fmi2.c with the component's functions, all names that the
    linker sees with the block's prefix."""
    guid = guid_of(sha(header))
    prefix = f"#undef fmi2FullName\n#define fmi2FullName(name) {id_}_ ## name\n"
    own = f'{prefix}#define GUID "{guid}"\n{header}'
    text = WRAPPER.read_text().replace('#include "component.h"', own)
    files = {f"{id_}.c": text} | {f"{id_}_{k:03}.c": piece for k, piece in enumerate(pieces)}
    return guid, {name: add_prefix(text, id_) for name, text in files.items()}


def add_prefix(text: str, id_: str) -> str:
    text = text.replace("component_ ## ID", f"{id_}_ ## ID")
    return re.sub(r"\bpart(\d+)_", rf"{id_}_part\1_", text)


def _scene(
    resolved: Resolved,
    ports: Sequence[Port],
    ids: Mapping[str, str],
    guids: Mapping[str, str],
    functions: Mapping[str, str],
) -> str:
    """scene.h. functions: the fields of a Member in program.c by FMI function."""
    members = [*ids]
    slaves = [resolved.instance(fmu).slave for fmu in members]
    handles = {slave.component: i for i, slave in enumerate(slaves)}
    addresses = {
        ctypes.cast(slave.dll[name], ctypes.c_void_p).value or 0: field
        for slave in slaves
        for name, field in functions.items()
    }
    regions = Regions(resolved.roots, resolved.counts)
    data = TypedData(regions, handles, addresses)
    changes = resolved.changes
    settable = [p for p in ports if p.kind in ("INPUT", "OUTSIDE", "PARAMETER")]
    slot_members = [member for _, member in data.slots]
    checks = [c for fmu, c in resolved.simulation.step_checks.items() if fmu in members]
    described = [(fmu, resolved.system.fmu[fmu].description) for fmu in resolved.signal_order]
    outputs = [s for _, description in described for s in description.outputs]
    names = [f"{fmu}.{s.name}" for fmu, description in described for s in description.outputs]
    unbounded = [s.unit is None or s.type != "Real" for s in outputs]
    given = [*_write_starts(resolved, members)]
    sizes = {
        "N_MEMBERS": len(members),
        "N_FMUS": len(resolved.fmus),
        "N_HOLDS": len(resolved.holds),
        "N_VALUES": resolved.counts["n_values"],
        "N_SIGNALS": len(names),
        "N_SETTABLE": len(settable),
        "N_VARIABLES": len(ports),
        "N_GIVEN": len(given),
        "N_CHECKED": max((len(c.scales) for c in checks), default=0),
        "N_START_SETTERS": len(resolved.start_fmus),
        "N_POINTERS": len(data.pointers),
        "N_HANDLES": len(data.handles),
        "N_CALLS": len(data.calls),
        "N_SLOTS": len(data.slots),
        "N_METERS": len(resolved.meters),
        "N_CLOCKS": len(resolved.patterns),
        "N_CHOICES": len(changes.choices),
        "N_FAMILIES": len(changes.families),
        "CHANGED_CLOCK": changes.clock,
        "N_SPARE": changes.n_kinds,
        "SPARE_OP": changes.spare,
        "SPARE_OPS": changes.most,
        "HAPTIC_TICKS": resolved.system.timeline.clocks[0].longest,
        "START_FIRST": resolved.start[0],
        "START_LAST": resolved.start[1],
    }
    one = "&" if len(resolved.start_fmus) == 1 else ""
    setters = f"({one}(s)->start_setters)" if resolved.start_fmus else "((Setter *)0)"
    return "\n".join(
        [
            "/* The data of the scene, as Python has resolved it. */",
            *(f"#define {name} {value}" for name, value in sizes.items()),
            f"#define START_SETTERS(s) {setters}",
            f"#define WITHOUT_STATE {_lacking(resolved, STATE['2'])}",
            f"#define WITHOUT_BYTES {_lacking(resolved, SERIALISED)}",
            f"#define ALTERNATIVES(s) {'(s)->alternatives' if changes.choices else '((Hold **)0)'}",
            "#define MEMBERS(X) " + " ".join(
                f"X({ids[fmu]}, {json.dumps(fmu)}, {json.dumps(guids[fmu])}, "
                f"{resolved.system.fmu[fmu].description.tolerance or 0.0})" for fmu in members
            ),
            data.structure,
            f"static const Scene initial = {data.values};",
            table("struct { size_t at, to; } pointers", (
                f"{{{_at(a)}, {_at(b)}}}" for a, b in data.pointers)),
            table("struct { size_t at; int member; } handles", (
                f"{{{_at(a)}, {member}}}" for a, member in data.handles)),
            table("struct { size_t at; int member; size_t function; } calls", (
                f"{{{_at(a)}, {member}, offsetof(Member, {field})}}"
                for a, member, field in data.calls)),
            table("size_t slots", (_at(place) for place, _ in data.slots)),
            table("int slot_members", map(str, slot_members)),
            table("int member_fmus", (str(resolved.fmus.index(fmu)) for fmu in members)),
            table("int fmu_members", (str(members.index(fmu)) for fmu in resolved.fmus)),
            table("int member_tables", (
                str(resolved.tables.index(resolved.system.fmu[fmu].clock)) for fmu in members)),
            table("int start_fmus", map(str, resolved.start_fmus)),
            table("Pattern patterns", (f"{{{p.n}, {p.ticks}}}" for p in resolved.patterns)),
            table("char *const holds", map(json.dumps, resolved.holds)),
            table("char *const signals", map(json.dumps, names)),
            table("double bounds", (number(s.bound or 0.0) for s in outputs)),
            table("double nominals", (
                "INFINITY" if none else number(s.nominal)
                for s, none in zip(outputs, unbounded, strict=True))),
            *_changes(resolved, regions),
            table("Variable variables", map(_variable, ports)),
            table("double starts", (
                number(p.start or 0.0) if p.is_set else "NAN" for p in settable)),
            table("Given given", given),
            "",
        ]
    )  # fmt: skip


def _changes(resolved: Resolved, regions: Regions) -> Iterator[str]:
    """The tables of what a program can be changed to."""
    system, changes = resolved.system, resolved.changes
    places, choices = list[str](), list[str]()
    clocks = [clock.name for clock in system.timeline.clocks]
    for i, choice in enumerate(changes.choices):
        own = re.compile(rf"alternative_{i}(_|$)")
        names = [region.name for region in regions.all if own.match(region.name)]
        hold = resolved.holds.index(choice.connection)
        choices.append(f"{{{hold}, {len(places)}, {len(names)}}}")
        places += [f"{{{_at(name)}, sizeof(((Scene *)0)->{name})}}" for name in names]
    yield table("struct { int hold, first, n; } choices", choices)
    yield table("struct { size_t at, size; } choice_regions", places)
    held = [system.connection[name] for name in resolved.holds]
    yield table("int hold_clocks", (str(clocks.index(system.fmu[c.source].clock)) for c in held))
    yield table("int own_latency", (str(int(c.latency is not None)) for c in held))
    slopes = [slope for family in changes.families for slope in family.slopes]
    first, families = 0, []
    for family in changes.families:
        key = ", ".join(map(str, family.key))
        families.append(f"{{{family.first}, {family.n}, {family.dticks}, {first}, {{{key}}}}}")
        first += family.n
    yield table("Family families", families)
    yield table("struct { int64_t b, c, d; double x; } slopes", (
        f"{{{int(b)}, {int(c)}, {int(d)}, {number(x)}}}" for b, c, d, x in slopes))  # fmt: skip


def _at(place: str) -> str:
    return f"offsetof(Scene, {place})"


def _write_starts(resolved: Resolved, members: Sequence[str]) -> Iterator[str]:
    """The start values that a scene gives to FMUs of others, but for those of the program's own
    variables."""
    for fmu in resolved.foreign:
        for s, value in resolved.system.fmu[fmu].starts:
            if s.type == "Real" and s.settable:
                continue
            text, value = (json.dumps(value), 0) if isinstance(value, str) else ("NULL", value)
            place = f"{members.index(fmu)}, {s.type.upper()}, {s.reference}"
            yield f"{{{place}, {number(float(value))}, {text}}}"


def _lacking(resolved: Resolved, capability: str) -> str:
    """The name of a member that has not a capability, NULL where all have it."""
    for fmu, foreign in resolved.foreign.items():
        if capability not in foreign.description.flags:
            return json.dumps(fmu)
    return "NULL"


def _variable(port: Port) -> str:
    place = f"{port.type.upper()}, {port.member}, {int(port.fixed)}, {port.reference}, {port.place}"
    return f"{{{port.kind}, {place}, {json.dumps(port.name)}}}"
