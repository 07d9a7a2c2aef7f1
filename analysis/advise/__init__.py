"""Which hold and gains to take for a scene."""
