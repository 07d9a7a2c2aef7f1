"""The verdict on a spectral radius."""

from __future__ import annotations


def verdict(radius: float, uncertainty: float) -> str:
    """stable, unstable, or marginal where the radius is 1 within its uncertainty."""
    if abs(radius - 1.0) <= uncertainty:
        return "marginal"
    return "unstable" if radius > 1.0 else "stable"
