"""Appendix B, the paper: sections B.1 to B.5."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from studies.report import appendix_a, measures
from studies.report.chapter3 import stabilised
from studies.report.chapter6 import describe_end
from studies.report.five_bar import FRACTIONS, WRENCH, MovingFiveBar
from studies.report.report_page import Runs, command
from studies.report.statements.mobility import CLOSED, neglected_terms
from studies.report.statements.statement import (
    Statement,
    compare,
    deviation,
    equation,
    leave,
    misprint,
    misprinted,
    tested,
)
from studies.report.systems import IDEAL_6, IDEAL_B6, ON, STATED_B6, VARYING_B6

ERRATA = "test_errata.py::"
SIGN = f"{ERRATA}test_one_sign_of_lambda"
RANK = "components/blocks/test_virtual_mechanism_options.py::test_rank_of_shipped_linkages"
BENCH = "hapticlink bench formulations"
FORMULATIONS = Path(__file__).parents[3] / "results/formulations/cases.csv"
HAPTIC_RATES = (64, 128, 256, 512)


def statements(runs: Runs) -> Iterator[Statement]:
    yield from _introduction(runs)
    yield from _formulations(runs)
    yield from _simulation(runs)
    yield from _rendering(runs)
    yield from _inertia(runs)
    yield from _local_model(runs)


def _introduction(runs: Runs) -> Iterator[Statement]:
    ends = {}
    for rate in HAPTIC_RATES:
        results = IDEAL_6.run(runs, ON, f"haptics.rate={rate}")
        gap = np.hypot(
            *(results.haptics["virtual_mechanism.x"] - results.haptics["haptic_device.x_true"])[
                :, :2
            ].T
        )
        ends[rate] = describe_end(results), 1e3 * float(gap.max())
    said = ", ".join(f"{rate} Hz: {mm:.2g} mm ({end})" for rate, (end, mm) in ends.items())
    yield compare(
        "B.1",
        "haptic control needs rates of hundreds of Hz",
        all(mm > 2 * ends[512][1] for _, mm in list(ends.values())[:-1]),
        f"idealised, largest distance by haptic rate: {said}",
        "; ".join(IDEAL_6.command(ON, f"haptics.rate={rate}") for rate in HAPTIC_RATES),
    )
    yield leave("B.1", "what others had done on linkages in the hand", "literature")
    yield compare(
        "B.1",
        "stiffness control restricts the hand as closed loops require",
        _worst(STATED_B6.run(runs, ON)) < 20,
        f"as stated {_worst(STATED_B6.run(runs, ON)):.3g}"
        f" mm at most, idealised {_worst(IDEAL_B6.run(runs, ON)):.2g} mm",
        f"{STATED_B6.command(ON)}; {IDEAL_B6.command(ON)}",
    )


def _worst(results: object) -> float:
    table = results.haptics  # type: ignore[attr-defined]
    return 1e3 * float(
        np.hypot(*(table["virtual_mechanism.x"] - table["haptic_device.x_true"])[:, :2].T).max()
    )


def formulations() -> dict[str, tuple[float, float, int]]:
    """Time (us) and operations of a step, median over the cases, and number of cases lost (above
    10 mm, or no number), by formulation: the table of `hapticlink bench formulations`."""
    with FORMULATIONS.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        time, count = (
            float(np.median([float(r[key]) for r in own])) for key in ("us_a_step", "operations")
        )
        found[method] = time, count, sum(not float(r["error_mm"]) <= 10 for r in own)
    return found


def _formulations(runs: Runs) -> Iterator[Statement]:
    made = formulations()
    times = "; ".join(
        f"{name}: {us:.2g} us a step, {lost} of its runs lost"
        for name, (us, _, lost) in made.items()
    )
    yield compare(
        "B.2",
        "three ways to close loops: multipliers, partitioning, embedding",
        len(made) >= 3,
        "all three stand side by side",
        BENCH,
    )
    partitioned = made["coordinate partitioning"]
    yield compare(
        "B.2",
        "partitioning, which leaves differential-algebraic equations, is unsuitable in real time",
        partitioned[0] > 1e6 / 512,
        f"{partitioned[0]:.2g} us of {1e6 / 512:.0f} us a step at 512 Hz, with Newton iterations "
        f"at each stage; {times}",
        BENCH,
    )
    yield leave(
        "B.2",
        "multipliers leave differential-algebraic equations that are unsuitable in real time",
        "no integrator of such equations is here; differentiated twice they are those of "
        "`virtual_mechanism`",
        BENCH,
    )
    gaps = {
        kind: float(measures.closure_gap(runs("five-bar", *stabilised(kind))).max())
        for kind in ("none", "baumgarte")
    }
    yield compare(
        "B.2",
        "differentiated twice, the constraints need stabilisation",
        gaps["none"] > 10 * gaps["baumgarte"],
        f"the loop opens by {1e3 * gaps['none']:.2g} mm in 3 s without, by "
        f"{1e3 * gaps['baumgarte']:.2g} mm with Baumgarte's: figures 3.3 and 3.4",
        "; ".join(command("five-bar", *stabilised(kind)) for kind in gaps),
    )
    embedded = made["symbolic embedding"]
    yield compare(
        "B.2",
        "embedding needs no stabilisation, but its symbols are too slow for haptics",
        embedded[0] > 1000,
        f"{embedded[0]:.2g} us a step; what it lacks is a chart of the "
        f"whole motion: {embedded[2]} runs are lost",
        BENCH,
    )
    yield leave(
        "B.2",
        "symbols outside of the main loop (multi-rate) make embedding fast",
        "that code is not there",
        BENCH,
    )
    fewest, ours = made["coordinate partitioning"], made["multipliers, projection"]
    yield compare(
        "B.2",
        "solving n + m instead of n - m equations costs little",
        ours[0] < 1.5 * fewest[0],
        f"{ours[1]:.0f} against {fewest[1]:.0f} operations a step, "
        f"{ours[0]:.2g} against {fewest[0]:.2g} us",
        BENCH,
    )
    yield compare(
        "B.2",
        "multipliers need no new coordinates during a run",
        ours[2] == 0,
        f"{ours[2]} runs lost, of embedding with fixed ones {embedded[2]}",
        BENCH,
    )


def _simulation(runs: Runs) -> Iterator[Statement]:
    bar = MovingFiveBar()
    t, q, qd = bar.terms, bar.q, bar.qd
    D, C = appendix_a.D(q, f=FRACTIONS), appendix_a.C(q, qd, f=FRACTIONS)
    J, W = appendix_a.J_h(q, f=FRACTIONS), appendix_a.W(q)
    left = D @ t.qdd + C @ qd - J.T @ WRENCH
    wrong, right = deviation(-W.T @ t.multipliers, left), deviation(W.T @ t.multipliers, left)
    yield compare(
        "B.2; figure B.1",
        "relative joint coordinates after the loops are cut",
        len(q) == 4,
        f"{len(q)} coordinates, one cut joint",
        "hapticlink info five-bar",
    )
    yield misprint(
        "B.2 (B.1)",
        "the dynamics with contacts, with - W' lambda where (B.7) has +",
        wrong,
        "the sign of (B.7)",
        right,
        SIGN,
    )
    loops = len(bar.linkage.loop)
    yield misprinted(
        "B.2 (B.1)",
        "with m closed loops W is m x n and lambda m x 1",
        f"m counts constraints, two to a loop in the plane: {loops} loop, W is "
        f"{W.shape[0]} x {W.shape[1]}",
        f"pytest tests/{RANK}",
    )
    yield leave(
        "B.2 (B.1)",
        "wrenches have six components, Jacobians six rows",
        "three here: the project is planar, as the setup is",
    )
    inner = W @ np.linalg.solve(D, W.T)
    yield compare(
        "B.2",
        "before it is augmented with acceleration constraints, it is a system of index three",
        np.linalg.cond(inner) < 1e9,
        "lambda follows from h differentiated twice, and its rate from h differentiated three "
        f"times, where W D^-1 W' can be inverted: its condition is {np.linalg.cond(inner):.2g}",
        f"pytest tests/{RANK}",
    )
    yield leave(
        "B.2",
        "linkages under feedback control could be added",
        "done here: drives and efforts on joints",
        "pytest tests/components/dynamics/test_joint_ports.py",
    )
    yield equation(
        "B.2 (B.2)",
        "hddot = W qdd + w = 0",
        deviation(W @ t.qdd, -appendix_a.w(q, qd)),
        f"{ERRATA}test_constraint_jacobian_is_not_transposed",
    )
    rate = (appendix_a.W(q + 1e-6 * qd) - appendix_a.W(q - 1e-6 * qd)) / 2e-6 @ qd
    yield compare(
        "B.2 (B.3)",
        "w = (dW/dt + dW/dq qd) qd",
        deviation(rate, t.w) < 1e-6,
        f"met to {deviation(rate, t.w):.0e}, by differences",
        f"pytest tests/{ERRATA}test_appendix_a_w_has_two_rows",
    )
    yield tested(
        "B.2 (B.4)",
        "hddot + 2 alpha beta hdot + alpha^2 h = 0",
        "met off the closures to 1e-9",
        f"{ERRATA}test_baumgarte_starts_with_the_second_rate",
    )
    yield misprinted(
        "B.2 (B.5)",
        "w_stab = w + 2 alpha beta W + alpha^2 h",
        "a vector and a matrix cannot be added: W qd",
        f"pytest tests/{ERRATA}test_baumgarte_damps_the_closure_rate",
    )
    K = np.block([[D, -W.T], [W, np.zeros((2, 2))]])
    solved = np.linalg.solve(K, np.concatenate([J.T @ WRENCH - C @ qd, -appendix_a.w(q, qd)]))
    yield misprinted(
        "B.2 (B.6)",
        "one system for qdd and lambda, with + W' in its first row",
        f"qdd agrees to {deviation(solved[:4], t.qdd):.0e}; lambda has the other sign than "
        "that of (B.7)",
        f"pytest tests/{SIGN}",
    )
    record = STATED_B6.run(runs, ON).record
    yield compare(
        "B.2",
        "the accelerations are integrated in steps of the force loop",
        record.fmus["virtual_mechanism"].rate == record.fmus["controller"].rate == "haptics",
        f"`virtual_mechanism` and `controller` step at {record.scene['haptics']['rate']} Hz",
        "hapticlink info closed-loop-b1",
    )
    yield misprinted(
        "B.2",
        "W is non-singular without redundant closures",
        f"W is 2 x 4, of rank {np.linalg.matrix_rank(W)}: of full row rank",
        f"pytest tests/{RANK}",
    )
    yield tested(
        "B.2",
        "there are fast ways to the Lagrangian dynamics of trees",
        "articulated bodies, linear in the number of links",
        "components/dynamics/test_scaling.py",
    )


def _rendering(runs: Runs) -> Iterator[Statement]:
    controller = STATED_B6.run(runs, ON).record.scene["controller"]
    parts = [part for part in ("impedance", "topology", "teleoperation") if controller[part]]
    yield compare(
        "B.3; figure B.2",
        "separate controllers render inertia, joints and contacts",
        len(parts) == 3,
        f"{', '.join(parts)} parts",
        "hapticlink info closed-loop-b1",
    )
    yield tested(
        "B.3",
        "joint constraints hinder motion along n_c by a stiffness",
        "F_T along P_c; see 4.2.4",
        "components/blocks/test_controller.py::"
        "test_constraint_wrench_accelerates_the_device_by_the_pull_where_resisted",
    )


def _inertia(runs: Runs) -> Iterator[Statement]:
    bar = MovingFiveBar()
    t, q = bar.terms, bar.q
    D_inv, W = np.linalg.inv(appendix_a.D(q, f=FRACTIONS)), appendix_a.W(q)
    J = appendix_a.J_h(q, f=FRACTIONS)
    S = W @ D_inv @ W.T
    inner = np.linalg.solve(S, W @ D_inv @ J.T)
    multipliers = -inner @ WRENCH
    right = J.T @ WRENCH + W.T @ multipliers
    still = bar.at(q, np.zeros(4))
    text = "dynamic coupling is negligible, as the experiment of B.6 verifies"
    yield from neglected_terms(runs, "B.4", (STATED_B6, IDEAL_B6), text)
    yield equation(
        "B.4 (B.7)",
        "D qdd = J_h' F_h + W' lambda at rest",
        deviation(np.linalg.inv(D_inv) @ still.qdd, right),
        SIGN,
    )
    yield equation(
        "B.4 (B.8)", "qdd = D^-1 (J_h' F_h + W' lambda)", deviation(D_inv @ right, still.qdd), SIGN
    )
    yield equation(
        "B.4 (B.9)",
        "xdd = J_h qdd = Lambda^-1 F_h",
        deviation(t.Lambda_inv @ WRENCH, J @ still.qdd),
        CLOSED,
    )
    yield equation(
        "B.4 (B.10)",
        "Lambda^-1 F_h = J_h D^-1 (J_h' F_h + W' lambda)",
        deviation(t.Lambda_inv @ WRENCH, J @ D_inv @ right),
        CLOSED,
    )
    yield equation(
        "B.4 (B.11)",
        "lambda = -(W D^-1 W')^-1 W D^-1 J_h' F_h",
        deviation(still.multipliers, multipliers),
        CLOSED,
    )
    found = J @ D_inv @ (J.T - W.T @ inner)
    yield equation(
        "B.4 (B.12)",
        "(B.11) put into (B.10)",
        deviation(found @ WRENCH, t.Lambda_inv @ WRENCH),
        CLOSED,
    )
    yield equation(
        "B.4 (B.13)",
        "Lambda^-1 = J_h D^-1 (J_h' - W' (W D^-1 W')^-1 W D^-1 J_h')",
        deviation(found, t.Lambda_inv),
        CLOSED,
    )
    yield equation(
        "B.4",
        "the first term of (B.13) is the mobility with the loops open",
        deviation(t.open_Lambda_inv, J @ D_inv @ J.T),
        CLOSED,
    )
    U, values, _ = np.linalg.svd(t.Lambda_inv)
    v = t.J_h @ bar.qd
    n = U[:, -1]
    yield compare(
        "B.4",
        "feasible motions are the range of Lambda^-1, hindered ones its null space",
        abs(n @ v) < 1e-9 * np.linalg.norm(v),
        f"velocity along the null direction: {abs(n @ v) / np.linalg.norm(v):.0e} of itself",
        "pytest tests/components/dynamics/test_constrained_directions.py",
    )
    row = np.linalg.norm(t.Lambda_inv @ U[-1]) / values[0]
    column = np.linalg.norm(t.Lambda_inv @ n) / values[0]
    yield misprinted(
        "B.4 (B.14)",
        "the constrained directions are rows of U",
        f"Lambda^-1 leaves {row:.2g} of itself on the last row, {column:.0e} on the last column",
        "pytest tests/components/dynamics/test_constrained_directions.py::"
        "test_null_directions_are_columns_of_U_and_not_its_rows",
    )


def _local_model(runs: Runs) -> Iterator[Statement]:
    yield compare(
        "B.5",
        "no decomposition has a guaranteed running time, so it leaves the haptic loop",
        False,
        "five sweeps of Jacobi rotations diagonalise a 3 x 3 matrix to rounding, "
        "always in the same time",
        "pytest tests/components/dynamics/"
        "test_constrained_directions.py::test_eigenvalues_are_those_of_lapack",
    )
    yield compare(
        "B.5; figure B.3",
        "a local model at the haptic rate gets its matrices from the simulation",
        STATED_B6.run(runs, ON).record.scene["local_model"] is True,
        "local_model = true",
        "hapticlink info closed-loop-b1",
    )
    closure = {
        rate: float(
            STATED_B6.run(runs, ON, f"graphics.rate={rate}")
            .haptics["virtual_mechanism.closure_error"]
            .max()
        )
        for rate in (30, 60)
    }
    said = ", ".join(f"{1e3 * m:.2g} mm at {rate} Hz" for rate, m in closure.items())
    yield compare(
        "B.5 (B.15)",
        "D, W, w and G of the last update stand for their own",
        max(closure.values()) < 1e-3,
        f"the loop then opens by {said}",
        "; ".join(STATED_B6.command(ON, f"graphics.rate={r}") for r in closure),
    )
    scene, shown = STATED_B6.scene, f"hapticlink info {STATED_B6.scene}"
    counts = [measures.operations(scene, f"local_model={own}") for own in ("true", "false")]
    yield compare(
        "B.5",
        "matrices of the last update save computing time at the haptic rate",
        counts[0] < counts[1],
        f"a haptic tick takes {counts[0]:.0f} operations, {counts[1]:.0f} with its own",
        f"{shown}; {shown} --set local_model=false",
    )
    frame, own = (
        STATED_B6.run(runs, ON).graphics["virtual_environment.P_c"],
        STATED_B6.run(runs, ON).graphics["virtual_environment.Lambda_inv"],
    )
    one = np.trace(frame, axis1=1, axis2=2) < 1.5
    values, vectors = np.linalg.eigh(own[one])
    scale = np.array((1, 1, np.mean((0.045, 0.045, 0.021, 0.06))))
    n = vectors[:, :, 0] / scale
    n /= np.linalg.norm(n, axis=1)[:, None]
    error = float(np.abs(np.einsum("kij,kj->ki", frame[one], n) - n).max())
    del values
    yield compare(
        "B.5 (B.16)",
        "the directions of constraint are the columns of U of the last update",
        error < 1e-6,
        f"P_c keeps the null vectors of the frames' Lambda^-1 to {error:.0e}",
        STATED_B6.command(ON),
    )
    ratio = measures.neglected(IDEAL_B6.run(runs, ON))
    yield compare(
        "B.5",
        "users are slow enough that velocity terms can be ignored",
        ratio.bias[0] < 0.1 * ratio.rendered[0],
        f"idealised B.6: {ratio.bias[0]:.2g} m/s2 RMS left out, {ratio.rendered[0]:.2g} rendered",
        IDEAL_B6.command(ON),
    )
    ends = {rate: STATED_B6.run(runs, ON, f"graphics.rate={rate}") for rate in (10, 20, 30, 60)}
    varied = VARYING_B6.run(runs, ON)
    said = ", ".join(f"{rate} Hz: {describe_end(run)}" for rate, run in ends.items())
    yield compare(
        "B.5",
        "with these approximations linkages with closed loops can be operated",
        all(run.record.end.reason == "duration" for run in (*ends.values(), varied)),
        f"as stated, {said}; 10 to 50 Hz: {describe_end(varied)}",
        "; ".join(
            [*(STATED_B6.command(ON, f"graphics.rate={r}") for r in ends), VARYING_B6.command(ON)]
        ),
    )
