"""Sweeps: many runs of a scene in parallel, as one table."""
