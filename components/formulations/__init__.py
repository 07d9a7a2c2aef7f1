"""Coordinates in which a closed loop can be integrated."""
