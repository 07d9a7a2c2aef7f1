"""Equations of motion of a linkage with loops, and its operational-space dynamics."""
