"""[controller]: impedance, teleoperation and topology gains, as a scene writes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from hapticlink.components.specs.linkage import Damping, Stiffness


@dataclass(frozen=True, kw_only=True)
class Topology:
    """Topology (joint-constraint) controller: k_j (N/m/kg), b_j (N/(m/s)/kg).

    form "plain" is M_d P_c (k_j e + b_j edot), for comparison only: it leaks onto free
    motion and depends on the length scale.
    """

    stiffness: float = 200.0
    damping: float = 50.0
    form: Literal["constrained", "plain"] = "constrained"


@dataclass(frozen=True, kw_only=True)
class Teleoperation:
    """Position channels of the four-channel controller: K_pc and B_pc of section B.6."""

    stiffness: Stiffness = (100.0, 100.0, 0.5)
    damping: Damping = (70.0, 70.0, 0.375)


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The controller block; a part that is False or None is left out.

    bias "full" adds M_d a_bias, the mechanism's velocity, gravity and drive terms, to the
    impedance law; "none" is the report. damping B_d and stiffness K_d (about the starting
    pose) are the desired ones of (4.1).
    """

    impedance: bool = True
    bias: Literal["none", "full"] = "none"
    damping: Damping | None = None
    stiffness: Stiffness | None = None
    teleoperation: Teleoperation | Literal[False] = field(default_factory=Teleoperation)
    topology: Topology | bool = True
    contact: bool = False
