"""Step-size control during a run: executes the operation Advance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.faults import FmuFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.plan.operations import Part
from hapticlink.orchestrator.results.record import Steps
from hapticlink.orchestrator.run.energy.bonds import bond
from hapticlink.orchestrator.run.fixed_point import Unconverged
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.system.system import System

SLOT = 1
"""Slot of the saved FMU states; slot 0 is used by fixed-point iteration."""


class Advancer:
    """Advances the plants of one clock in steps of controlled size. `calls` returns the bound
    operations of a step."""

    def __init__(
        self,
        clock: str,
        simulation: Simulation,
        calls: Callable[[Part], Sequence[Call]],
    ) -> None:
        system, signals = simulation.system, simulation.signals
        assert system.coupling.step_control is not None
        self._settings = settings = system.coupling.step_control
        self._clock, self._values, self._meters = clock, signals.values, simulation.meters
        self._calls, self._seconds = calls, system.timeline.seconds
        base, longest = system.timeline.base, system.timeline.clock(clock).longest
        self._least = max(int(exact(settings.min) / base), 1)
        most = longest if settings.max is None else int(exact(settings.max) / base)
        self._most = max(min(most, longest), self._least)
        self._size = float(self._least)
        self._before, self.steps = 0.0, Steps()
        self._growth = 2.0  # largest growth of a step; smaller for a while after an FMU has failed
        plants = [u.name for u in system.fmus if u.clock == clock and not u.sampled]
        self._instances = [simulation.instances[n] for n in plants]
        compared = _compared(system, signals, plants)
        self._outputs = [place for place, _ in compared]
        self._nominal = np.array([nominal for _, nominal in compared])
        between = [
            c
            for c in system.connections
            if c.source in plants and c.target in plants and not c.initial
        ]
        self._order = min((HOLDS[c.hold].order if c.hold else 1 for c in between), default=1)
        ours = [c for c in system.connections if c.hold and {c.source, c.target} & {*plants}]
        self._holds = [*(simulation.holds[c.name] for c in ours), *simulation.springs]
        self._bonds = []
        for c in between:
            if found := bond(c, system, signals):
                places = found.of(signals.sources(c)), found.of(signals.mean(c)), [*found.moved]
                self._bonds.append((found.work, places))

    def advance(self, tick: int, dticks: int) -> None:
        take = self._double if self._settings.method == "doubling" else self._trust
        at = 0
        while at < dticks:
            at += take(tick + at, self._fitting(dticks - at))

    def _fitting(self, left: int) -> int:
        """The size of the next step, so that the `left` ticks are divided about evenly."""
        self._size = size = min(max(self._size, self._least), self._most)
        parts = -int(-left // size)
        return left if parts == 1 else min(max(rounded(left / parts), self._least), left)

    def _aim(self, size: float, growth: float) -> None:
        """Sets the target size of the next steps, at most `growth` times the previous target; steps
        that were shortened to end at a tick do not change it."""
        self._size = min(max(size, 0.2 * self._size), growth * self._size)

    def _step(self, tick: int, dticks: int) -> None:
        for call in self._calls(Part(self._clock, dticks)):
            call(tick)

    def _read(self, tick: int) -> None:
        for call in self._calls(Part(self._clock, 0, ended=True)):
            call(tick)

    # --- doubling -------------------------------------------------------------------------

    def _double(self, tick: int, size: int) -> int:
        """Ticks that the time advanced: `size`, or 0 if the step was rolled back."""
        if size < 2:
            self._step(tick, size)
            self._read(tick + size)
            self.steps.count(self._seconds(size), True)
            self._size = 2.0
            return size
        saved = self._save()
        try:
            error = self._both(tick, size, saved)
        except (FmuFault, Unconverged) as fault:
            if size <= self._least or not (isinstance(fault, Unconverged) or fault.passing):
                raise
            self._restore(saved)
            self.steps.failed += 1
            self._size, self._growth = size / 2, 1.0
            return 0
        self._aim(size * integral(error, self._order), self._growth)
        self._growth = min(1.1 * self._growth, 2.0)
        if error > 1.0 and size > self._least:
            self._restore(saved)
            self.steps.rejected += 1
            return 0
        self.steps.count(self._seconds(size), error > 1.0)
        return size

    def _both(self, tick: int, size: int, saved: Any) -> float:
        """The error of a step relative to the tolerance; the result of its two halves is kept."""
        self._step(tick, size)
        self._read(tick + size)
        whole = self._values[self._outputs]
        self._restore(saved)
        half = size // 2
        for at, dticks in ((tick, half), (tick + half, size - half)):
            self._step(at, dticks)
            self._read(at + dticks)
        halves = self._values[self._outputs]
        share = np.abs(halves - whole) / (self._nominal + np.abs(halves)) / (2**self._order - 1)
        return float(share.max(initial=0.0)) / self._seconds(size) / self._settings.tolerance

    def _save(self) -> Any:
        for instance in self._instances:
            instance.save(SLOT)
        # An energy tank is shared between holds and is restored as one of `_holds`.
        holds = [hold.saved() for hold in self._holds]
        return self._values.copy(), holds, self._meters.checkpoint(deep=True)

    def _restore(self, saved: Any) -> None:
        values, holds, mark = saved
        for instance in self._instances:
            instance.rollback(SLOT)
        self._values[:] = values
        for hold, kept in zip(self._holds, holds, strict=True):
            hold.restore(kept)
        self._meters.rollback(mark)

    # --- ecco -----------------------------------------------------------------------------

    def _trust(self, tick: int, size: int) -> int:
        self._step(tick, size)
        values = self._values
        began = [[values[at] for at in places] for _, places in self._bonds]
        self._read(tick + size)
        error = 0.0
        for (source, held, x), (work, places) in zip(began, self._bonds, strict=True):
            sources, _, moved = places
            residual = (work * (held - (source + values[sources]) / 2)) @ (values[moved] - x)
            error = max(error, abs(float(residual)))
        assert self._settings.energy is not None
        error /= self._settings.tolerance * self._settings.energy
        # Slow growth, since a residual energy passes through 0 twice in a period.
        self._aim(size * proportional_integral(error, self._before, self._order + 1), 1.2)
        self._before = error
        self.steps.count(self._seconds(size), error > 1.0 and size <= self._least)
        return size


def _compared(
    system: System, signals: SignalVector, plants: Sequence[str]
) -> list[tuple[int, float]]:
    """Index and nominal of the outputs whose error is estimated: those without direct feed-through,
    since at the end of a step inputs are still those of the step; all outputs if there are no
    others."""
    every = [
        ((signals.scalar(n, s.name), s.nominal), system.fmu[n].description.follows(s))
        for n in plants
        for s in system.fmu[n].description.outputs
    ]
    return [output for output, follows in every if not follows] or [output for output, _ in every]


def integral(error: float, order: int) -> float:
    """The ratio of the next step size to the last one (integral controller), where `error` relative
    to the tolerance grows with the step size to the power `order`."""
    return 0.9 * error ** (-1 / order) if error else inf


def proportional_integral(error: float, before: float, order: int) -> float:
    """The same by a PI controller, which also uses the error `before` of the previous step
    (Gustafsson 1991, exponents 0.3 and 0.4)."""
    if not error or not before:
        return integral(error, order)
    return 0.9 * error ** (-0.3 / order) * (before / error) ** (0.4 / order)


def rounded(ticks: float) -> int:
    """Rounded down to four significant bits, at least 1, so that only few step sizes occur and each
    is bound once."""
    whole = max(int(ticks), 1)
    shift = max(whole.bit_length() - 4, 0)
    return whole >> shift << shift
