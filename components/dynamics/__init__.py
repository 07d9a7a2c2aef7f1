"""Equations of motion of a linkage with loops, and what the hand feels of them."""
