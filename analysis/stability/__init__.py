"""Stability of the co-simulation that runs, from its linearised map over one hyperperiod."""
