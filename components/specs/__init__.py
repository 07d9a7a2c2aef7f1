"""The tables of a scene that describe components, as frozen records."""
