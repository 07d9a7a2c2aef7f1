"""The check of a plant's steps during a run; what it finds, and how, is told in
run/compiled/step_check.c."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.instance import Instance, Vector
from hapticlink.orchestrator.results.run_record import StepErrors
from hapticlink.orchestrator.run.compiled import structures

EVERY = 97
"""One step in so many is checked, which adds two half steps, a saved state and two reads to them. A
prime, so that checks fall on all phases between two rates."""
FIRST = 13
SLOT = 2
"""Slot of the saved FMU state, beside that of iteration."""
JUMP, SHARE = 2.0, 0.05
"""A step is checked where the one before has changed v by more than a JUMP of the largest change
that led to a check, and by more than a SHARE of the largest v."""
AT_REST = 1e-6
"""Rate (1/s), relative to the largest of the outputs of which rates are checked, below which all of
them are at rest."""

REGULAR = 1
"""What the library tells of a step that is one of these."""
_ARRAYS = ("scales", "jumps", "last", "estimates", "times", "weights")
ROOM = 256
"""Checks for which there is room at first."""


class StepCheck:
    """Checks steps of an FMU for which `possible` is true; `c` is its structure."""

    def __init__(self, library: ctypes.CDLL, instance: Instance) -> None:
        self._library, self._instance = library, instance
        names = [s.name for s in instance.description.outputs]
        pairs = find_first_derivatives(instance.description)
        ports = [_port(rate) for _, rate in pairs]
        self._names = sorted(set(ports))
        rows = ((names.index(b), names.index(r), self._names.index(_port(r))) for b, r in pairs)
        self.bases, self.rates, self.ports = np.array([*rows], dtype=np.int64).T.copy()
        self.last = np.full(len(pairs), np.nan)
        self.scales, self.jumps = np.zeros((2, len(self._names)))
        self.steps, self.count, self.size = ctypes.c_int64(), ctypes.c_int64(), ctypes.c_double()
        self.estimates = np.zeros((ROOM, len(self._names)))
        self.times, self.weights = np.zeros((2, ROOM))
        self.c = c = structures.Check()
        c.fill(self, "steps", "count", "bases", "rates", "ports", "scales", "jumps", "last", "size")
        c.fill(n=len(pairs), n_ports=len(self._names))
        c.fill(every=EVERY, first=FIRST, at_rest=AT_REST, jump=JUMP, share=SHARE)
        scratch = np.zeros((2, len(instance.outputs)))
        c.fill(before=scratch[0], halves=scratch[1])
        self.take_rows()

    @staticmethod
    def possible(description: Description) -> bool:
        """Whether an FMU is a plant of this project whose state can be restored."""
        return (
            description.declares_timing
            and description.timing == "continuous"
            and description.restores_state
            and description.varies_step
            and bool(find_first_derivatives(description))
        )

    def take_rows(self) -> None:
        """Tell the loop where its rows are, and how many there can be."""
        self.c.fill(self, "times", "weights", errors=self.estimates, room=len(self.times))

    def grow(self) -> None:
        """Make room for as many checks again."""
        self.estimates = np.concatenate([self.estimates, np.zeros_like(self.estimates)])
        self.times, self.weights = (np.append(v, 0.0 * v) for v in (self.times, self.weights))
        self.take_rows()

    def saved(self) -> dict[str, Any]:
        """All that its checks have found, and what decides on the next one."""
        arrays = {name: getattr(self, name).copy() for name in _ARRAYS}
        numbers = [self.steps.value, self.count.value, self.size.value]
        return {"arrays": arrays, "numbers": numbers}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from there."""
        while len(self.times) < len(saved["arrays"]["times"]):
            self.grow()
        for name in _ARRAYS:
            getattr(self, name)[:] = saved["arrays"][name]
        self.steps.value, self.count.value, self.size.value = saved["numbers"]

    def around(self, step: Callable[[], object], time: float, end: float) -> None:
        """Call `step`, which takes an FMU that the loop does not call itself from `time` to `end`
        (s), and check it if it is due."""
        instance, outputs, check = self._instance, self._instance.outputs, ctypes.addressof(self.c)
        if self.count.value == len(self.times):
            self.grow()
        due = self._library.check_due(check, outputs.ctypes.data)
        if not due:
            step()
            return
        before = outputs.copy()
        instance.save(SLOT)
        halves = self._halves(time, end)
        instance.rollback(SLOT)
        step()
        instance.read()
        if halves is not None:
            arrays = outputs.ctypes.data, halves.ctypes.data
            self._library.check(check, *arrays, time, end, due == REGULAR)
        outputs[:] = before

    def _halves(self, time: float, end: float) -> Vector | None:
        """The outputs at `end` after two steps; None where one of these fails."""
        instance, half = self._instance, (end - time) / 2
        try:
            instance.step(time, time + half, half)
            instance.step(time + half, end, half)
            instance.read()
        except FmuFault:
            return None
        return instance.outputs.copy()

    def errors(self) -> StepErrors | None:
        """What was found; None before the first check."""
        if not self.count.value:
            return None
        estimates = self.estimates[: self.count.value]
        share = estimates / np.where(self.scales > 0, self.scales, 1.0)
        k, port = np.unravel_index(int(share.argmax()), share.shape)
        return StepErrors(
            checked=len(share),
            sum=float((self.weights[: len(share)] @ share).max()),
            largest=float(share[k, port]),
            output=self._names[port],
            time=float(self.times[k]),
            size=self.size.value,
        )


def find_first_derivatives(description: Description) -> list[tuple[str, str]]:
    """Outputs with their derivatives, the first in time: derivatives of these are no states."""
    rates = set(description.derivatives.values())
    return [(y, dy) for y, dy in description.derivatives.items() if y not in rates]


def _port(name: str) -> str:
    return name.partition("[")[0]
