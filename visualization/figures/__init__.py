"""Figures of runs, sweeps, maps and tunings."""
