"""What holds for every test."""

from hypothesis import settings

# The same draws every time: a test that fails here fails everywhere.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
