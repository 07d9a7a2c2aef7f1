"""Recorded runs over time: a page with a slider, or an animation."""
