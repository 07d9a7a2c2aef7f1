"""Colours of curves that differ in lightness, so that they stay apart in grey and to colour-blind
readers."""

CURVES = ("#1b2570", "#e06a20", "#2a8048", "#62b8ec", "#982068", "#e2d468")
"""Their lightness L* is 19, 58, 48, 72, 35 and 84; neighbours in the list differ most."""
