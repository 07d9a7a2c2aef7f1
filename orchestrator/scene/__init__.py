"""A scene: what the user wrote, read from TOML, checked, as records."""
