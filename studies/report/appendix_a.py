"""The report's Appendix A, written out by hand as corrected: an independent five-bar.

f are the centre-of-mass fractions; r_cm,2 and r_cm,4 take f_i (printed: 1 - f_i), W21 has the
plus sign that is missing in print, w has two rows (printed: four), C its two missing zeros. Masses,
lengths, inertias and fractions are those of Table 6.1 if not given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

L = (0.042, 0.042, 0.0184, 0.0564)
M = (1.0, 1.0, 0.5, 0.5)
J = (2.1e-4, 2.1e-4, 1.05e-4, 1.05e-4)
F = (0.5,) * 4
Q0 = (math.pi / 4, -math.pi / 2, -0.4 * math.pi, math.pi / 2)
WRENCH = (-0.5, 0.0, -0.0025)
"""Lengths (m), masses (kg), inertias (kg.m2), start and wrench of chapter 6; F is not given."""


def trig(q: Any) -> Any:
    return (
        np.cos([q[0], q[0] + q[1], q[2], q[2] + q[3], q[1], q[3]]),
        np.sin([q[0], q[0] + q[1], q[2], q[2] + q[3], q[1], q[3]]),
    )


def D(
    q: Any,
    m: Sequence[float] = M,
    l: Sequence[float] = L,  # noqa: E741
    J: Sequence[float] = J,
    f: Sequence[float] = F,
) -> Any:
    (_, _, _, _, c2, c4), _ = trig(q)
    out = np.zeros((4, 4))
    for o, (a, b, c) in ((0, (0, 1, c2)), (2, (2, 3, c4))):
        e = m[b] * f[b] ** 2 * l[b] ** 2 + J[b]
        k = m[b] * l[a] * f[b] * l[b] * c
        out[o, o] = m[a] * f[a] ** 2 * l[a] ** 2 + m[b] * l[a] ** 2 + 2 * k + e + J[a]
        out[o, o + 1] = out[o + 1, o] = k + e
        out[o + 1, o + 1] = e
    return out


def C(
    q: Any,
    qd: Any,
    m: Sequence[float] = M,
    l: Sequence[float] = L,  # noqa: E741
    f: Sequence[float] = F,
) -> Any:
    _, (_, _, _, _, s2, s4) = trig(q)
    k2, k4 = m[1] * l[0] * f[1] * l[1] * s2, m[3] * l[2] * f[3] * l[3] * s4
    return np.array(
        [
            [-k2 * qd[1], -k2 * (qd[0] + qd[1]), 0, 0],
            [k2 * qd[0], 0, 0, 0],
            [0, 0, -k4 * qd[3], -k4 * (qd[2] + qd[3])],
            [0, 0, k4 * qd[2], 0],
        ]
    )


def h(q: Any, l: Sequence[float] = L) -> Any:  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    return np.array(
        [
            l[0] * c1 + l[1] * c12 - l[2] * c3 - l[3] * c34,
            l[0] * s1 + l[1] * s12 - l[2] * s3 - l[3] * s34,
        ]
    )


def W(q: Any, l: Sequence[float] = L) -> Any:  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    return np.array(
        [
            [-l[0] * s1 - l[1] * s12, -l[1] * s12, l[2] * s3 + l[3] * s34, l[3] * s34],
            [l[0] * c1 + l[1] * c12, l[1] * c12, -l[2] * c3 - l[3] * c34, -l[3] * c34],
        ]
    )


def w(q: Any, qd: Any, l: Sequence[float] = L) -> Any:  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    a, b, c, d = qd[0] ** 2, (qd[0] + qd[1]) ** 2, qd[2] ** 2, (qd[2] + qd[3]) ** 2
    return np.array(
        [
            -l[0] * c1 * a - l[1] * c12 * b + l[2] * c3 * c + l[3] * c34 * d,
            -l[0] * s1 * a - l[1] * s12 * b + l[2] * s3 * c + l[3] * s34 * d,
        ]
    )


def r_h(q: Any, l: Sequence[float] = L, f: Sequence[float] = F) -> Any:  # noqa: E741
    (c1, c12, *_), (s1, s12, *_) = trig(q)
    return np.array([l[0] * c1 + f[1] * l[1] * c12, l[0] * s1 + f[1] * l[1] * s12, q[0] + q[1]])


def J_h(q: Any, l: Sequence[float] = L, f: Sequence[float] = F) -> Any:  # noqa: E741
    (c1, c12, *_), (s1, s12, *_) = trig(q)
    a, b = f[1] * l[1] * s12, f[1] * l[1] * c12
    return np.array([[-l[0] * s1 - a, -a, 0, 0], [l[0] * c1 + b, b, 0, 0], [1, 1, 0, 0]])


def solution(q: Any, qd: Any, Q: Any) -> Any:
    """(qdd, lambda) of (2.3) and (3.1) under the joint efforts Q, by a dense solve."""
    K = np.block([[D(q), -W(q).T], [W(q), np.zeros((2, 2))]])
    solved = np.linalg.solve(K, np.concatenate([Q - C(q, qd) @ qd, -w(q, qd)]))
    return solved[:4], solved[4:]


def acceleration(q: Any, qd: Any, wrench: Any) -> Any:
    """(qdd, lambda) under a wrench of the hand."""
    return solution(q, qd, J_h(q).T @ wrench)


def joint_mobility(q: Any) -> Any:
    """D^-1 (1 - W' (W D^-1 W')^-1 W D^-1): joint accelerations by joint efforts."""
    D_inv, closures = np.linalg.inv(D(q)), W(q)
    through = closures @ D_inv
    return D_inv - through.T @ np.linalg.solve(through @ closures.T, through)
