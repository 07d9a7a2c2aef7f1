"""Appendix A: matrices of the five-bar."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.report import appendix_a
from studies.report.appendix_a import J, L, M
from studies.report.five_bar import FRACTIONS as F
from studies.report.five_bar import MovingFiveBar
from studies.report.report_page import Runs
from studies.report.statements.record import Statement, compare, deviation, equation, misprint

TERMS = "components/linkage/test_linkage.py::test_terms_meet_appendix_a"
ERRATA = "test_errata.py::"
CENTRES = f"{ERRATA}test_appendix_a_centres_of_mass"


def statements(runs: Runs) -> Iterator[Statement]:
    del runs  # equations alone
    bar = MovingFiveBar()
    yield from _kinematics(bar)
    yield from _matrices(bar)


def _kinematics(bar: MovingFiveBar) -> Iterator[Statement]:
    t, q = bar.terms, bar.q
    c, s = np.cos(q), np.sin(q)
    turns = [np.array([[c[i], s[i]], [-s[i], c[i]]]) for i in range(4)]
    angle = (turns[1] @ turns[0]).T @ (1, 0)
    second = deviation(angle, [np.cos(t.x_h[2]), np.sin(t.x_h[2])])
    tip = L[2] * turns[2].T @ (1, 0) + L[3] * (turns[3] @ turns[2]).T @ (1, 0)
    other = L[0] * turns[0].T @ (1, 0) + L[1] * angle
    closed = float(np.abs(tip - other - -t.h).max() / L[2])
    for number, body, error in (
        (1, "1", second),
        (2, "2", second),
        (3, "3", closed),
        (4, "4", closed),
    ):
        yield equation(f"A (A.{number})", f"rotation of the frame of body {body}", error, TERMS)
    yield equation("A (A.5)", "joints, and the cut joint where links 2 and 4 meet", closed, TERMS)
    points = {1: F[0] * L[0] * np.array([c[0], s[0]]), 3: F[2] * L[2] * np.array([c[2], s[2]])}
    for body, point in points.items():
        i = body - 1
        slope = F[i] * L[i] * np.array([-s[i], c[i]])
        turned = np.array([[0, -1], [1, 0]]) @ point
        yield equation("A", f"centre of mass r_cm,{body}", deviation(turned, slope), TERMS)
    printed = tuple(1 - f if i in (1, 3) else f for i, f in enumerate(F))
    wrong = deviation(appendix_a.r_h(q, L, printed), t.x_h)
    right = deviation(appendix_a.r_h(q, L, F), t.x_h)
    for body in (2, 4):
        yield misprint("A", f"centre of mass r_cm,{body}, printed with 1 - f_{body}", wrong, f"f_{body}",
                       right, CENTRES)  # fmt: skip
        yield equation(
            "A", f"from there to the cut joint, b_{body}5, with 1 - f_{body}", closed, TERMS
        )
    yield equation("A", "constraint equations h", deviation(appendix_a.h(q) + 1, t.h + 1), TERMS)
    step = 1e-6
    moved = (bar.at(q + step * bar.qd, bar.qd).x_h - bar.at(q - step * bar.qd, bar.qd).x_h) / (
        2 * step
    )
    for body in range(1, 5):
        yield compare("A", f"Jacobian of the centre of mass, J_cm,{body}",
                      deviation(t.D, appendix_a.D(q, f=F)) < 1e-12, "D, which is made of them, is met "
                      f"to {deviation(t.D, appendix_a.D(q, f=F)):.0e}", f"pytest tests/{TERMS}"
                      )  # fmt: skip
    yield compare("A", "angular velocities are sums along each chain",
                  abs(moved[2] - bar.qd[0] - bar.qd[1]) < 1e-6, f"link 2 turns by qd_1 + qd_2 to "
                  f"{abs(moved[2] - bar.qd[0] - bar.qd[1]):.0e} rad/s", f"pytest tests/{TERMS}"
                  )  # fmt: skip


def _matrices(bar: MovingFiveBar) -> Iterator[Statement]:
    t, q, qd = bar.terms, bar.q, bar.qd
    turning = np.zeros((4, 4))
    for a, b in ((0, 1), (2, 3)):
        turning[a, a], turning[a, b], turning[b, a], turning[b, b] = J[a] + J[b], J[b], J[b], J[b]
    omega = np.array([qd[0], qd[0] + qd[1], qd[2], qd[2] + qd[3]])
    K = 0.5 * np.sum(np.array(J) * omega**2)
    yield equation(
        "A (A.6)", "kinetic energy of turning", abs(qd @ turning @ qd / 2 - K) / K, TERMS
    )
    without = appendix_a.D(q, M, L, (0.0,) * 4, F)
    yield equation("A", "inertia matrix I", deviation(t.D - without, turning), TERMS)
    D = appendix_a.D(q, f=F)
    yield equation("A", "D = Lambda + I has two blocks", deviation(t.D, D), TERMS)
    for i, j in ((1, 1), (1, 2), (2, 1), (2, 2), (3, 3), (3, 4), (4, 3), (4, 4)):
        stray = " (printed with a stray bracket)" if (i, j) == (1, 2) else ""
        yield equation(
            "A (A.7)", f"D_{i}{j}{stray}", deviation(t.D[i - 1, j - 1], D[i - 1, j - 1]), TERMS
        )
    yield compare("A", "C, printed with rows 2 and 4 of two and three entries", False,
                  f"with the zeros C qd is met to {deviation(t.C_qd, appendix_a.C(q, qd, f=F) @ qd):.0e}",
                  f"pytest tests/{TERMS}")  # fmt: skip
    printed = appendix_a.W(q)
    printed[1, 0] = L[0] * np.cos(q[0]) * L[1] * np.cos(q[0] + q[1])
    yield misprint("A", "W, with the product L1 c1 L2 c12 in W_21", deviation(printed, t.W),
                   "the sum", deviation(appendix_a.W(q), t.W),
                   f"{ERRATA}test_appendix_a_second_row_of_W")  # fmt: skip
    yield equation("A", "hand position r_h", deviation(appendix_a.r_h(q, f=F), t.x_h), TERMS)
    yield equation("A", "hand Jacobian J_h", deviation(appendix_a.J_h(q, f=F), t.J_h), TERMS)
    half = bar.at(q, np.array([*qd[:2], 0, 0])).w
    yield misprint("A", "w, with four rows", deviation(half, t.w), "rows 1 and 3, 2 and 4 added",
                   deviation(appendix_a.w(q, qd), t.w),
                   f"{ERRATA}test_appendix_a_w_has_two_rows")  # fmt: skip
