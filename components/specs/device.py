"""[device]: the twin pantograph and its observer, as a scene writes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Nicosia observer: bandwidth omega_n (rad/s), output gain k_D (1/s), and the rule of
    section 1.3.1 that discretises it."""

    rule: Literal["forward", "backward", "trapezoidal"] = "backward"
    omega_n: float = 50.0
    k_D: float = 100.0


@dataclass(frozen=True, kw_only=True)
class Device:
    """Twin pantograph. The report gives no dimensions: every number here is assumed.

    Two five-bars in parallel planes, A and B, hold the ends of a crank of length `crank`
    at p -+ (crank/2)(cos theta, sin theta). Base joints at (base_x -+ base_half_width,
    base_y_a) and (..., base_y_b), elbows outward. Lengths m, masses kg, inertias kg.m2,
    centres as distances (m) from the joint nearer the base; limits N.m.
    """

    proximal_length: float = 0.16
    distal_length: float = 0.20
    crank: float = 0.08
    base_x: float = -0.005
    base_half_width: float = 0.03
    base_y_a: float = -0.20
    base_y_b: float = 0.20
    rotor_inertia: float = 1.4e-5
    proximal_mass: float = 0.05
    proximal_center: float = 0.07
    proximal_inertia: float = 1.07e-4
    distal_mass: float = 0.035
    distal_center: float = 0.10
    distal_inertia: float = 1.17e-4
    handle_mass: float = 0.12
    handle_inertia: float = 8e-5
    torque_limit: float = 0.5
    encoder_resolution: float = 0.0015707963267948967
    reach_limit: float = 0.95
    stop_stiffness: float = 5000.0
    stop_damping: float = 20.0
    substeps: int = 1
    sensing: Literal["ideal", "encoders"] = "ideal"
    observer: Observer = field(default_factory=Observer)
