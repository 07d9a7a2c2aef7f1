"""Attacks on the project from outside, seeded, each of many cases: `python -m fuzz`."""
