"""The report's misprints: each test holds for the corrected form and fails for the printed one.

The terms are those of the linkage's own model; what they must meet are laws of mechanics. Errata of
components with tests of their own stand there: (1.3) in test_discretisation.py, (4.6) with (4.3) in
test_controller.py, (B.14)'s rows of U in test_constrained_directions.py, (B.17) without w_stab in
test_virtual_mechanism.py.
"""

import numpy as np
import pytest

from hapticlink.components.specs.linkage import Directions
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import running
from tests.mechanisms import Q0, WRENCH, five_bar, open_arm, terms

F_CM = (0.3, 0.6, 0.45, 0.7)  # not 1/2: f and 1 - f must differ
F = np.array(WRENCH)
QD = np.random.default_rng(3).uniform(-3, 3, 4)
MODEL = terms(five_bar(f=F_CM), "D", "C_qd", "W", "w", "J_h", "h")


def model(q, qd=QD):
    """The terms at (q, qd) by their names, the vectors flat."""
    D, C_qd, W, w, J_h, h = MODEL(q, qd)
    return {"D": D, "C_qd": C_qd.ravel(), "W": W, "w": w.ravel(), "J_h": J_h, "h": h.ravel()}


@pytest.fixture(scope="module")
def at():
    """The mechanism's outputs and its terms at a moving, assembled pose."""
    block = running(five_bar(f=F_CM), directions=Directions()).put(qd=QD)
    block.set(F_hand=F)
    q = block.state["q"]
    return block.y | model(q) | {"q": q}


def rate(f, q, step=1e-6):
    """Central difference along the motion."""
    return (f(q + step * QD) - f(q - step * QD)) / (2 * step)


def slopes(f, q, step=1e-6):
    """Central difference along each coordinate."""
    return [(f(q + e) - f(q - e)) / (2 * step) for e in step * np.eye(4)]


def D(q):
    return model(q)["D"]


def close(a, b, tolerance=1e-9):
    """Whether two arrays agree relative to the larger; different shapes do not."""
    a, b = np.asarray(a), np.asarray(b)
    return a.shape == b.shape and np.abs(a - b).max() < tolerance * max(np.abs(a).max(), 1e-12)


def only_first(corrected, printed, expected, tolerance=1e-9):
    """The corrected form meets `expected`; the printed one does not."""
    assert close(corrected, expected, tolerance)
    assert not close(printed, expected, 100 * tolerance)


def test_one_sign_of_lambda(at):
    """(2.3) has + W' lambda, (2.1) and (B.1) have -: lambda is that of +."""
    left = at["D"] @ at["qdd"] + at["C_qd"] - at["J_h"].T @ F
    only_first(at["W"].T @ at["lambda"], -at["W"].T @ at["lambda"], left)


def test_coriolis_terms_have_the_rate_of_the_mass_matrix(at):
    """(2.4), (2.5), (2.9) leave out Ddot qd: C qd = Ddot qd - dT/dq."""
    Ddot, dD = rate(D, at["q"]), slopes(D, at["q"])
    dT = np.array([QD @ slope @ QD / 2 for slope in dD])
    only_first(Ddot @ QD - dT, -dT, at["C_qd"], 1e-7)


def test_last_sign_of_the_christoffel_symbols(at):
    """(2.11), (2.12): the last sign is -; with the printed + Ddot - 2C is not skew."""
    dD = np.array(slopes(D, at["q"]))

    def C(sign):
        """sum over i of (dD_kj/dq_i + dD_ki/dq_j + sign dD_ij/dq_k) qd_i / 2."""
        first, second, last = ("ikj,i->kj", "jki,i->kj", "kij,i->kj")
        parts = np.einsum(first, dD, QD) + np.einsum(second, dD, QD)
        return 0.5 * (parts + sign * np.einsum(last, dD, QD))

    only_first(C(-1) @ QD, C(+1) @ QD, at["C_qd"], 1e-7)
    Ddot = np.einsum("ikj,i->kj", dD, QD)
    assert close(Ddot - 2 * C(-1), -(Ddot - 2 * C(-1)).T)
    assert not close(Ddot - 2 * C(+1), -(Ddot - 2 * C(+1)).T, 1e-3)


def test_constraint_jacobian_is_not_transposed(at):
    """(2.14), (3.1), (3.2), (3.4) print W'; the closure's rate is W qd, W 2 x 4."""
    assert at["W"].shape == (2, 4)
    assert close(at["W"] @ QD, rate(lambda q: model(q)["h"], at["q"]), 1e-8)


def test_wrench_enters_through_the_transposed_jacobian(at):
    """(2.15), (2.18) print Q = J F; power needs Q = J' F."""
    Q = at["J_h"].T @ F
    assert pytest.approx(at["v"] @ F, rel=1e-12) == QD @ Q
    assert close(Q, at["D"] @ at["qdd"] + at["C_qd"] - at["W"].T @ at["lambda"])


ALPHA, BETA = 40.0, 0.7


def closing(at, qd):
    """(hddot, hdot, h) of the Baumgarte-stabilised mechanism, off its closure."""
    euler = {"integrator": "semi-implicit-euler", "stabilization": "baumgarte"}
    block = running(five_bar(f=F_CM), **euler, alpha=ALPHA, beta=BETA)
    q = at["q"] + np.array([1e-3, -2e-3, 0, 0])
    block.put(q=q, qd=qd)
    block.set(F_hand=F)
    block.step(1.0)  # one step of length 1: the change of qd is the acceleration
    qdd, off = block.state["qd"] - qd, model(q, qd)
    return off["W"] @ qdd + off["w"], off["W"] @ qd, off["h"]


def test_baumgarte_starts_with_the_second_rate(at):
    """(3.3) prints hdot first."""
    hddot, hdot, h = closing(at, QD)
    rest = 2 * ALPHA * BETA * hdot + ALPHA**2 * h
    only_first(hddot, hdot, -rest)


def test_baumgarte_damps_the_closure_rate(at):
    """(3.5), (B.5) print 2 alpha beta W without qd: the rate would make no difference."""
    (moving, hdot, _), (still, _, _) = closing(at, QD), closing(at, np.zeros(4))
    only_first(-2 * ALPHA * BETA * hdot, np.zeros(2), moving - still)


def test_mobility_of_the_open_chain(at):
    """(5.4) prints J' D^-1 J' for J D^-1 J'; (5.6) prints D for D^-1."""
    arm = open_arm(five_bar(f=F_CM))
    y = running(arm, directions=Directions()).y
    J_h, D = model(y["q"])["J_h"], model(y["q"])["D"]
    only_first(J_h @ np.linalg.inv(D) @ J_h.T, J_h @ D @ J_h.T, y["Lambda_inv"])


def test_mobility_of_the_closed_chain(at):
    """(5.10), (5.11) print W' - (...) where (B.13) has W' times it."""
    J_h, W, D_inv = at["J_h"], at["W"], np.linalg.inv(at["D"])
    inner = np.linalg.solve(W @ D_inv @ W.T, W @ D_inv @ J_h.T)
    only_first(J_h @ D_inv @ (J_h.T - W.T @ inner), J_h @ D_inv @ J_h.T, at["Lambda_inv"])


def test_appendix_a_centres_of_mass(at):
    """r_cm,2 and r_cm,4 print (1 - f_i) where Jacobians and D have f_i."""
    printed = tuple(1 - f if i in (1, 3) else f for i, f in enumerate(F_CM))
    only_first(appendix_a.r_h(at["q"], L, F_CM), appendix_a.r_h(at["q"], L, printed), at["x"])
    wrong = running(five_bar(f=printed)).put(q=at["q"], qd=QD)
    wrong.set(F_hand=F)
    assert not close(wrong.y["qdd"], at["qdd"], 1e-3)


def test_appendix_a_second_row_of_W(at):
    """W21 prints L1c1 L2c12 for L1c1 + L2c12."""
    q, corrected = at["q"], at["W"]
    printed = corrected.copy()
    printed[1, 0] = L[0] * np.cos(q[0]) * L[1] * np.cos(q[0] + q[1])
    hdot = rate(lambda q: model(q)["h"], q)
    only_first(corrected @ QD, printed @ QD, hdot, 1e-8)


def test_appendix_a_w_has_two_rows(at):
    """w prints four rows: 1 and 3, 2 and 4 belong together, those of either side of the loop."""
    q = at["q"]
    Wdot_qd = rate(lambda q: model(q)["W"] @ QD, q)
    sides = [model(q, qd)["w"] for qd in ([*QD[:2], 0, 0], [0, 0, *QD[2:]])]
    assert close(sum(sides), at["w"])
    for side in sides:
        only_first(at["w"], side, Wdot_qd, 1e-8)


def gap(lengths):
    """By how much the loop of these lengths is open at the report's q0, m."""
    (h,) = terms(five_bar(l=lengths), "h")(Q0, np.zeros(4))
    return np.linalg.norm(h)


def test_rounded_lengths_of_table_6_1_miss_closure_by_a_tenth_of_a_millimetre():
    assert gap(L) == pytest.approx(1.0e-4, rel=0.05)
    assert gap((0.042, 0.042, 0.0183547, 0.0564899)) < 1e-7


def test_lengths_of_table_b_1_miss_closure_by_more_than_rounding():
    assert gap((0.045, 0.045, 0.021, 0.060)) == pytest.approx(1.43e-3, rel=0.01)
