"""Quantisation by encoders."""

from __future__ import annotations

import casadi as ca


def quantised(value: ca.SX, quantum: ca.SX, share: float = 0.0) -> ca.SX:
    """quantum floor(value/quantum + share): rounded down by default, to the nearest count by a
    share of 0.5; the value itself where the quantum is 0."""
    coarse = quantum > 0.0
    counts = value / ca.if_else(coarse, quantum, 1.0)
    counts = counts + share if share else counts
    return ca.if_else(coarse, quantum * ca.floor(counts), value)
