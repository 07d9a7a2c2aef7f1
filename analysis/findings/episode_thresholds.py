"""What counts as an episode of a run, and from which values on: the same for terminal, figures and
pages."""

from __future__ import annotations

EPISODES = {
    "folded": "graphics copy folded",
    "saturated": "motors at their limit",
    "energy": "energy generated at the user's port",
    "constraints": "unusual number of constrained directions",
    "contacts": "contacts",
    "outside": "outside the device's workspace",
}
"""Kinds of episodes and their meaning."""
NOTICEABLE_J = 1e-3
"""Energy (J) of a handle of 0.1 kg that vibrates by 1 mm at 20 Hz, or that of one of 0.3 kg at
8 cm/s."""
FULL_TORQUE = 1 - 1e-6
"""Share of their largest torque from which on motors are at their limit."""
