"""Attacks on the project from outside, seeded: short in the tests, long by a command each.

python -m tests.attack.signals --cases 300
python -m tests.attack.archives --cases 500
python -m tests.attack.c_interface --cases 500000
python -m tests.attack.scenes --cases 2700
python -m tests.attack.options --cases 4000
python -m tests.attack.ssps --cases 400
python -m tests.attack.hostile --cases 300
python -m tests.attack.folders --cases 60
python -m tests.attack.special_files --cases 300
python -m tests.attack.plugins --cases 200
python -m tests.attack.misuse --cases 500
python -m tests.attack.loops --cases 300
python -m tests.attack.page --cases 300
python -m tests.attack.signals_of_commands --cases 300

Each writes a table to results/faults, with its seed and the commit of the code; Ctrl-C ends it with
the cases that it has made.
"""
