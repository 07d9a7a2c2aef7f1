"""The structures of loop.h, field by field. Pointers are addresses; whoever writes one keeps what
it points to."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator

from hapticlink.orchestrator.fmi.place import Place

_INT, _DOUBLE, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
Fields = tuple[tuple[str, type], ...]


def _all(kind: type, names: str) -> Iterator[tuple[str, type]]:
    return ((name, kind) for name in names.split())


class Kind(ctypes.Structure):
    _fields_ = (*_all(ctypes.c_int16, "type fmi python unused"),)


class Transfer(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "call fmu references buffer values"),
        *_all(_INT, "n_references n"),
        ("kind", Kind),
    )


class Check(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "get_state set_state state steps count bases rates ports"),
        *_all(_POINTER, "scales jumps last errors times weights size before halves"),
        *_all(_INT, "every first n n_ports room"),
        *_all(_DOUBLE, "at_rest jump share"),
    )


class Fmu(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "place fmu do_step"),
        ("kind", Kind),
        ("forward", _INT),
        *_all(_POINTER, "get_state gets"),
        ("n_gets", _INT),
        *_all(_POINTER, "outputs inverse good"),
        *_all(_INT, "n_outputs n_steps sparse"),
        *_all(_POINTER, "check due fewer"),
        ("n_fewer", _INT),
        *_all(_POINTER, "state event terminate early reached"),
    )


class Setter(ctypes.Structure):
    _fields_ = (
        ("place", _POINTER),
        *_all(_INT, "n key"),
        *_all(_POINTER, "where values sets"),
        ("n_sets", _INT),
        *_all(_POINTER, "factors offsets into whole"),
    )


class Link(ctypes.Structure):
    _fields_ = (
        *_all(_INT, "started newest sent lost overtaken"),
        ("late", _POINTER),
        *_all(_INT, "n_late at_late"),
        *_all(_POINTER, "arrivals stamps samples"),
        *_all(_INT, "n room"),
    )


class Tank(ctypes.Structure):
    _fields_ = (
        *_all(_INT, "n tick sampled"),
        *_all(_POINTER, "stiffness damping turns where velocity"),
        *_all(_DOUBLE, "period available needed credited"),
        *_all(_POINTER, "newest modulated x moved force withheld"),
    )


class Reader(ctypes.Structure):
    _fields_ = (*_all(_POINTER, "where factor offset"), ("n", _INT))


class Queue(ctypes.Structure):
    _fields_ = (("count", _INT), *_all(_POINTER, "ticks values"))


class Account(ctypes.Structure):
    _fields_ = (
        *_all(_INT, "n passive tick stamp steps delayed room"),
        *_all(Reader, "displacement velocity"),
        ("vectors", _POINTER),
        *_all(Queue, "path until fresh"),
        ("tank", _POINTER),
        *_all(_DOUBLE, "promised promise"),
        ("since", _INT),
    )


class Hold(ctypes.Structure):
    _fields_ = (
        *_all(_INT, "kind n width depth count"),
        ("history", _INT * 3),
        *_all(_POINTER, "samples vectors"),
        *_all(_INT, "arrival span interval begun"),
        *_all(_POINTER, "sources held"),
        ("n_angles", _INT),
        *_all(_POINTER, "angles turns last"),
        ("unwrapped", _INT),
        *_all(_POINTER, "link tank"),
        ("row", _INT),
        *_all(_POINTER, "account far credit"),
        *_all(_INT, "manifold rows rank"),
        ("scale", _POINTER),
    )


class Meter(ctypes.Structure):
    _fields_ = (
        *_all(Reader, "source held x"),
        *_all(_POINTER, "counts stamps ticks samples moves efforts totals"),
        *_all(_INT, "room full least"),
    )


class Table(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "block view where rows room due count reached"),
        *_all(_INT, "n every"),
    )


class Op(ctypes.Structure):
    _fields_ = (*_all(_INT, "code a b c d"), ("x", _DOUBLE))


class Side(ctypes.Structure):
    _fields_ = (*_all(_INT, "started done awaited longer"),)


class Clock(ctypes.Structure):
    _fields_ = (("starts", _POINTER), *_all(_INT, "n at next"), ("side", _POINTER))


class Pace(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "clock wait"),
        *_all(_INT, "origin most reached due begun ticks missed moved latest longest"),
        *_all(_POINTER, "lateness steps"),
    )


class Block(ctypes.Structure):
    _fields_ = (*_all(_INT, "first last"),)


class Loop(ctypes.Structure):
    _fields_ = (
        *_all(_POINTER, "points values ops fmus setters holds meters tables"),
        *_all(_DOUBLE, "numerator denominator"),
        ("late", _INT),
    )


class At(ctypes.Structure):
    _fields_ = (*_all(_INT, "op last what status"),)


class Events(ctypes.Structure):
    _fields_ = (
        ("clocks", _POINTER),
        *_all(_INT, "n_clocks end"),
        *_all(_POINTER, "keys key kinds"),
        *_all(_INT, "n_kinds kind tick events patience since read unread stride"),
        ("pace", _POINTER),
        ("at", At),
    )


ALL = (
    Place, Kind, Transfer, Check, Fmu, Setter, Link, Tank, Reader, Queue, Account, Hold,
    Meter, Table, Op, Side, Clock, Pace, Block, Loop, At, Events,
)  # fmt: skip

(
    PYTHON, GET, SET, STEP, PUSH, EVALUATE, BLEND, SAMPLE, MOVE, FEED, RECORD, STOP_WHEN,
) = range(12)  # fmt: skip
"""Codes of operations."""

(
    DONE, CALL, JUDGE, FAILED, RAISED, STEPPED, UNSAVED, UNRESTORED, DRAW, STOP, KIND, STARTS,
    PAUSE, GROW,
) = range(14)  # fmt: skip
"""Why the loop returns."""
