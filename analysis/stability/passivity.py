"""The user's port of a scene: is what a hand feels passive?

Around the equilibrium, with the hand cut off, a force u_k that is held over each haptic period T
moves the handle by x_{k+1} - x_k. Over a hyperperiod of N periods, both stacked,

    z' = A z + B u,   x = C z + D u,   v = (x_{k+1} - x_k)/T,   u = Z(w) v,   z' = exp(i w N T) z

is the impedance of the port, of all that runs and at all rates. The device alone, with its other
inputs held, has Z_d; the rendering is Z - Z_d. It takes from a hand at least the energy

    b = -min over w of the least eigenvalue of (Z - Z_d + (Z - Z_d)*)/2

times v^2 a second less than it should, so that the device must have more damping than b: for one
rate and an H(z) from the position to the force this is the condition of Colgate and Schenkel, J.
Robotic Systems 14 (1997), 37:

    b > T/2 1/(1 - cos wT) Re{(1 - exp(-i w T)) H(exp(i w T))}

Between samples the velocity is taken for its mean: for a rendering of positions that is the worst
hand, as there; for one that reads velocities or forces it is the worst of the hands that hold their
force. With several haptic periods in a hyperperiod the port mixes the frequencies w + 2 pi h/P: a
hand that does not change with time answers to each alone, so that b is bounded from below by each
harmonic with the others let go, and from above by scales for them (absolute_stability.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.stability import two_port
from hapticlink.analysis.stability.absolute_stability import damping_shortage, least
from hapticlink.analysis.stability.harmonics import Hybrid, MotionScale, hertz, with_worst
from hapticlink.analysis.stability.lifted_map import long_enough, open_lifted_map
from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.port_response import (
    LARGEST,
    HandPort,
    MechanismPort,
    Response,
    forces,
    hand_port,
    mechanism_port,
    response,
)
from hapticlink.analysis.stability.poses import in_own_hand
from hapticlink.analysis.stability.short_hyperperiod import in_periods
from hapticlink.analysis.stability.smooth_scene import linearisable
from hapticlink.analysis.stability.stand_in import StandIn, find_stand_ins, record_stand_ins
from hapticlink.analysis.stability.two_port import ROUNDING, TwoPort, between, mixes
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.arrays import Complex, Vector
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact, write_exact
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

FREQUENCIES = 32
SLOW = 1e-3
"""The frequency (Hz) below which a damping is said to be needed in slow motion."""


@dataclass(frozen=True)
class Passivity:
    """The passivity of the user's port; dampings in N.s/m."""

    title: str
    needed: float
    """The damping of the device that suffices for stability with any passive hand."""
    at_least: float
    """The damping that is necessary: the same where the rendering mixes no frequencies."""
    turning: float
    """`needed` for rotations (N.m.s/rad), 0 without any."""
    own: float
    """The damping that the device has, in the same scale."""
    frequency: float
    """The frequency (Hz) at which `at_least` is needed."""
    curve: tuple[tuple[float, float], ...]
    """Frequencies (Hz) and the damping that is necessary there."""
    two_port: TwoPort | None
    """The rendering between the hand and a virtual mechanism, None without one behind a device."""
    rounded: str = ""
    """Which rate is judged in place of one with which events hardly repeat; empty for none."""
    stand_ins: tuple[StandIn, ...] = ()
    """What stands for FMUs whose state cannot be read."""

    @property
    def passive(self) -> bool:
        """Whether the device's own damping suffices."""
        return self.own >= self.needed

    def record(self) -> dict[str, Any]:
        """The part of stability.json on the user's port."""
        return {
            "passive": self.passive,
            "damping_needed": self.needed,
            "damping_necessary": self.at_least,
            "damping_needed_in_rotation": self.turning,
            "damping_of_device": self.own,
            "least_passive_frequency": self.frequency,
            "damping_necessary_by_frequency": [list(pair) for pair in self.curve],
            "rounded": self.rounded,
            "two_port": self.two_port.record() if self.two_port else None,
            **record_stand_ins(self.stand_ins),
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        needed = between(max(0.0, self.at_least), max(0.0, self.needed))
        slow = "in slow motion" if self.frequency < SLOW else f"at {self.frequency:.4g} Hz"
        turning = f" and {max(0.0, self.turning):.4g} N.m.s/rad" if self.turning else ""
        yield (
            f"user's port: {'passive' if self.passive else 'not passive'}: the device needs a "
            f"damping of {needed} N.s/m{turning} and has {self.own:.4g}; most is needed {slow}"
        )
        if self.rounded:
            yield f"  {self.rounded}"
        for each in self.stand_ins:
            yield f"  {each}"
        yield (
            "  no hand can take energy out of it in small motions about this equilibrium"
            if self.passive
            else "  for a person the verdict in hands decides; a hand without damping there could "
            "take energy out of it, which softer gains, a higher rate or more damping mend"
        )
        if self.two_port:
            yield from self.two_port.lines()


@one_blas_thread()
def passivity(scene: str | Path | Scene, options: Options = ()) -> Passivity:
    """The passivity of the user's port of a scene, around its equilibrium, and the absolute
    stability of the rendering between the hand and the virtual mechanism behind a device. Of
    several users it is the first one's port, with the others in the hands of the scene.

    Raises InputFault for a scene without equilibrium in its own hand, one whose hand pushes no
    device, or with a hyperperiod of more than 600 forces with a frame in it alone, too.
    """
    read, said = open_scene.load(scene, options), ""
    hand, mechanism, count = _ports(read)
    if count > LARGEST and read.graphics is not None:
        read, said = in_periods(read)
        hand, mechanism, count = _ports(read)
    if count > LARGEST:
        higher = write_exact(exact(read.haptics.rate) / 16)
        raise InputFault(
            f"user's port: {count} forces in a hyperperiod, at most {LARGEST}: take a higher "
            f"graphics rate, such as --set graphics.rate={higher}"
        )
    with in_own_hand(read) as (place, _):
        found = of(read.title, place.period({}), hand, mechanism, place.T)
    return replace(found, rounded=said)


def _ports(read: Scene) -> tuple[HandPort, MechanismPort | None, int]:
    """The ports of a scene, and the entries of the forces there in a hyperperiod."""
    with linearisable(read) as (_, system, _):
        hand = hand_port(system)
        mechanism = mechanism_port(system, hand)
        with open_lifted_map(long_enough(read, system), read) as map_:
            return hand, mechanism, forces(map_, hand, mechanism)


def of(
    title: str, period: LinearPeriod, hand: HandPort, mechanism: MechanismPort | None, T: float
) -> Passivity:
    """The passivity of a period at its equilibrium; T (s) is the haptic period. Raises InputFault
    where the handle does not take one force each haptic period."""
    whole, device = (response(period, hand, alone=alone) for alone in (False, True))
    P = period.map_.period
    if whole.forces != whole.m * round(P / T):
        raise InputFault(
            f"user's port: {hand.handle} takes {whole.forces // whole.m} forces in "
            f"{P / T:.4g} haptic periods"
        )
    port = _UserPort(whole, device, T, P, hand.lengths)
    angles = port.grid(np.union1d(_angles(port.N), port.scale.resonances(whole)))
    angles = with_worst(angles, lambda angle: max(port.necessary(angle)))
    curve = [pair for angle in angles for pair in port.curve(angle)]
    frequency, at_least = max(curve, key=lambda pair: pair[1])
    own, sufficient = zip(*map(port.own_and_sufficient, angles), strict=True)
    if frequency == hertz(angles[0], 0, port.N, P):
        at_least = at_zero(lambda angle: port.necessary(angle)[0], angles[0])
        frequency = 0.0
        curve.append((frequency, at_least))
    if sufficient[0] == max(sufficient) > -np.inf:
        sufficient = (at_zero(lambda a: port.own_and_sufficient(a)[1], angles[0]), *sufficient)
    needed = max(at_least, *sufficient)
    return Passivity(
        title=title,
        needed=needed,
        at_least=at_least,
        turning=needed * port.scale.turns,
        own=min(own),
        frequency=frequency,
        curve=tuple(sorted(curve)),
        two_port=_between(period, hand, mechanism, port, angles) if mechanism else None,
        stand_ins=find_stand_ins(period.map_.work.responses),
    )


def at_zero(shortage: Callable[[float], float], angle: float) -> float:
    """The limit of a damping shortage at the angle 0, of which it is an even function, from that at
    the least `angle` of a grid and twice as far; not below the first of them."""
    near, far = shortage(angle), shortage(2 * angle)
    return near + max(0.0, (near - far) / 3)


class _UserPort:
    """The port of all that runs, `whole`, and of the device alone, at angles w P of the hyperperiod
    P (s); N haptic periods T (s) in each. The first `lengths` directions are translations."""

    def __init__(self, whole: Response, device: Response, T: float, P: float, lengths: int) -> None:
        self._whole, self._device, self._P = whole, device, P
        self.N, self.scale = whole.forces // whole.m, MotionScale(device, whole, T, lengths)
        self._moving_of_free = self.scale.free.T @ self.scale.moving

    def _impedances(self, angle: float) -> tuple[Hybrid, Complex]:
        """The port, and the device alone in its directions."""
        scale = self.scale
        Z = scale.at(self._device, angle, 0.0, scale.free).impedance
        along = np.kron(np.eye(self.N), self._moving_of_free)
        return scale.at(self._whole, angle, 0.0, scale.moving), along.T @ Z @ along

    @cache  # noqa: B019 (few numbers, and the port does not live long)
    def necessary(self, angle: float) -> list[float]:
        """The damping that is necessary, by harmonic."""
        port, alone = self._impedances(angle)
        shortages = []
        for h in range(self.N):
            i = slice(h * port.r, (h + 1) * port.r)
            Z = port.harmonic(h).impedance
            shortage = least(Z - alone[i, i])
            none = ROUNDING * float(np.abs(Z).max())
            shortages.append(shortage if abs(shortage) > none else 0.0)
        return shortages

    def curve(self, angle: float) -> list[tuple[float, float]]:
        """The frequencies (Hz) of the harmonics, and the damping that is necessary at each."""
        shortages = enumerate(self.necessary(angle))
        return [(hertz(angle, h, self.N, self._P), shortage) for h, shortage in shortages]

    def own_and_sufficient(self, angle: float) -> tuple[float, float]:
        """The damping that the device has, and one that suffices although frequencies mix: -inf
        where they do not, since there it is the necessary one."""
        port, alone = self._impedances(angle)
        own, sufficient = -least(alone), -np.inf
        if mixes(port):
            blocks = [port.r] * (len(port.Y) // port.r)
            sufficient = damping_shortage(port.impedance - alone, blocks)
        return own if abs(own) > ROUNDING * np.abs(alone).max() else 0.0, sufficient

    def grid(self, angles: Vector) -> Vector:
        """The angles at which the device moves. Next to half the haptic rate, which is at 0 or at
        pi, it may seem to move by rounding."""
        still = np.array([a for a in angles if not self.scale.moved(self._device, a)])
        self._low = still[still < np.pi / 2].max(initial=0.0)
        self._high = still[still >= np.pi / 2].min(initial=np.inf)
        return self.within(angles)

    def within(self, angles: Vector) -> Vector:
        """The angles within the limits of the `grid`."""
        return angles[(self._low < angles) & (angles < self._high)]


def _between(
    period: LinearPeriod,
    hand: HandPort,
    mechanism: MechanismPort,
    port: _UserPort,
    angles: Vector,
) -> TwoPort:
    """The rendering between the hand and the mechanism, at `angles` and those of its resonances."""
    cut, scale, P = response(period, hand, mechanism), port.scale, period.map_.period
    H = P * len(mechanism.moved) / (len(cut.D) - cut.forces)

    def two_port_at(angle: float) -> Hybrid:
        return scale.at(cut, angle, H, scale.moving)

    angles = port.within(np.union1d(angles, scale.resonances(cut)))
    angles = with_worst(angles, lambda angle: two_port.largest_shortage(two_port_at(angle)))
    ports = [(angle, two_port_at(angle)) for angle in angles]
    return two_port.judge_ports(ports, P, scale.turns, cut.radius, mechanism.kept)


def _angles(N: int) -> Vector:
    """Frequencies w P up to pi, as many as N harmonics of each leave to be taken."""
    count = max(6, FREQUENCIES // N)
    grids = np.geomspace(1e-2, np.pi, count), np.linspace(0.0, np.pi, count)[1:]
    return np.unique(np.concatenate(grids))
