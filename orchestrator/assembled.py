"""How far assembly has moved the start pose that a scene gives: the loops are closed from there
by Newton's steps, which may end in a pose that was not meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from hapticlink.orchestrator.instances import KINDS
from hapticlink.orchestrator.system import System

TOLD = {"rad": 0.1, "m": 0.01}
"""From here on a move is told."""
_UNITS = {"revolute": ("rad",), "prismatic": ("m",), "free": ("m", "m", "rad")}
MECHANISM = "virtual_mechanism"


def moved(linkage: Mapping[str, Any], q: Sequence[float]) -> Iterator[str]:
    """A line where the start of joints in [linkage] is far from the assembled q."""
    if far := list(_far(linkage, q)):
        yield f"the loops do not close at the start given; assembly moved {', '.join(far)}"


def _far(linkage: Mapping[str, Any], q: Sequence[float]) -> Iterator[str]:
    rest = iter(q)
    for joint in linkage["joint"]:
        units = _UNITS[joint["type"]]
        found = list(islice(rest, len(units)))
        if joint["name"] not in linkage["start"]:
            continue
        given = np.atleast_1d(linkage["start"][joint["name"]]).tolist()
        for start, value, unit in zip(given, found, units, strict=True):
            if abs(value - start) > TOLD[unit]:
                yield f"{joint['name']} from {start:.6g} to {value:.6g} {unit}"


def at_start(system: System) -> list[float]:
    """q of the mechanism alone, as its FMU assembles it in initialisation; none without one."""
    unit = system.unit.get(MECHANISM)
    if unit is None:
        return []
    outputs = np.zeros(len(unit.description.outputs))
    made = KINDS[unit.description.fmi](MECHANISM, unit.description, outputs, unit.starts)
    with made as instance:
        instance.enter_initialization(1.0)
        instance.read()
    return coordinates(dict(zip((s.name for s in unit.description.outputs), outputs, strict=True)))


def coordinates(values: dict[str, float]) -> list[float]:
    """q[1], q[2], ... of named values."""
    return [float(value) for name, value in values.items() if name.startswith("q[")]
