"""Absolute stability of the rendering between the hand and the virtual mechanism: is it stable with
any passive hand and any passive mechanism? The method is that of Adams, Hannaford, IEEE Trans.
Robotics and Automation 15 (1999), 465, with sampled ports (port_response.py) of any number
of degrees of freedom (absolute_stability.py) and rates (harmonics.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticlink.analysis.stability.absolute_stability import (
    damping_shortage,
    damping_shortage_of_two,
    least,
)
from hapticlink.analysis.stability.harmonics import Hybrid, hertz

ROUNDING = 1e-6
"""Of the impedance: damping that is none, and harmonics that do not mix."""
CONCLUSIONS = {
    "absolutely stable": "no passive hand and mechanism make it unstable",
    "not absolutely stable": "some passive hand and mechanism, maybe not those of "
    "this scene, would make it unstable",
    "undecided": "whether some passive hand and mechanism would make it unstable is not known",
}
"""By verdict, what a reader learns of it."""


@dataclass(frozen=True)
class TwoPort:
    """The absolute stability of the rendering between hand and mechanism; dampings in N.s/m."""

    needed: float
    """The damping at both ports that suffices for absolute stability."""
    at_least: float
    """The damping that is necessary: the same where the rendering mixes no frequencies."""
    turning: float
    """`needed` for rotations (N.m.s/rad), 0 without any."""
    hand: float
    """The damping that the hand's port needs by itself, whatever the other has."""
    mechanism: float
    """The damping that the mechanism's port needs by itself, whatever the other has."""
    frequency: float
    """The frequency (Hz) at which `at_least` is needed."""
    below: float
    """The frequency (Hz) up to which no damping is needed."""
    radius: float
    """The spectral radius with the hand gone and the mechanism held."""
    kept: tuple[str, ...]
    """Ports of the mechanism that others read besides its pose and velocity, which stay as at the
    equilibrium here."""
    curve: tuple[tuple[float, float], ...]
    """Frequencies (Hz) and the damping that is necessary there."""

    @property
    def verdict(self) -> str:
        """absolutely stable, not absolutely stable, or undecided between both bounds."""
        if self.at_least > 0.0 or not self.held:
            return "not absolutely stable"
        return "undecided" if self.needed > 0.0 else "absolutely stable"

    @property
    def held(self) -> bool:
        """Whether it comes to rest with the hand gone and the mechanism held."""
        return self.radius <= 1.0 + ROUNDING

    def record(self) -> dict[str, Any]:
        """The part of stability.json on the two-port."""
        return {
            "verdict": self.verdict,
            "damping_needed": self.needed,
            "damping_necessary": self.at_least,
            "damping_needed_in_rotation": self.turning,
            "damping_needed_at_hand": self.hand,
            "damping_needed_at_mechanism": self.mechanism,
            "least_passive_frequency": self.frequency,
            "passive_below": self.below,
            "radius_with_hand_gone_and_mechanism_held": self.radius,
            "outputs_as_at_the_equilibrium": list(self.kept),
            "damping_necessary_by_frequency": [list(pair) for pair in self.curve],
        }

    def lines(self) -> Iterator[str]:
        """The result as text."""
        yield f"between hand and mechanism: {self.verdict}: {CONCLUSIONS[self.verdict]}"
        if not self.held:
            yield (
                "  unstable by itself, with the hand gone and the mechanism held (spectral radius "
                f"{self.radius:.6g})"
            )
        if self.kept:
            yield f"  of the mechanism as at the equilibrium: {', '.join(self.kept)}"
        if self.needed > 0.0:
            yield (
                f"  to rule that out takes a damping of {between(self.at_least, self.needed)} N.s/m"
                + (f" and {self.turning:.3g} N.m.s/rad" if self.turning else "")
                + f" at both ports ({max(0.0, self.hand):.4g} at the hand's, "
                f"{max(0.0, self.mechanism):.4g} at the mechanism's "
                f"whatever the other has), most at {self.frequency:.4g} Hz and none below "
                f"{self.below:.3g} Hz; softer gains of the coupling and higher rates need less"
            )


def between(necessary: float, sufficient: float) -> str:
    """A damping, or both bounds of it where they differ."""
    least, most = rounded_up(necessary), rounded_up(sufficient)
    return most if least == most else f"{necessary:.5g} to {most}"


def rounded_up(damping: float) -> str:
    """A damping in 5 digits, none of which is on the unsafe side."""
    if not 0.0 < damping < np.inf:
        return f"{damping:.5g}"
    digits = 4 - int(np.floor(np.log10(damping)))
    return f"{float(np.ceil(damping * 10.0**digits * (1.0 - 1e-9)) / 10.0**digits):.5g}"


def judge_ports(
    ports: Sequence[tuple[float, Hybrid]],
    period: float,
    turns: float,
    radius: float,
    kept: tuple[str, ...] = (),
) -> TwoPort:
    """The verdict on ports at angles; `turns` converts a damping to one of rotations."""
    curve: list[tuple[float, float]] = []
    hand, mechanism, needed = -np.inf, -np.inf, -np.inf
    for angle, port in ports:
        N, r = len(port.Y) // port.r, port.r
        scales = []
        for h in range(N):
            Z = port.harmonic(h).impedance
            shortage, scale = damping_shortage_of_two(Z, r)
            if shortage <= ROUNDING * float(np.abs(Z).max()):
                shortage = min(shortage, 0.0)
            curve.append((hertz(angle, h, N, period), shortage))
            scales.append(scale)
            hand, mechanism = max(hand, least(Z[:r, :r])), max(mechanism, least(Z[r:, r:]))
        if mixes(port):
            start = np.array([*scales, *np.zeros(len(port.own) // r)])
            needed = max(needed, damping_shortage(port.impedance, [r] * len(start), start))
    frequency, at_least = max(curve, key=lambda pair: pair[1])
    needed = max(needed, at_least)
    short = [f for f, shortage in curve if shortage > 0.0]
    return TwoPort(
        needed=needed,
        at_least=at_least,
        turning=needed * turns,
        hand=hand,
        mechanism=mechanism,
        frequency=frequency,
        below=min(short, default=max(f for f, _ in curve)),
        radius=radius,
        kept=kept,
        curve=tuple(sorted(curve)),
    )


def largest_shortage(port: Hybrid) -> float:
    """The damping shortage of the harmonic in which it is largest."""
    harmonics = (port.harmonic(h) for h in range(len(port.Y) // port.r))
    return max(damping_shortage_of_two(one.impedance, one.r)[0] for one in harmonics)


def mixes(port: Hybrid) -> bool:
    """Whether the answer to a harmonic has others in it."""
    N, n = len(port.Y) // port.r, len(port.own) // port.r
    if n not in (0, N):
        return True
    blocks = np.kron(np.eye(N), np.ones((port.r, port.r)))
    return any(
        bool((np.abs(X * (1 - blocks)) > ROUNDING * np.abs(X).max()).any())
        for X in (port.Y, port.there, port.back, port.own)
        if X.size
    )
