"""Blind trials: what somebody who feels two settings can tell apart."""
