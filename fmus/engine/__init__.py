"""Blocks of the haptic loop by a physics engine."""
