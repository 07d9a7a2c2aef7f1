"""The energy that crosses connections."""
