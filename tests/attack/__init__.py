"""Attacks on the commands from outside, seeded: short in the tests, long by a command each.

python -m tests.attack.signals --cases 300
"""
