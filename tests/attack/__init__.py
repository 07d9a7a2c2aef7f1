"""Attacks on the project from outside, seeded: short in the tests, long by a command each.

python -m tests.attack.signals --cases 300
python -m tests.attack.archives --cases 500
python -m tests.attack.c_interface --cases 500000
"""
