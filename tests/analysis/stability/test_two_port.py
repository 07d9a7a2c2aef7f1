"""Absolute stability of the rendering between hand and mechanism, against closed forms and random
passive terminations."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from hapticlink.analysis.stability import passivity
from hapticlink.analysis.stability.absolute_stability import (
    damping_shortage,
    damping_shortage_of_two,
    least,
)
from hapticlink.analysis.stability.equilibrium import equilibrium
from hapticlink.analysis.stability.lifted_map import open_lifted_map
from hapticlink.analysis.stability.passivity import Passivity
from hapticlink.analysis.stability.port_response import HandPort, MechanismPort
from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build_fmu import build
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.system import Coupling, Fmu, System
from tests.orchestrator.run.test_multirate import F, V, X
from tests.orchestrator.systems import connected
from tests.orchestrator.timelines import fixed

T = 1 / 512
MASS, DAMPING, K, B = 0.1, 2.0, 500.0, 1.0
"""Of the device (kg, N.s/m), and of the coupling (N/m, N.s/m)."""
Complex = NDArray[np.complex128]
HAND = Variable("F_h", (), "N")


def device() -> Component:
    """m v' = F + F_h - b v, exact for constant forces."""
    block = Block(inputs=[F, HAND], states=[X, V], outputs=[X, V])
    x, v, h = block.x["x"], block.x["v"], block.h
    ahead, decay = (block.u["F"] + block.u["F_h"]) / DAMPING, ca.exp(-DAMPING / MASS * h)
    end = {"v": decay * v + (1 - decay) * ahead}
    end["x"] = x + ahead * h + (v - ahead) * (1 - decay) * MASS / DAMPING
    return block.component(
        "device", "a mass", "continuous",
        initial={"x": ca.SX(0.0), "v": ca.SX(0.0)}, step=end, output={"x": x, "v": v},
    )  # fmt: skip


def mechanism() -> Component:
    """A mass of 0.5 kg by semi-implicit Euler, on a spring of 50 N/m."""
    block = Block(inputs=[F], states=[X, V], outputs=[X, V])
    x, v = block.x["x"], block.x["v"]
    after = v + block.h * (-block.u["F"] - 50.0 * x) / 0.5
    return block.component(
        "mechanism", "a mass", "continuous", initial={"x": ca.SX(0.0), "v": ca.SX(0.0)},
        step={"x": x + block.h * after, "v": after}, output={"x": x, "v": v},
    )  # fmt: skip


def sampled(name: str, inputs: Sequence[str]) -> Component:
    """The coupling, and a hand that is a spring and a damper."""
    units = {"x": "m", "v": "m/s"}
    block = Block(inputs=[Variable(n, (), units[n[0]]) for n in inputs], outputs=[F])
    u = block.u
    if name == "hand":
        force = -300.0 * u["x"] - 5.0 * u["v"]
    else:
        force = K * (u["x_l"] - u["x"]) + B * (u["v_l"] - u["v"])
    return block.component(name, name, "sampled", initial={}, step={}, output={"F": force})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("two-port")


def judged(folder: Path, rate: int) -> Passivity:
    """The passivity of device and coupling with the mechanism at a rate (Hz)."""
    parts = [sampled("hand", ("x", "v")), sampled("coupling", ("x", "v", "x_l", "v_l"))]
    fmus = tuple(
        Fmu(c.name, describe(build(c, folder)), "graphics" if c.name == "mechanism" else "haptics")
        for c in (*parts, device(), mechanism())
    )
    timeline = fixed(Fraction(512), Fraction(rate), 512)
    rows = [(f"device.{s}", f"{to}.{s}") for s in "xv" for to in ("hand", "coupling")]
    rows += [("mechanism.x", "coupling.x_l"), ("mechanism.v", "coupling.v_l")]
    rows += [("coupling.F", "device.F"), ("coupling.F", "mechanism.F"), ("hand.F", "device.F_h")]
    made = System(fmus, connected(fmus, rows, timeline)[0], timeline, Coupling("gauss-seidel"))
    place = SignalVector(made).scalar
    hand = HandPort(
        "hand", "device", ("F_h",), (place("hand", "F"),),
        (place("device", "x"),), (place("device", "v"),), 1,
    )  # fmt: skip
    port = MechanismPort(
        "mechanism", ((("F", -1.0),),), (place("mechanism", "x"),), (place("mechanism", "v"),)
    )
    with open_lifted_map(made) as map_:
        return passivity.of("two masses", equilibrium(map_, map_.start), hand, port, T)


DECAY = np.exp(-DAMPING * T / MASS)
LAG = MASS / DAMPING * (1 - DECAY)
DEVICE = (
    Polynomial([-DECAY, 1.0]) * DAMPING * T,
    Polynomial([LAG - T * DECAY, T - LAG]),
)
"""z - e and its denominator: the device's force by its mean velocity over a held step."""
COUPLING = Polynomial([-B, K * T + B]), Polynomial([0.0, -1.0, 1.0])
"""K T/(z - 1) + B/z: of positions, and velocities that are means over the step before."""


def impedance(z: complex) -> Complex:
    Z_d, C = (up(z) / down(z) for up, down in (DEVICE, COUPLING))
    return np.array([[Z_d + C, -C], [-C, C]])


def test_at_one_rate_it_takes_the_damping_of_the_closed_form(folder: Path) -> None:
    """z_11 = Z_d + C, z_12 = z_21 = -C, z_22 = C: Llewellyn's condition with b added to z_11 and
    z_22 is (Re Z_d + c + b)(c + b) >= c^2, c = Re C."""
    found = judged(folder, 512).two_port
    assert found is not None
    assert found.needed == found.at_least == max(b for _, b in found.curve)
    for hertz, b in found.curve:
        z = np.exp(2j * np.pi * hertz * T)
        Z = impedance(z)
        R, c = (Z[0, 0] - Z[1, 1]).real, Z[1, 1].real
        assert b == pytest.approx(-c - R / 2 + np.hypot(R / 2, c), rel=1e-4, abs=1e-4)
    assert found.mechanism == pytest.approx(K * T / 2 + B, rel=1e-4)
    assert found.verdict == "not absolutely stable"


def test_a_sharp_resonance_is_not_missed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hardly damped mechanism of 0.5 kg and 50 N/m on a spring of 3000 N/m resonates with 0.01 Hz
    of half width; beside it the hand's port lacks 108 N.s/m, and the best of 64 frequencies that
    know nothing of it finds 25. Against the closed form at a million frequencies: v is the device's
    velocity, by its mean over the step."""
    stiff, damper = 3000.0, 0.02
    monkeypatch.setitem(globals(), "K", stiff)
    monkeypatch.setitem(globals(), "B", damper)
    z = np.exp(1j * np.linspace(1e-4, np.pi - 1e-4, 1_000_000))
    by_force = (1 - DECAY) / DAMPING / (z - DECAY)
    v = by_force / ((LAG * by_force + (T - LAG) / DAMPING) / T)
    spring, mech = stiff * T / (z - 1), 0.5 * (1 - 1 / z) / T + 50.0 * T / (z - 1)
    felt = (spring + damper * v) / (1 + (spring + damper / z) / mech)
    found = judged(folder, 512)
    worst = int(np.argmin(felt.real))
    assert found.needed == pytest.approx(-felt.real[worst], rel=1e-3)
    assert found.frequency == pytest.approx(np.angle(z[worst]) / (2 * np.pi * T), abs=0.02)


def closed(hand: tuple[float, ...], mechanism: tuple[float, ...], b: float) -> float:
    """The spectral radius of the rendering with dampers b at its ports and (m, b, k) at each: roots
    of (Z_d + C + Z_h)(C + Z_m) - C^2, without the factor z - 1 that all of it has."""
    low, high = Polynomial([-1.0, 1.0]), Polynomial([1.0, 1.0])

    def ending(m: float, damping: float, k: float) -> Polynomial:
        return 2 * m / T * low**2 + (damping + b) * low * high + k * T / 2 * high**2

    (a, a_), c, h, e = DEVICE, COUPLING[0], ending(*hand), ending(*mechanism)
    one = a * low * high + h * a_
    whole = Polynomial([0.0, 1.0]) * one * e + c * high * (one + e * a_)
    return float(np.abs(whole.roots()).max())


def test_no_passive_ends_are_unstable_with_the_damping_and_some_are_with_less(folder: Path) -> None:
    found = judged(folder, 512).two_port
    assert found is not None
    generator = np.random.Generator(np.random.PCG64(3))
    draws = 10 ** generator.uniform([-6, -4, -2] * 2, [1, 2, 5] * 2, size=(2000, 6))
    b = found.needed * (1 + 1e-3)
    assert max(closed(tuple(d[:3]), tuple(d[3:]), b) for d in draws) < 1 + 1e-5
    for share in (0.5, 0.95):
        less = share * found.needed
        z = np.exp(2j * np.pi * found.frequency * T)
        assert closed(*worst(impedance(z), less, found.frequency), less) > 1 + 1e-5


def worst(Z: Complex, b: float, hertz: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Passive ends (m, b, k) that oscillate with Z + b I at a frequency, with half the damping
    that they could have."""
    _, s = damping_shortage_of_two(Z, 1)
    D = np.diag([np.exp(s), 1.0])
    Z = Z + b * np.eye(2)
    scaled = D @ Z @ np.linalg.inv(D)
    v = np.linalg.solve(D, np.linalg.eigh((scaled + scaled.conj().T) / 2)[1][:, 0])
    half = np.tan(np.pi * hertz * T)
    ends = []
    for needed in -(Z @ v) / v:
        assert needed.real > 0
        m = max(needed.imag, 0.0) * T / 2 / half
        k = max(-needed.imag, 0.0) * 2 / T * half
        ends.append((m, needed.real / 2, k))
    return ends[0], ends[1]


def test_the_impedance_display_of_adams_and_hannaford() -> None:
    """Re(1/Z_c) >= (1 - cos(arg ZOH)) |ZOH|/(2 b), Z_c = b_c + k_c T z/(z - 1), ZOH = (1 + 1/z)/2:
    their condition on a virtual coupling, with m = .1 and b = .5."""
    m, b = 0.1, 0.5
    verdicts = []
    for k_c in (100.0, 300.0, 1000.0):
        for b_c in np.geomspace(0.1, 100.0, 13):
            for angle in np.linspace(0.05, 3.1, 40):
                z = np.exp(1j * angle)
                Z_d = m * 2 / T * (z - 1) / (z + 1) + b
                Z_c, hold = b_c + k_c * T * z / (z - 1), (1 + 1 / z) / 2
                limit = (1 - np.cos(np.angle(hold))) * np.abs(hold) / (2 * b)
                Z = np.array([[Z_d + hold * Z_c, hold * Z_c], [Z_c, Z_c]])
                margin = (1 / Z_c).real / limit - 1
                if abs(margin) > 1e-3:
                    verdicts.append((margin > 0, damping_shortage_of_two(Z, 1)[0] < 0))
    assert len(set(verdicts)) == 2  # both occur, and both always agree
    assert all(theirs == ours for theirs, ours in verdicts)


def test_with_several_directions_the_damping_is_necessary_and_sufficient() -> None:
    """Random impedances of 3 + 3: with b, some scale makes it passive; with less, the extreme
    vectors of both forms span a flow that passive ends keep up."""
    generator = np.random.Generator(np.random.PCG64(5))
    for _ in range(20):
        Z = generator.normal(size=(6, 6)) + 1j * generator.normal(size=(6, 6))
        b, s = damping_shortage_of_two(Z, 3)
        D = np.diag(np.repeat([np.exp(s), 1.0], 3))
        assert least(D @ Z @ np.linalg.inv(D) + b * np.eye(6)) == pytest.approx(0.0, abs=1e-6)
        assert least(Z) >= b - 1e-9
        below = Z + (b - 0.05) * np.eye(6)
        assert flow(below) is not None
        assert flow(Z + (b + 0.05) * np.eye(6)) is None
        assert damping_shortage(Z, [3, 3]) == pytest.approx(b, abs=0.05 * abs(b))


def flow(Z: Complex) -> Complex | None:
    """A flow v with Re v_i*(Z v)_i < 0 in both blocks: the extreme vectors of combinations of both
    forms trace the boundary of their range; None where it does not meet the quadrant."""
    forms = []
    for i in (slice(0, 3), slice(3, 6)):
        part = np.zeros_like(Z)
        part[i] = Z[i]
        forms.append((part + part.conj().T) / 2)
    for share in np.linspace(1e-4, 1 - 1e-4, 4001):
        combined = share * forms[0] + (1 - share) * forms[1]
        values, vectors = np.linalg.eigh(combined)
        if values[0] >= 0.0:
            return None
        v = vectors[:, 0]
        if all((v.conj() @ H @ v).real < 0 for H in forms):
            return np.asarray(v)
    return None


@pytest.mark.parametrize("rate", [64, 128])
def test_across_rates_both_bounds_enclose(folder: Path, rate: int) -> None:
    found = judged(folder, rate).two_port
    assert found is not None
    assert found.held
    assert 0 < found.at_least <= found.needed
    assert found.mechanism >= K / rate / 2  # a pose held over a frame
