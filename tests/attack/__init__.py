"""Attacks on the project from outside, seeded: short in the tests, long by a command each."""
