"""A single FMU: its description, variables, calls and state; independent of any scene."""
