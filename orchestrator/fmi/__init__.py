"""One FMU: its description, variables, calls and state. Knows no scene."""
