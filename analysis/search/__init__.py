"""The search over gains, holds and rates: what is set, what a run must keep, how it is found."""
