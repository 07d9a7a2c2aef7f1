"""The report's Appendix A, written out by hand as corrected: an independent five-bar.

f are the centre-of-mass fractions; r_cm,2 and r_cm,4 take f_i (printed: 1 - f_i), W21 has the
plus sign that is missing in print, w has two rows (printed: four), C its two missing zeros.
"""

import numpy as np


def trig(q):
    return (
        np.cos([q[0], q[0] + q[1], q[2], q[2] + q[3], q[1], q[3]]),
        np.sin([q[0], q[0] + q[1], q[2], q[2] + q[3], q[1], q[3]]),
    )


def D(q, m, l, J, f):  # noqa: E741
    (_, _, _, _, c2, c4), _ = trig(q)
    out = np.zeros((4, 4))
    for o, (a, b, c) in ((0, (0, 1, c2)), (2, (2, 3, c4))):
        e = m[b] * f[b] ** 2 * l[b] ** 2 + J[b]
        k = m[b] * l[a] * f[b] * l[b] * c
        out[o, o] = m[a] * f[a] ** 2 * l[a] ** 2 + m[b] * l[a] ** 2 + 2 * k + e + J[a]
        out[o, o + 1] = out[o + 1, o] = k + e
        out[o + 1, o + 1] = e
    return out


def C(q, qd, m, l, f):  # noqa: E741
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


def h(q, l):  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    return np.array(
        [
            l[0] * c1 + l[1] * c12 - l[2] * c3 - l[3] * c34,
            l[0] * s1 + l[1] * s12 - l[2] * s3 - l[3] * s34,
        ]
    )


def W(q, l):  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    return np.array(
        [
            [-l[0] * s1 - l[1] * s12, -l[1] * s12, l[2] * s3 + l[3] * s34, l[3] * s34],
            [l[0] * c1 + l[1] * c12, l[1] * c12, -l[2] * c3 - l[3] * c34, -l[3] * c34],
        ]
    )


def w(q, qd, l):  # noqa: E741
    (c1, c12, c3, c34, *_), (s1, s12, s3, s34, *_) = trig(q)
    a, b, c, d = qd[0] ** 2, (qd[0] + qd[1]) ** 2, qd[2] ** 2, (qd[2] + qd[3]) ** 2
    return np.array(
        [
            -l[0] * c1 * a - l[1] * c12 * b + l[2] * c3 * c + l[3] * c34 * d,
            -l[0] * s1 * a - l[1] * s12 * b + l[2] * s3 * c + l[3] * s34 * d,
        ]
    )


def r_h(q, l, f):  # noqa: E741
    (c1, c12, *_), (s1, s12, *_) = trig(q)
    return np.array([l[0] * c1 + f[1] * l[1] * c12, l[0] * s1 + f[1] * l[1] * s12, q[0] + q[1]])


def J_h(q, l, f):  # noqa: E741
    (c1, c12, *_), (s1, s12, *_) = trig(q)
    a, b = f[1] * l[1] * s12, f[1] * l[1] * c12
    return np.array([[-l[0] * s1 - a, -a, 0, 0], [l[0] * c1 + b, b, 0, 0], [1, 1, 0, 0]])


def acceleration(q, qd, F, m, l, J, f):  # noqa: E741
    """(qdd, lambda) of (2.3) and (3.1), by a dense solve."""
    K = np.block([[D(q, m, l, J, f), -W(q, l).T], [W(q, l), np.zeros((2, 2))]])
    rhs = np.concatenate([J_h(q, l, f).T @ F - C(q, qd, m, l, f) @ qd, -w(q, qd, l)])
    out = np.linalg.solve(K, rhs)
    return out[:4], out[4:]
