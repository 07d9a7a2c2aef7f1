"""Recorded runs beside each other: what differs between them, numbers, figures, and a page."""
