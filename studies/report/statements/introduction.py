"""Abstract and chapter 1."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import tracking
from hapticlink.analysis.stability import wall_limits
from hapticlink.components.device import discretisation
from hapticlink.orchestrator import open_scene
from studies.report.five_bar import MovingFiveBar
from studies.report.report_page import Runs, command
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
from studies.report.systems import DIRECTIONS, OFF, ON, STATED_6, VARYING_6

LINKS = range(1, 5)
POLES = "components/device/test_discretisation.py::test_poles_go_where_the_map_says"
RULES = "components/device/test_discretisation.py::test_each_rule_is_its_equation"
PRINTED = (
    "components/device/test_discretisation.py::test_printed_trapezoid_does_not_integrate_a_constant"
)


def statements(runs: Runs) -> Iterator[Statement]:
    yield from _abstract(runs)
    yield from _setup(runs)
    yield from _discrete_equivalents()
    yield from _walls(runs)
    yield from _systems_and_rates(runs)


def _abstract(runs: Runs) -> Iterator[Statement]:
    t = MovingFiveBar()
    found, D_inv, W = t.terms, np.linalg.inv(t.terms.D), t.terms.W
    kept = D_inv - D_inv @ W.T @ np.linalg.solve(W @ D_inv @ W.T, W @ D_inv)
    error = deviation(found.Lambda_inv, found.J_h @ kept @ found.J_h.T)
    yield compare(
        "abstract",
        "a technique gives the inertia of a mechanism with closed loops at the hand",
        error < 1e-9,
        "Lambda^-1 of the five-bar is J_h (D^-1 with the closures' share removed) J_h' to "
        f"{error:.0e}",
        "pytest tests/reference/test_numbers.py::test_assembled_pose_and_mobility",
    )
    null = np.linalg.eigvalsh(found.Lambda_inv)
    yield compare(
        "abstract",
        "a technique gives the directions of motion at the hand that the virtual joints resist",
        abs(null[0]) < 1e-9 * null[-1],
        f"eigenvalues of Lambda^-1: {null[0]:.0e}, {null[1]:.3g}, {null[2]:.4g}: one direction",
        "pytest tests/components/dynamics/test_constrained_directions.py",
    )
    points = (f'linkage.operational_point={{body="link{i}", at=[0.01, 0.0]}}' for i in LINKS)
    held = [("duration=0.1", DIRECTIONS, point) for point in points]
    ranks = [
        3 - int(runs("five-bar", *options).haptics["virtual_mechanism.n_constraints"][0])
        for options in held
    ]
    yield compare(
        "abstract; 1.4; B.1",
        "users can operate the mechanism from any link that they choose",
        min(ranks) >= 1,
        f"held at link 1, 2, 3, 4 the hand has {', '.join(map(str, ranks))} free directions",
        "; ".join(command("five-bar", *options) for options in held),
    )
    on, off = (tracking(STATED_6.run(runs, way))[1].max() for way in (ON, OFF))
    yield compare(
        "abstract; 1.4",
        "the method fits the control structure that renders serial linkages, and experiments "
        "validate it",
        on < off / 10,
        f"handle and operational point at most {on:.2g} mm apart, {off:.0f} mm without the "
        "topology controller",
        f"{STATED_6.command(ON)}; {STATED_6.command(OFF)}",
    )
    yield leave(
        "abstract; 1.4; B.1",
        "virtual prototyping and training for surgery need linkages with closed loops in the hand",
        "applications, outside of what is computed",
    )
    wired = STATED_6.run(runs, ON).record.connections
    into, out = (
        {c.split(" -> ")[end].partition(".")[2] for c in wired if _is_device(c, end)}
        for end in (1, 0)
    )
    yield compare(
        "1.1",
        "a haptic device sends signals and receives them, unlike screens and speakers",
        "F_motor" in into and "x" in out,
        f"`haptic_device` gets {', '.join(sorted(into - {'x_start'}))}, "
        f"gives {', '.join(sorted(out))}",
        "hapticlink info closed-loop",
    )
    yield leave("1.1", "how the field of haptics came to be, and its three areas", "history")
    yield leave(
        "figure 1.1",
        "a virtual-reality system with visual, auditory and haptic paths",
        "a drawing of others; this project has no audio",
    )
    yield leave("figure 1.2", "examples of haptic devices", "photographs")


def _is_device(connection: str, end: int) -> bool:
    return connection.split(" -> ")[end].startswith("haptic_device.")


def _setup(runs: Runs) -> Iterator[Statement]:
    results = STATED_6.run(runs, ON)
    haptics, scene = results.haptics, results.record.scene
    apart = haptics["haptic_device.x"] - haptics["haptic_device.x_true"]
    yield compare(
        "1.2; figure 1.3",
        "two five-bars in parallel give the handle two translations and one rotation",
        haptics["haptic_device.x_true"].shape[1] == 3,
        f"{haptics['haptic_device.x_true'].shape[1]} coordinates of the handle, apparent inertia "
        f"{np.linalg.eigvalsh(haptics['haptic_device.M'][0])[0]:.2g} kg.m2 to "
        f"{np.linalg.eigvalsh(haptics['haptic_device.M'][0])[-1]:.2g} kg (dimensions assumed)",
        f"{STATED_6.command(ON)}; pytest tests/components/device/test_pantograph.py",
    )
    yield tested(
        "1.2",
        "four motors at the base joints control the three degrees of freedom",
        "four torques of least norm for a wrench of three; the direction stays when they saturate",
        "components/device/test_pantograph.py::"
        "test_torques_give_the_wrench_with_least_norm_or_saturate_in_its_direction",
    )
    worst = 1e3 * np.hypot(*apart[:, :2].T).max()
    yield compare(
        "1.2",
        "the pose of the handle follows from encoders and the kinematics of the device",
        worst < 0.5,
        f"measured and true pose at most {worst:.2g} mm apart in the run of chapter 6",
        STATED_6.command(ON),
    )
    yield leave(
        "1.2",
        "Vortex simulates and displays the virtual environment",
        "closed source; the graphics copy `virtual_environment` stands in its place",
        "hapticlink info closed-loop",
    )
    yield leave(
        "1.2",
        "two computers, one with Windows 2000 and one with VxWorks",
        "the hardware is not there; a scene can run on two computers",
        "pytest tests/orchestrator/network/test_two_computers.py",
    )
    rate = scene["haptics"]["rate"]
    yield compare(
        "1.2; 1.3.4",
        "haptic control and rendering run at 512 Hz",
        float(rate) == 512,
        f"{float(rate):g} Hz",
        STATED_6.command(ON),
    )
    yield misprinted(
        "1.2",
        "the graphics run at 10 to 60 Hz; 1.3.4 says 10 to 50 Hz",
        "the two sections differ; figures are made at 30 Hz and at 10 to 50 Hz, tables at 10 to 60",
        f"{STATED_6.command(ON)}; {VARYING_6.command(ON)}; hapticlink study",
    )
    yield leave(
        "1.3",
        "four challenges: discrete equivalents, walls, dynamics, sample times",
        "an outline of what follows",
    )


def _discrete_equivalents() -> Iterator[Statement]:
    s, h = -3.0, 0.1
    for rule, place, name in (
        ("forward", "1.3.1 (1.1)", "forward"),
        ("backward", "1.3.1 (1.2)", "backward"),
    ):
        z = discretisation.pole(rule, s * h)
        slope = (z - 1) / h
        met = abs(slope - s * (1 if rule == "forward" else z))
        yield equation(place, f"the {name} rectangular rule", met / abs(s), RULES)
    z = discretisation.pole("trapezoidal", s * h)
    slope, printed, corrected = (z - 1) / h, s * (z - 1) / 2, s * (z + 1) / 2
    yield misprint(
        "1.3.1 (1.3)",
        "the trapezoid rule, printed with a difference of the slopes",
        abs(printed - slope) / abs(slope),
        "their sum",
        abs(corrected - slope) / abs(slope),
        PRINTED,
    )
    rng = np.random.default_rng(14)
    poles = -(10 ** rng.uniform(-2, 2, 600)) + 1j * 10 ** rng.uniform(-2, 2, 600)
    lost = {
        rule: 100 * float(np.mean(np.abs(discretisation.pole(rule, poles)) > 1 + 1e-12))
        for rule in ("forward", "backward", "trapezoidal")
    }
    yield compare(
        "figure 1.4",
        "images of the stable half plane: left of z = 1, the circle on [0, 1], the unit circle",
        lost["backward"] == lost["trapezoidal"] == 0 < lost["forward"],
        "; ".join(
            f"{rule}: {share:.0f} % of 600 poles leave the circle" for rule, share in lost.items()
        ),
        f"pytest tests/{POLES}",
    )
    yield compare(
        "1.3.1",
        "a stable system may become unstable by the forward rule, as haptics uses it",
        lost["forward"] > 0,
        f"{lost['forward']:.0f} % of 600 stable poles become unstable",
        "pytest tests/components/device/test_discretisation.py::test_image_of_the_left_half_plane",
    )
    yield leave(
        "1.3.1", "computers, and some amplifiers, make discretisation necessary", "a premise"
    )


def _walls(runs: Runs) -> Iterator[Statement]:
    table = runs("sampled-spring").haptics
    x, F = table["virtual_mechanism.x[1]"], table["hand.F[1]"]
    K = -F[0] / x[0]
    total = table["virtual_mechanism.energy"] + 0.5 * K * x**2
    fast = runs("sampled-spring", "haptics.rate=4000").haptics
    x_fast = fast["virtual_mechanism.x[1]"]
    kept = fast["virtual_mechanism.energy"] + 0.5 * K * x_fast**2
    dx = np.diff(x)
    shown = command("sampled-spring")
    yield compare(
        "1.3.2",
        "an ideal spring is lossless",
        kept[-1] / kept[0] < 1.2,
        f"sampled at 4000 Hz the energy changes by {100 * (kept[-1] / kept[0] - 1):.2g} % in "
        f"{fast['time'][-1]:g} s, at 20 Hz by {100 * (total[-1] / total[0] - 1):.0f} %",
        f"{command('sampled-spring', 'haptics.rate=4000')}; {shown}",
    )
    yield compare(
        "1.3.2; figure 1.5",
        "a virtual spring behind a zero-order hold generates energy",
        total[-1] > total[0],
        f"{total[0]:.3g} J become {total[-1]:.3g} J in {table['time'][-1]:g} s, 1/2 K sum dx^2 to "
        f"{abs(total[-1] - total[0] - 0.5 * K * np.sum(dx**2)) / (total[-1] - total[0]):.0e}",
        shown,
    )
    yield compare(
        "1.3.2",
        "a virtual spring behind a zero-order hold generates energy always",
        np.all(np.diff(total) >= -1e-9 * total[-1]),
        f"in each of {len(dx)} samples, by 1/2 K dx^2, at least {np.diff(total).min():.1e} J",
        shown,
    )
    squeeze = x[:-1] * dx > 0
    at_start, mean = np.abs(F[:-1]), K * np.abs(x[:-1] + x[1:]) / 2
    lag = np.sum((at_start - mean)[squeeze]) / np.sum(mean[squeeze])
    lead = np.sum((at_start - mean)[~squeeze]) / np.sum(mean[~squeeze])
    yield compare(
        "1.3.2",
        "the held force is too small while the spring is squeezed and too large while it expands",
        lag < 0 < lead,
        f"{100 * lag:.2g} % against the spring's mean force in squeezing, {100 * lead:+.2g} % in "
        "releasing",
        shown,
    )
    T, m, limit_test = 1 / 512, 0.3, "pytest tests/analysis/stability/test_wall_limits.py"
    low, best, high = (
        wall_limits.limit_without_damping(m, T, share * m / T) for share in (0.02, 0.83, 1.95)
    )
    yield compare(
        "1.3.2",
        "damping of a wall has to be large enough against oscillation",
        low < best,
        f"largest stable stiffness of a wall on {m} kg at 512 Hz: {low:.0f} N/m with B T/m = 0.02, "
        f"{best:.0f} with 0.83",
        limit_test,
    )
    frequency = _frequency(m, T, 1.95 * m / T)
    yield compare(
        "1.3.2",
        "too much damping of a wall makes oscillations of high frequency",
        high < best and frequency > 100,
        f"{high:.0f} N/m with B T/m = 1.95, where the mode that gets unstable has "
        f"{frequency:.0f} Hz",
        limit_test,
    )
    passive = [wall_limits.passive(5.0, T, B) for B in (0.0, 2.0)]
    yield compare(
        "1.3.2",
        "a sampled damper can produce energy",
        passive[1] < passive[0],
        f"a wall on a device with 5 N.s/m is passive up to {passive[0]:.0f} N/m, with a sampled "
        f"damper of 2 N.s/m up to {passive[1]:.0f}",
        limit_test,
    )
    lowest = lowest_generating(1 / T)
    yield compare(
        "1.3.2",
        "a sampled damper produces energy usually under excitation of high frequency",
        lowest > 100,
        "moved as a sine, with the velocity from differences and the force held, it produces "
        f"energy from {lowest:.0f} Hz up: above a quarter of the rate, 512 Hz",
        "pytest tests/studies/report/test_statements.py::"
        "test_a_sampled_damper_produces_energy_above_a_quarter_of_the_rate",
    )


def lowest_generating(rate: float) -> float:
    """Lowest whole frequency (Hz) of a sine below half the rate (Hz) at which a damper produces
    energy that takes its velocity from differences of samples and holds its force: the sum over
    samples of F dx, here of unit damping and amplitude, over ten seconds."""
    t = np.arange(int(10 * rate)) / rate
    for frequency in range(1, int(rate / 2)):
        dx = np.diff(np.sin(2 * np.pi * frequency * t + 0.3))
        if np.sum(dx[:-1] * dx[1:]) < 0:
            return float(frequency)
    raise AssertionError("a held damper produces energy at no frequency")


def _frequency(m: float, T: float, B: float) -> float:
    """Frequency (Hz) of the mode on the unit circle at the limit of a wall's stiffness."""
    alpha, beta = wall_limits.limit_without_damping(m, T, B) * T**2 / m, B * T / m
    roots = np.roots([1, -2 + (alpha + beta) / 2, 1 + alpha / 2, -beta / 2])
    return float(abs(np.angle(roots[np.abs(roots).argmax()])) / (2 * np.pi * T))


def _systems_and_rates(runs: Runs) -> Iterator[Statement]:
    counts = MovingFiveBar().terms.operations
    serial = open_scene.load("serial").linkage
    assert serial
    yield compare(
        "1.3.3",
        "linkages of present setups are open, in independent coordinates, without constraints",
        not serial.loop,
        f"scene `serial`: {len(serial.joint)} joints, {len(serial.loop)} closures",
        command("serial", "duration=0.1"),
    )
    yield compare(
        "1.3.3",
        "no constraint equations save computing time",
        counts["open"] < counts["closed"],
        f"accelerations of the five-bar take {counts['closed']} operations, of the same links with "
        f"the loop open {counts['open']}",
        "hapticlink bench formulations",
    )
    yield leave(
        "1.3.3",
        "faster and more exact models are a challenge in spite of faster computers",
        "an opinion of 2006",
    )
    yield leave(
        "1.3.4",
        "two processors take the hard deadlines from the simulation",
        "a property of their hardware",
    )
    fixed = runs("closed-loop-ideal", DIRECTIONS, ON)
    yield compare(
        "1.3.4",
        "engines at different rates need a mechanism that synchronises them",
        len(fixed.record.holds) > 0,
        f"{len(fixed.record.holds)} connections cross rates, each with a hold",
        command("closed-loop-ideal", DIRECTIONS, ON),
    )
