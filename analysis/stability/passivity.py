"""The user's port of a scene: is what a hand feels passive, for any hand?

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
harmonic with the others let go, and from above by scales for them (absolute.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.analysis.stability import two_port
from hapticlink.analysis.stability.absolute_stability import lacking, least
from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.harmonics import Hybrid, Scale, hertz, with_worst
from hapticlink.analysis.stability.lifted_map import LiftedMap, lifted_map, long_enough
from hapticlink.analysis.stability.linearisable_scene import linearisable
from hapticlink.analysis.stability.linearise import Linear
from hapticlink.analysis.stability.opened_ports import (
    HandPort,
    MechanismPort,
    hand_port,
    mechanism_port,
    require_size,
    response,
)
from hapticlink.analysis.stability.trajectory import trajectory
from hapticlink.analysis.stability.two_port import ROUNDING, TwoPort, between, mixes
from hapticlink.orchestrator.base.arrays import Complex, Matrix
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene

FREQUENCIES = 32


@dataclass(frozen=True)
class Passivity:
    """The user's port. needed: damping b of the device (N.s/m) that suffices for the rendering to
    be stable with any passive hand, at_least: that which is necessary; they are the same where the
    rendering mixes no frequencies. turning: `needed` for rotations (N.m.s/rad), 0 without any. own:
    the damping that the device has, in the same scale. frequency: where `at_least` is needed (Hz).
    curve: frequencies (Hz) and what is necessary there. two_port: the rendering between the hand
    and a virtual mechanism, None without one behind the device."""

    title: str
    needed: float
    at_least: float
    turning: float
    own: float
    frequency: float
    curve: tuple[tuple[float, float], ...]
    two_port: TwoPort | None

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
            "two_port": self.two_port.record() if self.two_port else None,
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        needed = between(max(0.0, self.at_least), max(0.0, self.needed))
        yield (
            f"user's port: {'passive' if self.passive else 'not passive'} for any hand; the device "
            f"needs a damping of {needed} N.s/m"
            + (f" and {max(0.0, self.turning):.4g} N.m.s/rad" if self.turning else "")
            + f", it has {self.own:.4g}; least passive at {self.frequency:.4g} Hz"
        )
        if self.two_port:
            yield from self.two_port.lines()


def passivity(scene: str | Path | Scene, options: Options = (), *, at: float = 0.0) -> Passivity:
    """The passivity of the user's port of a scene, around its equilibrium, and the absolute
    stability of the rendering between the hand and the virtual mechanism behind a device. The
    scene is run up to the time `at` (s) before, as for `stability`. Of several users it is the
    first one's port, with the others in the hands of the scene.

    Raises InputFault as `stability` does, and for a scene whose hand pushes no device, or with a
    hyperperiod of more than 600 forces.
    """
    with linearisable(scene, options) as (read, system, _):
        hand = hand_port(system)
        with lifted_map(long_enough(read, system, at), at, read) as map_:
            mechanism = mechanism_port(system, hand)
            require_size(map_, hand, mechanism)
            linear = equilibrium(map_, trajectory(map_, read.duration))
            T = 1 / float(read.haptics.rate)
            return of(read.title, map_, linear, hand, mechanism, T)


def of(
    title: str,
    map_: LiftedMap,
    at: Linear,
    hand: HandPort,
    mechanism: MechanismPort | None,
    T: float,
) -> Passivity:
    """The passivity of a map linearised at its equilibrium; T (s) is the haptic period."""
    whole, device = (response(map_, at, hand, alone=alone) for alone in (False, True))
    if whole.forces != whole.m * round(map_.period / T):
        raise InputFault(
            f"user's port: {hand.handle} takes {whole.forces // whole.m} forces in "
            f"{map_.period / T:.4g} haptic periods"
        )
    scale, P = Scale(device, whole, T), map_.period
    free = scale.free.T @ scale.moving
    curve: list[tuple[float, float]] = []
    needed, own = -np.inf, np.inf
    N = whole.forces // whole.m

    def impedances(angle: float) -> tuple[Hybrid, Complex]:
        """The port, and the device alone in its directions."""
        device_Z = scale.at(device, angle, 0.0, scale.free).impedance
        along = np.kron(np.eye(N), free)
        return scale.at(whole, angle, 0.0, scale.moving), along.T @ device_Z @ along

    def lacks(angle: float) -> list[float]:
        """The damping that is necessary, by harmonic."""
        port, alone = impedances(angle)
        found = []
        for h in range(N):
            i = slice(h * port.r, (h + 1) * port.r)
            Z = port.harmonic(h).impedance
            lacking_here = least(Z - alone[i, i])
            none = ROUNDING * float(np.abs(Z).max())
            found.append(lacking_here if abs(lacking_here) > none else 0.0)
        return found

    angles = np.union1d(_angles(N), scale.resonances(whole))
    # Next to half the haptic rate, which is at 0 or at pi, the device may seem to move by rounding.
    still = np.array([angle for angle in angles if not scale.moved(device, angle)])
    low = still[still < np.pi / 2].max(initial=0.0)
    high = still[still >= np.pi / 2].min(initial=np.inf)
    angles = angles[(low < angles) & (angles < high)]
    angles = with_worst(angles, lambda angle: max(lacks(angle)))
    for angle in angles:
        port, alone = impedances(angle)
        has = -least(alone)
        own = min(own, has if abs(has) > ROUNDING * np.abs(alone).max() else 0.0)
        curve += [(hertz(angle, h, N, P), found) for h, found in enumerate(lacks(angle))]
        if mixes(port):
            most = lacking(port.impedance - alone, [port.r] * (len(port.Y) // port.r))
            needed = max(needed, most)
    frequency, at_least = max(curve, key=lambda pair: pair[1])
    needed = max(needed, at_least)
    both = None
    if mechanism:
        cut = response(map_, at, hand, mechanism)
        H = P * len(mechanism.moved) / (len(cut.D) - cut.forces)

        def cut_at(angle: float) -> Hybrid:
            return scale.at(cut, angle, H, scale.moving)

        angles = np.union1d(angles, scale.resonances(cut))
        angles = angles[(low < angles) & (angles < high)]
        angles = with_worst(angles, lambda angle: two_port.most_lacking(cut_at(angle)))
        both = two_port.judged(
            [(angle, cut_at(angle)) for angle in angles],
            P,
            scale.turns,
            cut.radius,
            mechanism.kept,
        )
    return Passivity(
        title,
        needed,
        at_least,
        needed * scale.turns,
        own,
        frequency,
        tuple(sorted(curve)),
        both,
    )


def _angles(N: int) -> Matrix:
    """Frequencies w P up to pi, as many as N harmonics of each leave to be taken."""
    count = max(6, FREQUENCIES // N)
    found: Matrix = np.unique(
        np.concatenate([np.geomspace(1e-2, np.pi, count), np.linspace(0.0, np.pi, count)[1:]])
    )
    return found
