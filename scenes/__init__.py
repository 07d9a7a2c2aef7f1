"""The shipped scenes: one TOML file an experiment, found by name from any folder."""
