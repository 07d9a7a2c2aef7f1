"""The run of a scene from its start, by the periods of its lifted map: where it comes to rest, or
is nearest to it.

What counts are the states and inputs of the FMUs. Outputs may change that nothing reads, and holds
keep accounts that only grow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.faults import FmuFault, InputFault

TOLERANCE = 1e-9
"""Of each coordinate z at rest, relative to max(1, |z|)."""
STILL = 1e-5
"""Largest change of a state at rest within a period, relative to max(1, |z|)."""
AS_CALM = 10.0
"""Times the least change over a period up to which a state counts as no less near to rest: a
mechanism that coasts or swings is as calm anywhere, and is judged near its start."""
KEPT = 2000
"""Most states of a run that are kept."""


@dataclass(frozen=True)
class Trajectory:
    """States (k, n) of a run at the `times` (k,) (s), and what each changes over a period,
    `unrest` (k,), relative to max(1, |z|): inf where it repeats after a period without being at
    rest. moving: the coordinates that count. ended: what ended the run before its time, but for
    rest."""

    times: Vector
    states: Matrix
    unrest: Vector
    moving: NDArray[np.intp]
    ended: str = ""

    @property
    def rests(self) -> bool:
        """Whether it ends at rest."""
        return bool(self.unrest[-1] <= TOLERANCE)

    def begins(self) -> Iterator[Vector]:
        """States from which a search for the equilibrium may begin: the one that is nearest to
        rest, or the first that is as calm, and then those on the way, ever sparser."""
        calm = max(TOLERANCE, AS_CALM * float(self.unrest.min()))
        calmest = len(self.unrest) - 1 if self.rests else int(np.argmax(self.unrest <= calm))
        k = 0
        yield self.states[calmest]
        while k < len(self.states):
            if k != calmest:
                yield self.states[k]
            k += 1 + k // 2

    def distances(self, point: Vector) -> Vector:
        """Of each state (k,) from a point, relative to max(1, |z|)."""
        z = point[self.moving]
        return relative(self.states[:, self.moving] - z, z).max(axis=1)


def trajectory(map_: LiftedMap, seconds: float) -> Trajectory:
    """The run from the start of the map, for `seconds` or until it rests, repeats itself or fails.

    Raises InputFault where a target, wrench or drive changes with time, and as `image` does.
    """
    moving = map_.moving
    with suppress(FmuFault):  # the run tells of it
        require_constant(map_, map_.start, moving)
    periods = int(seconds / map_.period)
    every = math.ceil((periods + 1) / KEPT)
    times, states, unrest, ended = [], [], [], ""
    state = map_.start
    for k in range(periods + 1):
        try:
            image = map_.image(state)
        except FmuFault as fault:  # each period runs by the clock of the first
            since = fault.time + k * map_.period
            ended = str(FmuFault(fault.fmu, fault.what, since, fault.messages))
            break
        except InputFault:
            if k == 0:
                raise
            ended = "a hold begins anew, as where the number of constrained directions changes"
            break
        change = float(relative(image - state, state)[moving].max(initial=0.0))
        if not math.isfinite(change):
            ended = "its numbers are no longer finite"
            break
        repeats = change <= TOLERANCE
        if repeats and not still(map_, state):
            change = math.inf
        if k % every == 0 or repeats:
            times.append(map_.begin + k * map_.period)
            states.append(state)
            unrest.append(change)
        if repeats:
            break
        state = image
    if not states:
        raise InputFault(f"no equilibrium found: the run fails at its start ({ended})")
    return Trajectory(np.array(times), np.array(states), np.array(unrest), moving, ended)


def still(map_: LiftedMap, state: Vector) -> bool:
    """Whether a state with F(z) = z is at rest within the period, too: an oscillation whose period
    divides that of the map repeats as well, such as a limit cycle of motors that saturate, at half
    the haptic rate."""
    taken, moved = map_.moving, 0.0
    z = state[taken]

    def watch(numbers: Vector) -> None:
        nonlocal moved
        moved = max(moved, float(relative(numbers[taken] - z, z).max(initial=0.0)))

    map_.image(state, watch)
    return moved <= STILL


def require_constant(map_: LiftedMap, state: Vector, taken: NDArray[np.intp]) -> None:
    """Raises InputFault where the second period from `state` on is another map than the first one,
    as under a target that moves, seen in the coordinates `taken`."""
    once, again = map_.image(map_.image(state))[taken], map_.second(state)[taken]
    moved = relative(again - once, once)
    if moved.max(initial=0.0) > 10 * TOLERANCE:
        raise InputFault(
            f"the equilibrium moves with time, as under a drive or target that does: by "
            f"{moved.max():.1e} in {map_.period:.4g} s, seen in "
            f"{map_.coordinates[taken[int(np.argmax(moved))]]}; give `at`, a time from which "
            f"on nothing changes, here later than {map_.begin:.4g} s"
        )


def relative(change: Matrix, z: Vector) -> Matrix:
    """|change| of coordinates z, relative to max(1, |z|)."""
    return np.abs(change) / np.maximum(1.0, np.abs(z))
