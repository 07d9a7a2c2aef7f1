"""Appendix A: matrices of the five-bar."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.report import appendix_a
from studies.report.appendix_a import J, L, M
from studies.report.five_bar import FRACTIONS as F
from studies.report.five_bar import MovingFiveBar
from studies.report.report_page import Runs
from studies.report.statements.statement import (
    SLOPE,
    Statement,
    compare,
    deviation,
    equation,
    leave,
    misprint,
    misprinted,
    to,
)

TERMS = "components/linkage/test_linkage.py::test_terms_meet_appendix_a"
ERRATA = "test_errata.py::"
CENTRES = f"{ERRATA}test_appendix_a_centres_of_mass"


def statements(runs: Runs) -> Iterator[Statement]:
    del runs  # equations alone
    bar = MovingFiveBar()
    yield from _kinematics(bar)
    yield from _matrices(bar)


def _kinematics(bar: MovingFiveBar) -> Iterator[Statement]:
    """At an open pose, where the closures are not all zero anyway."""
    q = bar.q + np.array((0.1, -0.2, 0.15, 0.05))
    t, qd = bar.at(q, bar.qd), bar.qd
    c, s = np.cos(q), np.sin(q)
    turns = [np.array([[c[i], s[i]], [-s[i], c[i]]]) for i in range(4)]
    along = [turns[0].T, (turns[1] @ turns[0]).T, turns[2].T, (turns[3] @ turns[2]).T]
    along = [turn @ (1.0, 0.0) for turn in along]
    starts = [np.zeros(2), L[0] * along[0], np.zeros(2), L[2] * along[2]]
    centres = [start + F[i] * L[i] * along[i] for i, start in enumerate(starts)]
    errors = [deviation(t.centers[i], centre) for i, centre in enumerate(centres)]
    for i, error in enumerate(errors):
        text = f"rotation of the frame of body {i + 1}, on which its centre of mass turns"
        yield equation(f"A (A.{i + 1})", text, error, TERMS)
    to_cut = [(1 - F[i]) * L[i] * along[i] for i in (1, 3)]
    gap = t.centers[1] + to_cut[0] - t.centers[3] - to_cut[1]
    yield equation(
        "A (A.5)",
        "at the cut joint r_cm,2 + b_25 = r_cm,4 + b_45: h is the difference",
        deviation(gap, t.h),
        TERMS,
    )
    for i in (0, 2):
        yield equation("A", f"centre of mass r_cm,{i + 1}", errors[i], TERMS)
    for i in (1, 3):
        printed = starts[i] + (1 - F[i]) * L[i] * along[i]
        yield misprint(
            "A",
            f"centre of mass r_cm,{i + 1}, printed with 1 - f_{i + 1}",
            deviation(printed, t.centers[i]),
            f"f_{i + 1}",
            errors[i],
            CENTRES,
        )
        yield equation(
            "A",
            f"from there to the cut joint, b_{i + 1}5, with 1 - f_{i + 1}",
            deviation(gap, t.h),
            TERMS,
        )
    yield leave(
        "A (A.5)",
        "joints Q1 to Q4 have the vectors c_0 to c_3, each 0",
        "[26] defines them; where the joints are follows from the centres of mass and h",
    )
    yield equation("A", "constraint equations h", deviation(appendix_a.h(q), t.h), TERMS)
    step = 1e-6
    rates = (bar.at(q + step * qd, qd).centers - bar.at(q - step * qd, qd).centers) / (2 * step)
    for i in range(4):
        before, own = (qd[0], qd[0] + qd[1]) if i < 2 else (qd[2], qd[2] + qd[3])
        across = np.array([[0, -1], [1, 0]])
        turning = before if i in (0, 2) else own
        printed = across @ (F[i] * L[i] * along[i]) * turning
        printed = printed + (across @ starts[i] * before if i in (1, 3) else 0)
        error = deviation(rates[i], printed)
        yield compare(
            "A",
            f"Jacobian of the centre of mass, J_cm,{i + 1}",
            error < SLOPE,
            f"J_cm,{i + 1} qd is its velocity to {error:.0e}, by differences",
            f"pytest tests/{TERMS}",
        )
    moved = (bar.at(q + step * qd, qd).x_h - bar.at(q - step * qd, qd).x_h) / (2 * step)
    error = float(abs(moved[2] - qd[0] - qd[1]) / abs(moved[2]))
    yield compare(
        "A",
        "angular velocities are sums along each chain",
        error < SLOPE,
        f"link 2 turns by qd_1 + qd_2 to {error:.0e}",
        f"pytest tests/{TERMS}",
    )


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
    yield misprinted(
        "A",
        "I is the rate of dK/dqd, by time",
        f"its derivative by qd, a matrix; the printed entries are met "
        f"{to(deviation(t.D - without, turning))}",
        f"pytest tests/{TERMS}",
    )
    D = appendix_a.D(q, f=F)
    yield equation("A", "D = Lambda + I has two blocks", deviation(t.D, D), TERMS)
    for i, j in ((1, 1), (1, 2), (2, 1), (2, 2), (3, 3), (3, 4), (4, 3), (4, 4)):
        stray = " (printed with a stray bracket)" if (i, j) == (1, 2) else ""
        yield equation(
            "A (A.7)", f"D_{i}{j}{stray}", deviation(t.D[i - 1, j - 1], D[i - 1, j - 1]), TERMS
        )
    yield misprinted(
        "A",
        "C, printed with rows 2 and 4 of two and three entries",
        f"with the zeros C qd is met to {deviation(t.C_qd, appendix_a.C(q, qd, f=F) @ qd):.0e}",
        f"pytest tests/{TERMS}",
    )
    printed = appendix_a.W(q)
    printed[1, 0] = L[0] * np.cos(q[0]) * L[1] * np.cos(q[0] + q[1])
    yield misprint(
        "A",
        "W, with the product L1 c1 L2 c12 in W_21",
        deviation(printed, t.W),
        "the sum",
        deviation(appendix_a.W(q), t.W),
        f"{ERRATA}test_appendix_a_second_row_of_W",
    )
    yield equation("A", "hand position r_h", deviation(appendix_a.r_h(q, f=F), t.x_h), TERMS)
    yield equation("A", "hand Jacobian J_h", deviation(appendix_a.J_h(q, f=F), t.J_h), TERMS)
    half = bar.at(q, np.array([*qd[:2], 0, 0])).w
    yield misprint(
        "A",
        "w, with four rows",
        deviation(half, t.w),
        "rows 1 and 3, 2 and 4 added",
        deviation(appendix_a.w(q, qd), t.w),
        f"{ERRATA}test_appendix_a_w_has_two_rows",
    )
