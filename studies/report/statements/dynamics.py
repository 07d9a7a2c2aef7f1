"""Chapters 2 and 3: the dynamics of the mechanism, and how its loop is kept closed."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from hapticlink.orchestrator import open_scene
from studies.report import appendix_a, measures
from studies.report.chapter3 import stabilised
from studies.report.five_bar import FRACTIONS, WRENCH, MovingFiveBar, shipped
from studies.report.report_page import Runs, command
from studies.report.statements.statement import (
    SLOPE,
    Statement,
    compare,
    deviation,
    equation,
    leave,
    misprint,
    misprinted,
    tested,
    to,
)
from studies.report.systems import ON, STATED_6

ERRATA = "test_errata.py::"
SIGN = f"{ERRATA}test_one_sign_of_lambda"
CORIOLIS = f"{ERRATA}test_coriolis_terms_have_the_rate_of_the_mass_matrix"
CHRISTOFFEL = f"{ERRATA}test_last_sign_of_the_christoffel_symbols"
TRANSPOSED = f"{ERRATA}test_constraint_jacobian_is_not_transposed"
WRENCHES = f"{ERRATA}test_wrench_enters_through_the_transposed_jacobian"
TERMS = "components/linkage/test_linkage.py::test_terms_meet_appendix_a"
FINE = "mechanism.integrator=rk4", "mechanism.stabilization=none"


def statements(runs: Runs) -> Iterator[Statement]:
    bar = MovingFiveBar()
    yield from _kinematics(bar)
    yield from _lagrange(bar)
    yield from _matrices(bar)
    yield from _constraints_and_forces(runs, bar)
    yield from _implementation(runs, bar)


def _by_differences(place: str, text: str, error: float, test: str) -> Statement:
    return compare(
        place, text, error < SLOPE, f"met to {error:.0e}, by differences", f"pytest tests/{test}"
    )


def _kinematics(bar: MovingFiveBar) -> Iterator[Statement]:
    t = bar.terms
    rank = int(np.linalg.matrix_rank(t.W))
    yield compare(
        "2.1",
        "a free body in the plane has three degrees of freedom",
        len(t.x_h) == 3,
        f"{len(t.x_h)} coordinates of a pose",
        "hapticlink info single-body",
    )
    yield leave(
        "2.1",
        "a free body in space has six degrees of freedom",
        "the project is planar, as the setup is",
    )
    yield compare(
        "2.1",
        "constraints take degrees of freedom away",
        rank == 2,
        f"4 coordinates, {rank} independent constraints: {4 - rank} left",
        "pytest tests/components/blocks/test_virtual_mechanism_options.py::"
        "test_rank_of_shipped_linkages",
    )
    yield tested(
        "2.1; figure 2.2",
        "absolute and relative coordinates describe the same system",
        "motions of shipped linkages agree with those in absolute coordinates",
        "reference/test_textbook.py::test_motion_is_that_in_absolute_coordinates",
    )
    yield compare(
        "2.1",
        "fewer coordinates than absolute or relative ones can describe a constrained system",
        4 - rank < 4,
        f"{3 * len(bar.linkage.body)} absolute, 4 relative, {4 - rank} independent ones; "
        "`coordinate partitioning` integrates these",
        "hapticlink bench formulations",
    )
    scene = open_scene.load("enclosure")
    assert scene.linkage
    assert scene.contacts
    walls = len(scene.contacts.enclosure or ())
    yield compare(
        "2; figure 2.1",
        "the five-bar moves freely inside a rigid enclosure",
        walls > 2 and scene.linkage.body == shipped().body and scene.linkage.loop,
        f"scene `enclosure` has its links, and {walls} walls around them",
        command("enclosure", "duration=0.1"),
    )


def _lagrange(bar: MovingFiveBar) -> Iterator[Statement]:
    t = bar.terms
    by_hand = {"f": FRACTIONS}
    left = appendix_a.D(bar.q, **by_hand) @ t.qdd + appendix_a.C(bar.q, bar.qd, **by_hand) @ bar.qd
    left = left - appendix_a.J_h(bar.q, **by_hand).T @ WRENCH
    wrong, right = deviation(-t.W.T @ t.multipliers, left), deviation(t.W.T @ t.multipliers, left)
    yield leave(
        "2.2",
        "Newton-Euler and Lagrange are the two methods in common use",
        "a survey; both give the same motion here: Lagrange's terms, and articulated bodies",
        "pytest tests/components/dynamics/test_scaling.py",
    )
    yield misprint(
        "2.2 (2.1)",
        "Lagrange's equations with + W' lambda on the left, where (2.3) has "
        "it on the right: one lambda cannot meet both",
        wrong,
        "one sign, that of (2.3),",
        right,
        SIGN,
    )
    yield misprint(
        "2.2 (2.2)",
        "Lagrange's equations with T and V apart, - W' lambda on the right",
        wrong,
        "the sign of (2.3)",
        right,
        SIGN,
    )
    yield compare(
        "2.2",
        "(2.1) has as many scalar equations as there are coordinates",
        t.D.shape == (4, 4) and len(left) == 4,
        f"{len(left)} for {len(bar.q)}",
        f"pytest tests/{SIGN}",
    )
    yield misprinted(
        "2.2",
        "the accelerations are numbered from 0 to n, coordinates and velocities from 1 to n",
        f"from 1 to n: {len(t.qdd)} of each",
        f"pytest tests/{SIGN}",
    )
    yield misprinted(
        "2.2; 2.2.3; A",
        "applied forces are said to stand in 2.2.2 and W in 2.2.3, r and F to belong to (2.18), "
        "w to (3.1) and (3.1)",
        "W stands in 2.2.2 and the forces in 2.2.3, r and F belong to (2.15), w to (3.1) and (3.2)",
        f"pytest tests/{TRANSPOSED}; pytest tests/{WRENCHES}",
    )
    yield compare(
        "2.2",
        "the motion is n + m differential-algebraic equations for n accelerations "
        "and m multipliers",
        len(t.qdd) + len(t.multipliers) == 6,
        f"n + m = {len(t.qdd)} + {len(t.multipliers)}",
        "hapticlink info five-bar",
    )
    yield leave(
        "2.2",
        "integrating differential-algebraic equations is unsuited to real time",
        "no integrator of differential-algebraic equations is here; partitioning, which "
        "the report counts among them, is compared under B.2",
        "hapticlink bench formulations",
    )
    yield compare(
        "2.2",
        "differentiated twice, the constraints make ordinary differential equations",
        deviation(t.W @ t.qdd, -t.w) < 1e-9,
        f"W qdd + w = 0 to {deviation(t.W @ t.qdd, -t.w):.0e}",
        f"pytest tests/{TRANSPOSED}",
    )
    yield equation(
        "2.2 (2.3)",
        "D qdd + C qd + g = J_h' F_h + W' lambda",
        right,
        "components/blocks/test_virtual_mechanism.py::"
        "test_accelerations_and_multipliers_while_moving",
    )
    yield compare(
        "2.2",
        "gravity and flexibility are left out, since it moves in the horizontal plane",
        not bar.linkage.gravity and not bar.linkage.spring,
        "the scene has neither",
        "hapticlink info five-bar",
    )


def _matrices(bar: MovingFiveBar) -> Iterator[Statement]:
    t, qd = bar.terms, bar.qd
    dD, Ddot = bar.slopes("D"), bar.rate("D")
    dT = np.array([qd @ slope @ qd / 2 for slope in dD])
    off = deviation(-dT, t.C_qd)
    corrected = deviation(Ddot @ qd - dT, t.C_qd)
    yield misprint(
        "2.2.1 (2.4)",
        "D qdd is the rate of the momentum dT/dqd, which leaves out Ddot qd",
        deviation(np.zeros(4), Ddot @ qd),
        "Ddot qd",
        corrected,
        CORIOLIS,
    )
    yield misprint("2.2.1 (2.5)", "C qd = -dT/dq", off, "Ddot qd added", corrected, CORIOLIS)
    step = 1e-6
    moved = (bar.at(bar.q + step * qd, qd).x_h - bar.at(bar.q - step * qd, qd).x_h) / (2 * step)
    yield _by_differences(
        "2.2.1 (2.6)", "velocities are Jacobian times qd", deviation(t.J_h @ qd, moved), TERMS
    )
    energy = float(qd @ appendix_a.D(bar.q, f=FRACTIONS) @ qd / 2)
    yield equation(
        "2.2.1 (2.7)",
        "the kinetic energy of a body, of its centre and its turning",
        abs(energy - t.energy) / energy,
        TERMS,
    )
    yield equation(
        "2.2.1 (2.8)",
        "the kinetic energy of the system is the sum over its bodies",
        abs(energy - t.energy) / energy,
        TERMS,
    )
    yield compare(
        "2.2.1",
        "Lambda = m J'J and I are symmetric",
        deviation(t.D, t.D.T) < 1e-12,
        f"D is, {to(deviation(t.D, t.D.T))}",
        f"pytest tests/{TERMS}",
    )
    yield misprint(
        "2.2.1 (2.9)",
        "D qdd is the rate of (Lambda + I) qd, without Ddot qd",
        deviation(np.zeros(4), Ddot @ qd),
        "it",
        corrected,
        CORIOLIS,
    )
    D = appendix_a.D(bar.q, f=FRACTIONS)
    yield equation("2.2.1 (2.10)", "D = Lambda + I", deviation(t.D, D), TERMS)

    def C(sign: int) -> np.ndarray:
        first = np.einsum("ikj,i->kj", dD, qd) + np.einsum("jki,i->kj", dD, qd)
        return np.asarray(0.5 * (first + sign * np.einsum("kij,i->kj", dD, qd)))

    good, bad = deviation(C(-1) @ qd, t.C_qd), deviation(C(+1) @ qd, t.C_qd)
    per_body = deviation(C(-1)[:, :3] @ qd[:3], t.C_qd)
    yield misprint(
        "2.2.1 (2.11)",
        "C_kj is a sum over the bodies",
        per_body,
        "the sum over the n coordinates, times qd_i,",
        good,
        CHRISTOFFEL,
    )
    yield misprint(
        "2.2.1 (2.12)",
        "Christoffel symbols with three plus signs",
        bad,
        "- as the last",
        good,
        CHRISTOFFEL,
    )


def _constraints_and_forces(runs: Runs, bar: MovingFiveBar) -> Iterator[Statement]:
    t, qd = bar.terms, bar.qd
    yield equation(
        "2.2.2 (2.13)",
        "holonomic constraints h(q) = 0",
        float(np.abs(t.h).max() / min(appendix_a.L)),
        TERMS,
    )
    other = bar.at(bar.q, -2 * qd).h
    yield compare(
        "2.2.2",
        "only constraints that do not depend on time (scleronomic) are considered",
        np.array_equal(t.h, other),
        "h is a function of q, without time as an input, and the same at other velocities",
        f"pytest tests/{TERMS}",
    )
    rows, columns = t.W.shape
    yield misprinted(
        "2.2.2 (2.14)",
        "dh = W' dq with W = dh/dq",
        f"W is {rows} x {columns}: only W dq is a product, and vanishes to "
        f"{float(np.abs(t.W @ qd).max()):.0e} m/s on the motion",
        f"pytest tests/{TRANSPOSED}",
    )
    power = abs(t.multipliers @ t.W @ qd) / np.linalg.norm(t.W.T @ t.multipliers)
    yield compare(
        "2.2.2",
        "constraint forces do no work on admissible displacements",
        power < 1e-9,
        f"W' lambda works by {power:.0e} of itself",
        f"pytest tests/{TRANSPOSED}",
    )
    yield misprinted(
        "2.2.3 (2.15)",
        "Q = J F for each force",
        f"J is {t.J_h.shape[0]} x {t.J_h.shape[1]}; Q = J' F has the power of F to "
        f"{abs(qd @ t.J_h.T @ WRENCH - (t.J_h @ qd) @ WRENCH):.0e} W",
        f"pytest tests/{WRENCHES}",
    )
    yield equation(
        "2.2.3 (2.16)",
        "the point where a force acts has the pose (x, y, theta)",
        deviation(t.x_h, appendix_a.r_h(bar.q, f=FRACTIONS)),
        TERMS,
    )
    yield compare(
        "2.2.3 (2.17)",
        "a force in the plane has the components (F_x, F_y, T_z)",
        len(WRENCH) == 3,
        f"{len(WRENCH)} components",
        "hapticlink info closed-loop",
    )
    yield _outside_forces(runs)
    yield misprinted(
        "2.2.3 (2.18)",
        "J_h = dr_h/dq, and Q = J_h F_h",
        f"J_h is met {to(deviation(t.J_h, appendix_a.J_h(bar.q, f=FRACTIONS)))}; it is "
        "3 x 4, and only J_h' F_h is a product",
        f"pytest tests/{WRENCHES}",
    )


def _implementation(runs: Runs, bar: MovingFiveBar) -> Iterator[Statement]:
    t, qd = bar.terms, bar.qd
    yield leave(
        "3",
        "the centre of mass of link i is at the fraction f_i of its length",
        f"the fractions are not given; {appendix_a.F[0]} is taken",
        command("five-bar", "duration=0.1"),
    )
    yield compare(
        "3; figure 3.1",
        "a five-bar in relative, dependent coordinates",
        len(t.qdd) == 4 and len(t.multipliers) == 2,
        f"{len(t.qdd)} relative angles, {len(t.multipliers)} closures",
        "hapticlink info five-bar",
    )
    drift = (bar.at(bar.q + 1e-6 * qd, qd).W - bar.at(bar.q - 1e-6 * qd, qd).W) / 2e-6
    yield misprinted(
        "3 (3.1)",
        "W' qdd + w = 0",
        f"W is 2 x 4; W qdd + w = 0 is met to {deviation(t.W @ t.qdd, -t.w):.0e}",
        f"pytest tests/{TRANSPOSED}",
    )
    yield misprinted(
        "3 (3.2)",
        "w is the rate of W' times qd",
        f"W is 2 x 4; w = Wdot qd is met to {deviation(drift @ qd, t.w):.0e}, by differences",
        f"pytest tests/{ERRATA}test_appendix_a_w_has_two_rows",
    )
    yield leave(
        "figure 3.2",
        "the Simulink model of the interaction, with a PD controller",
        "its blocks are FMUs here, drawn in the guide; the controllers are those of chapter 4",
        "hapticlink info closed-loop",
    )
    gaps = {
        kind: measures.closure_gap(runs("five-bar", *stabilised(kind)))
        for kind in ("none", "baumgarte")
    }
    lost = command("five-bar", *stabilised("none"))
    smooth = command("five-bar", *FINE)
    kept = command("five-bar", *stabilised("baumgarte"))
    yield compare(
        "3; figure 3.3",
        "without stabilisation the closure error diverges from zero",
        gaps["none"][-1] > 1e-3,
        f"{1e3 * gaps['none'][-1]:.2g} mm after 3 s",
        lost,
    )
    growth = np.abs(np.linalg.eigvals([[0.0, 1.0], [0.0, 0.0]]))
    yield compare(
        "3",
        "hddot = 0 is marginally stable, and numerical errors drift",
        growth.max() == 0,
        f"both eigenvalues are 0; the drift is {gaps['none'].max():.0e} m under semi-implicit "
        "Euler, "
        f"{measures.closure_gap(runs('five-bar', *FINE)).max():.0e} m under rk4",
        f"{smooth}; {lost}",
    )
    yield misprinted(
        "3 (3.3)",
        "hdot + 2 alpha beta hdot + alpha^2 h = 0",
        "the first term has to be hddot, by its unit and for two roots",
        f"pytest tests/{ERRATA}test_baumgarte_starts_with_the_second_rate",
    )
    yield misprinted(
        "3 (3.4)",
        "W' qdd + w_stab = 0",
        "W is 2 x 4: W qdd",
        f"pytest tests/{TRANSPOSED}",
    )
    yield misprinted(
        "3 (3.5)",
        "w_stab = w + 2 alpha beta W' + alpha^2 h",
        "a vector and a matrix cannot be added: W qd",
        f"pytest tests/{ERRATA}test_baumgarte_damps_the_closure_rate",
    )
    yield leave(
        "3",
        "alpha and beta are chosen so that the error converges",
        "their values are not given; dead beat (alpha = 512 /s, beta = 1/2) is taken",
        kept,
    )
    yield compare(
        "3; figure 3.4",
        "with Baumgarte's stabilisation the error stays small",
        gaps["baumgarte"].max() < 1e-3 * min(appendix_a.L),
        f"at most {1e6 * gaps['baumgarte'].max():.2g} um",
        kept,
    )
    record = STATED_6.run(runs, ON).record
    kind, rate = record.scene["mechanism"]["stabilization"], record.scene["haptics"]["rate"]
    yield compare(
        "figure 3.5",
        "the mechanism with stabilisation is what runs at the haptic rate",
        record.fmus["virtual_mechanism"].rate == "haptics" and kind == "baumgarte",
        f'`virtual_mechanism` at {float(rate):g} Hz with `mechanism.stabilization = "{kind}"`',
        "hapticlink info closed-loop",
    )


def _outside_forces(runs: Runs) -> Statement:
    into = STATED_6.run(runs, ON).record.connections
    wrenches = [c for c in into if re.search(r"-> virtual_mechanism\.F_", c)]
    hands = [c for c in wrenches if c.endswith(".F_hand")]
    return compare(
        "2.2.3",
        "only one outside force acts, that of the hand",
        len(hands) == 1 and len(wrenches) == 2,
        f"{len(hands)} connection into `F_hand`; the coupling's F_drift comes beside it",
        "hapticlink run closed-loop --set duration=0.1",
    )
