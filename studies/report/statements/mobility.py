"""Chapter 5: the inertia at the hand, without and with closed loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from studies.report import appendix_a, measures
from studies.report.five_bar import FRACTIONS, WRENCH, MovingFiveBar
from studies.report.report_page import Runs
from studies.report.statements.statement import (
    Statement,
    compare,
    deviation,
    equation,
    misprint,
    misprinted,
)
from studies.report.systems import IDEAL_6, ON, STATED_6, System

CLOSED = "test_errata.py::test_mobility_of_the_closed_chain"
OPEN = "test_errata.py::test_mobility_of_the_open_chain"
NEGLECTED = "velocities are small: Coriolis and centripetal terms are ignored"


def statements(runs: Runs) -> Iterator[Statement]:
    bar = MovingFiveBar()
    t = bar.terms
    D, W = appendix_a.D(bar.q, f=FRACTIONS), appendix_a.W(bar.q)
    J, D_inv = appendix_a.J_h(bar.q, f=FRACTIONS), np.linalg.inv(D)
    opened, closed = (np.linalg.eigvalsh(m) for m in (t.open_Lambda_inv, t.Lambda_inv))
    yield compare(
        "5",
        "closed loops enter Lambda, unlike that of serial linkages",
        abs(opened[-1] / closed[-1] - 1) > 0.1,
        "eigenvalues of Lambda^-1 "
        f"{', '.join(f'{v:.3g}' for v in opened)} with the loop open, "
        f"{', '.join(f'{v:.3g}' for v in closed)} closed",
        f"pytest tests/{CLOSED}",
    )
    yield from neglected_terms(runs, "5.1", (STATED_6, IDEAL_6))
    free = D_inv @ J.T @ WRENCH
    yield equation(
        "5.1 (5.1)", "open: qdd = D^-1 J_h' F_h", deviation(D @ free, J.T @ WRENCH), OPEN
    )
    open_by_hand = J @ D_inv @ J.T
    error = deviation(t.open_Lambda_inv, open_by_hand)
    rank = int(np.linalg.matrix_rank(t.open_Lambda_inv, tol=1e-9 * opened[-1]))
    met = np.linalg.pinv(t.open_Lambda_inv, rcond=1e-9) @ t.open_Lambda_inv @ WRENCH
    missing = np.linalg.norm((WRENCH - met) / (1, 1, np.mean(appendix_a.L)))
    missing /= np.linalg.norm(WRENCH / (1, 1, np.mean(appendix_a.L)))
    yield compare(
        "5.1 (5.2)",
        "Lambda xdd = F_h",
        rank == 3,
        f"two open links leave Lambda^-1 of rank {rank}, without an inverse Lambda: with its "
        f"pseudo-inverse {100 * missing:.0f} % of F_h are missing (torques by the mean link "
        "length), the part that the joints resist; (5.3) holds",
        f"pytest tests/{OPEN}",
    )
    yield equation(
        "5.1 (5.3)",
        "xdd = J_h qdd = Lambda^-1 F_h",
        deviation(t.open_Lambda_inv @ WRENCH, J @ free),
        OPEN,
    )
    yield misprinted(
        "5.1 (5.4)",
        "Lambda^-1 = J' D^-1 J'",
        f"J is 3 x 4: no product; J D^-1 J' is met to {error:.0e}",
        f"pytest tests/{OPEN}",
    )
    kept = D_inv - D_inv @ W.T @ np.linalg.solve(W @ D_inv @ W.T, W @ D_inv)
    qdd = kept @ J.T @ WRENCH
    multipliers = -np.linalg.solve(W @ D_inv @ W.T, W @ D_inv @ J.T @ WRENCH)
    right = J.T @ WRENCH + W.T @ multipliers
    yield equation(
        "5.2 (5.5)", "closed: D qdd = J_h' F_h + W' lambda", deviation(D @ qdd, right), CLOSED
    )
    yield misprint(
        "5.2 (5.6)",
        "qdd = D (J_h' F_h + W' lambda)",
        deviation(D @ right, qdd),
        "D^-1",
        deviation(D_inv @ right, qdd),
        OPEN,
    )
    yield equation(
        "5.2 (5.7)",
        "xdd = J_h qdd = Lambda^-1 F_h",
        deviation(t.Lambda_inv @ WRENCH, J @ qdd),
        CLOSED,
    )
    yield equation(
        "5.2 (5.8)",
        "Lambda^-1 F_h = J_h D^-1 (J_h' F_h + W' lambda)",
        deviation(t.Lambda_inv @ WRENCH, J @ D_inv @ right),
        CLOSED,
    )
    still = bar.at(bar.q, np.zeros(4)).multipliers
    yield equation(
        "5.2 (5.9)",
        "lambda = -(W D^-1 W')^-1 W D^-1 J_h' F_h",
        deviation(still, multipliers),
        CLOSED,
    )
    inner = np.linalg.solve(W @ D_inv @ W.T, W @ D_inv @ J.T)
    corrected = deviation(J @ D_inv @ (J.T - W.T @ inner), t.Lambda_inv)
    for place, text in (
        ("5.2 (5.10)", "(5.9) put into (5.8)"),
        ("5.2 (5.11)", "Lambda^-1 of the closed loop"),
    ):
        yield misprinted(
            place,
            f"{text}, with W' - (...) for W' (...)",
            f"W' is 4 x 2, the bracket {inner.shape[0]} x {inner.shape[1]}: no difference; "
            f"with the product, as (B.13), met to {corrected:.0e}",
            f"pytest tests/{CLOSED}",
        )
    P = IDEAL_6.run(runs, ON).haptics["virtual_mechanism.P_c"][0]
    at_start = np.linalg.svd(IDEAL_6.run(runs, ON).haptics["virtual_mechanism.Lambda_inv"][0])
    scale = (1, 1, np.mean(appendix_a.L))
    n = at_start[0][:, -1] / scale
    yield compare(
        "5.2",
        "singular directions follow from a singular value decomposition",
        deviation(P @ n, n) < 1e-6,
        f"P_c keeps that of the SVD to {deviation(P @ n, n):.0e} "
        f"(scaled by the mean link length; {len(n)} directions)",
        "pytest tests/components/dynamics/test_constrained_directions.py::"
        "test_null_directions_are_columns_of_U_and_not_its_rows",
    )
    yield misprinted(
        "5.2",
        "singular directions are those of Lambda, and Lambda is sent to the haptic simulation",
        f"those of Lambda^-1, of rank {np.linalg.matrix_rank(t.Lambda_inv, tol=1e-9 * closed[-1])}:"
        " Lambda does not exist, and Lambda^-1 is sent",
        f"pytest tests/{CLOSED}; hapticlink info {STATED_6.scene}",
    )
    shown = f"hapticlink info {STATED_6.scene}"
    held, own = (
        measures.operations(STATED_6.scene, f"directions_from={block}")
        for block in ("graphics", "mechanism")
    )
    yield compare(
        "5.2",
        "Lambda^-1 and its directions, computed at the graphics rate, save time at the haptic rate",
        held < own,
        f"a haptic tick of `{STATED_6.scene}` takes {held:.0f} operations, and {own:.0f} with "
        "Lambda^-1 and its directions in each tick",
        f"{shown}; {shown} --set directions_from=mechanism",
    )


def neglected_terms(
    runs: Runs, place: str, systems: Sequence[System], text: str = NEGLECTED
) -> Iterator[Statement]:
    """The statement that velocity terms may be neglected, in runs of systems."""
    for system in systems:
        sizes = measures.neglected(system.run(runs, ON))
        yield compare(
            place,
            text,
            sizes.bias[0] < 0.1 * sizes.rendered[0],
            f"{system.name}: {sizes.bias[0]:.2g} "
            f"m/s2 RMS left out against {sizes.rendered[0]:.2g} rendered, "
            f"{sizes.bias[1]:.3g} against {sizes.rendered[1]:.3g} rad/s2",
            system.command(ON),
        )
