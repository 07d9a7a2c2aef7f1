"""Holds of the compiled loop without FMUs, on signals of a test."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.holds.hold import HoldContext
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold, array, make_tank
from hapticlink.orchestrator.run.compiled.library import load
from hapticlink.orchestrator.run.energy.bonds import Reader
from hapticlink.orchestrator.run.energy.meter import Meter
from hapticlink.orchestrator.run.hold_parts import HoldParts, SpringParts

Vector = NDArray[np.float64]


class Bench:
    """`values` are the signals that holds and meters read, by their places; base: a tick (s)."""

    def __init__(self, n: int = 1, base: Fraction = Fraction(1)) -> None:
        self.values, self.base = np.zeros(n), base
        self.loop = structures.Loop()
        self.loop.fill(self, "values")
        self.loop.fill(base, "numerator", "denominator")

    def seconds(self, ticks: float) -> float:
        return ticks * self.base.numerator / self.base.denominator

    def reader(self, places: Sequence[int], factor: Vector | float = 1.0) -> Reader:
        return Reader(self, [*places], factor)  # type: ignore[arg-type]

    def hold(
        self, name: str, size: int = 1, tank: structures.Tank | None = None, **parts: Any
    ) -> CompiledHold:
        """A hold; parts: of HoldParts."""
        kind = HOLDS[name]
        width = 2 * size if kind.needs in ("derivative", "integral") else size
        if kind.needs == "gradient":
            reader = parts.setdefault("beside", self.reader([0]))
            width += len(reader.where) * (1 + size)
        context = HoldContext(size, self.seconds, parts.get("displacement"), parts.get("velocity"))
        every = HoldParts(name, kind, tuple(range(width)), context, self.base, **parts)
        loop, held = ctypes.addressof(self.loop), np.zeros(size)
        hold = CompiledHold(load(), loop, every, held, "here -> there", tank)
        vars(hold)["bench"] = self  # which its addresses lead to
        return hold

    def tank(self, stiffness: Vector, damping: Vector, near: Sequence[int], **spring: Any) -> Any:
        """The energy tank of a spring whose near end is at the places `near`."""
        given = {"turns": np.zeros(len(stiffness)), "period": self.seconds(1)} | spring
        return make_tank(SpringParts(stiffness, damping, self.reader(near), **given))

    def meter(self, source: Sequence[int], held: Sequence[int], x: Reader) -> MeterOfTest:
        return MeterOfTest(self, source, held, x)


class MeterOfTest:
    """A meter, whose rows a test adds as the loop does."""

    def __init__(self, bench: Bench, source: Sequence[int], held: Sequence[int], x: Reader) -> None:
        self._bench, library = bench, load()
        self.meter = Meter(library, bench.reader(source), bench.reader(held), x)
        meters = (ctypes.c_void_p * 1)(ctypes.addressof(self.meter.c))
        self._ops = (structures.Op * 1)()
        self._loop = structures.Loop()
        self._loop.fill(bench, "values")
        self._loop.fill(meters=meters, ops=self._ops)
        self._block = library.block

    def _do(self, *operation: Any) -> None:
        self._ops[0] = structures.Op(*operation)
        at = structures.At(0, 1)
        while self._block(ctypes.addressof(self._loop), ctypes.addressof(at), 0):
            self.meter.grow()

    def sample(self, stamp: int) -> None:
        self._do(structures.SAMPLE, 0, stamp)

    def move(self, tick: int) -> None:
        self._do(structures.MOVE, 0, tick)

    def hold(self, share: float) -> None:
        self._do(structures.FEED, 0, 0, 0, 0, share)

    def energy(self, seconds: float) -> Any:
        return self.meter.energy(seconds)


def vector(hold: CompiledHold, name: str) -> Vector:
    """A vector of the energy account of a hold, as it is."""
    return array(getattr(hold.account, name), hold.account.n)


def generated(hold: CompiledHold) -> float:
    """The energy (J) that a hold has booked as generated until its newest step."""
    work, ideal, sample, x, x_stamp = (
        vector(hold, name) for name in ("work", "ideal", "sample", "x", "x_stamp")
    )
    return float((work - ideal - sample * (x - x_stamp)).sum())


def credit(hold: CompiledHold) -> float:
    """The energy (J) that the far side of a spring has put in, as its hold knows it."""
    loop = ctypes.addressof(vars(hold)["bench"].loop)
    return float(load().credit(ctypes.addressof(hold.account), loop))
