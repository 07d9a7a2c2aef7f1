"""Holds of all connections across rates, and gains of the virtual coupling, that are compared."""

from __future__ import annotations

PASSIVE = tuple(f"holds.virtual_mechanism.{w}=passive" for w in ("F_hand", "F_drift"))
SLOPE = (
    'holds."virtual_mechanism.x -> controller.x_S"=foh',
    'holds."virtual_mechanism.v -> controller.v_S"=slope',
)

HOLDS: dict[str, tuple[str, ...]] = {
    "zoh": ("hold=zoh",),
    "foh": ("hold=foh",),
    "foh-derivative": ("hold=foh-derivative",),
    "foh, slope": ("hold=foh", *SLOPE),
    "second-order": ("hold=second-order",),
    "delayed": ("hold=delayed",),
    "zoh, mean": ("hold=zoh", "downsampling=mean"),
    "passive": ("hold=passive",),
    "foh-derivative, passive": ("hold=foh-derivative", *PASSIVE),
    "pspm, passive": ("hold=pspm", *PASSIVE),
}
"""From the simplest on: of equally good ones the first is advised. `a, b`: hold a from slow to
fast, b from fast to slow (`slope`: of the velocity, from slow to fast)."""
GAINS: dict[str, tuple[str, ...]] = {
    name: (f"controller.teleoperation.stiffness={k}", f"controller.teleoperation.damping={b}")
    for name, k, b in (
        ("soft", [25.0, 25.0, 0.01], [5.0, 5.0, 0.002]),
        ("medium", [100.0, 100.0, 0.1], [20.0, 20.0, 0.02]),
        ("stiff", [100.0, 100.0, 0.5], [70.0, 70.0, 0.375]),
    )
}
"""K_pc and B_pc; stiff: those of section B.6; medium: those of the scene closed-loop-direct."""
