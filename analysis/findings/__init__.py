"""What a run shows: episodes, tracking error, energy at the user's port, warnings."""
