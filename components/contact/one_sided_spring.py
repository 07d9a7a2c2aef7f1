"""One-sided spring-dampers, which push and never pull: contacts of links and joint limits.

    F = max(0, s)  where g < 0, else 0,   s = -k g - b g'

with the gap g and its rate g'. F jumps to -b g' where it begins (g = 0), and ends where s = 0. A
step that locates these events prescribes a law for each part of it, so that F is smooth there:
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca

OFF, ON, BY_STATE, BEGUN = 0, 1, 2, 3
"""Laws: no force; s; max(0, s) where g < 0; max(0, s) at any gap, after contact has begun."""


@dataclass(frozen=True)
class Unilateral:
    """A one-sided spring-damper: gap (m or rad) and its rate, stiffness and damping; it exists
    where `active`."""

    gap: ca.SX
    rate: ca.SX
    stiffness: ca.SX
    damping: ca.SX
    active: ca.SX | int = 1

    @property
    def push(self) -> ca.SX:
        """s (N or N.m)."""
        return -self.stiffness * self.gap - self.damping * self.rate

    @property
    def touching(self) -> ca.SX:
        return ca.logic_and(self.active, self.gap < 0)

    @property
    def pushes(self) -> ca.SX:
        """Whether F > 0."""
        return ca.logic_and(self.touching, self.push > 0)

    @property
    def energy(self) -> ca.SX:
        """Energy (J) in the spring."""
        return ca.if_else(self.touching, 0.5 * self.stiffness * self.gap**2, 0)

    def force(self, law: ca.SX | None = None) -> ca.SX:
        """F (N or N.m) by `law`, by default BY_STATE."""
        pushed = ca.fmax(0, self.push)
        if law is None:
            return ca.if_else(self.touching, pushed, 0)
        begun = ca.logic_and(self.active, ca.logic_or(self.gap < 0, law == BEGUN))
        return ca.if_else(law < BY_STATE, law * self.push, ca.if_else(begun, pushed, 0))


class OneSidedForces(ABC):
    """Forces of several one-sided spring-dampers on a linkage: its `sides`."""

    sides: Sequence[Unilateral]

    @property
    def energy(self) -> ca.SX:
        """Energy (J) stored in all of them."""
        return sum((side.energy for side in self.sides), start=ca.SX(0))

    @abstractmethod
    def efforts(self, laws: ca.SX | None = None) -> ca.SX:
        """Generalised forces Q (n x 1), each side by its law, by default BY_STATE."""

    def state_rates(self, laws: ca.SX | None = None) -> ca.SX:
        """Derivatives of the states that the forces have, none by default."""
        return ca.SX(0, 1)


class AllOneSidedForces(OneSidedForces):
    """The sum of several."""

    def __init__(self, parts: Sequence[OneSidedForces]) -> None:
        self._parts = parts
        self.sides = [side for part in parts for side in part.sides]

    @property
    def energy(self) -> ca.SX:
        return sum((part.energy for part in self._parts), start=ca.SX(0))

    def efforts(self, laws: ca.SX | None = None) -> ca.SX:
        efforts = [part.efforts(own) for part, own in self._shared(laws)]
        return sum(efforts[1:], start=efforts[0])

    def state_rates(self, laws: ca.SX | None = None) -> ca.SX:
        return ca.vertcat(*(part.state_rates(own) for part, own in self._shared(laws)))

    def _shared(self, laws: ca.SX | None) -> Iterator[tuple[OneSidedForces, ca.SX | None]]:
        """Each part with the laws of its sides."""
        first = 0
        for part in self._parts:
            last = first + len(part.sides)
            yield part, None if laws is None else laws[first:last]
            first = last
