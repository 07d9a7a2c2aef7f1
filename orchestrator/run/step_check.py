"""Estimates the integration error of plants during a run, by step doubling on a few of their steps.

e_k = |v(t_k + h) - v_2(t_k + h)| / max |v|

v are the outputs that are first derivatives of others, v_2 the same after two steps of h/2 from
the same FMU state with the same inputs (Hairer, Norsett, Wanner, Solving Ordinary Differential
Equations I (1993), section II.4, without the factor 1/(1 - 2^-p): a step may be too long for its
order p to show). e_k of about 1 is a step beyond the stability of its method, as with a stiff drive
at a light body. The sum of all e_k estimates what the errors of a run add up to where the motion
neither damps nor amplifies them.

One step in EVERY is checked, so that EVERY e_k stands for the sum. Episodes that are shorter, such
as an impact or a light body that passes a dead centre, show in the change of v over a step: the
first step, and each after one that changed v by a multiple JUMP of all before, are checked, too,
and count once.

The state is restored before the step that counts, so that results do not depend on the check. Only
FMUs with a hapticlink annotation are checked: others may keep what they do not restore.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from hapticlink.orchestrator.base.errors import FmuFault
from hapticlink.orchestrator.fmi import capabilities
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.instance import Instance, Vector
from hapticlink.orchestrator.results.run_record import StepErrors

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
"""Rate (1/s), relative to the magnitude of the output itself, below which it is at rest."""

ROOM = 256
"""Checks for which there is room at first."""


class StepCheck:
    """Checks steps of an FMU for which `possible` is true."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        names = [s.name for s in instance.description.outputs]
        pairs = _first_derivatives(instance.description)
        ports = [_port(rate) for _, rate in pairs]
        self._names = sorted(set(ports))
        # What follows is shared with the compiled loop; `changed` tells it of new arrays.
        self.bases = np.array([names.index(base) for base, _ in pairs], dtype=np.int64)
        self.rates = np.array([names.index(rate) for _, rate in pairs], dtype=np.int64)
        self.ports = np.array([self._names.index(p) for p in ports], dtype=np.int64)
        self.last = np.full(len(pairs), np.nan)
        self.scales, self.jumps = np.zeros((2, len(self._names)))
        self.steps, self.count, self.size = ctypes.c_int64(), ctypes.c_int64(), ctypes.c_double()
        self.estimates = np.zeros((ROOM, len(self._names)))
        self.times, self.weights = np.zeros((2, ROOM))
        self.changed: Callable[[], object] = lambda: None

    @staticmethod
    def possible(description: Description) -> bool:
        """Whether an FMU is a plant of this project whose state can be restored."""
        return (
            description.declares_timing
            and description.timing == "continuous"
            and capabilities.restores_state(description)
            and capabilities.varies_step(description)
            and bool(_first_derivatives(description))
        )

    def around(self, step: Callable[[], object], time: float, end: float) -> None:
        """Call `step`, which takes the FMU from `time` to `end` (s), and check it if it is due."""
        self.steps.value += 1
        regular = self.steps.value % EVERY == FIRST
        if not self._moved() and not regular:
            step()
            return
        instance, outputs = self._instance, self._instance.outputs
        before = outputs.copy()
        instance.save(SLOT)
        halves = self._halves(time, end)
        instance.rollback(SLOT)
        step()
        instance.read()
        if halves is not None:
            self._compare(outputs, halves, time, end, EVERY if regular else 1)
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

    def _moved(self) -> bool:
        """Whether this is the first step (v before it is NaN) or the last one changed v by more
        than those before; records v and the change."""
        outputs = self._instance.outputs
        rates, changes = outputs[self.rates], np.zeros(len(self._names))
        np.maximum.at(changes, self.ports, np.abs(rates - self.last))
        moved = not np.all((changes <= JUMP * self.jumps) | (changes <= SHARE * self.scales))
        if moved:
            np.fmax(self.jumps, changes, out=self.jumps)
        size = np.fmax(np.abs(rates), AT_REST * np.abs(outputs[self.bases]))
        np.fmax.at(self.scales, self.ports, size)
        self.last[:] = rates
        return moved

    def _compare(self, whole: Vector, halves: Vector, time: float, end: float, weight: int) -> None:
        estimate = np.zeros(len(self._names))
        np.maximum.at(estimate, self.ports, np.abs(whole[self.rates] - halves[self.rates]))
        if not np.all(np.isfinite(estimate)):
            return
        if (k := self.count.value) == len(self.times):
            self.estimates = np.concatenate([self.estimates, np.zeros_like(self.estimates)])
            self.times, self.weights = (np.append(v, 0.0 * v) for v in (self.times, self.weights))
            self.changed()
        self.estimates[k], self.times[k], self.weights[k] = estimate, time, weight
        self.count.value, self.size.value = k + 1, max(self.size.value, end - time)

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


def _first_derivatives(description: Description) -> list[tuple[str, str]]:
    """Outputs with their derivatives, the first in time: derivatives of these are no states."""
    rates = set(description.derivatives.values())
    return [(y, dy) for y, dy in description.derivatives.items() if y not in rates]


def _port(name: str) -> str:
    return name.partition("[")[0]
