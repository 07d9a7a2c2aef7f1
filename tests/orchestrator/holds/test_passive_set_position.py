"""Passive set-position modulation: a spring whose far end is held gives no more than it got."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import hapticlink as hl
from hapticlink.analysis.findings.tracking import tracking
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.hold_parts import describe_holds, describe_spring
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.build_system import build_system
from tests.little_fmus import slave
from tests.orchestrator.foreign_scenes import fmu_table, ran, run, wire_table
from tests.orchestrator.holds.bench import Bench

Vector = NDArray[np.float64]
TICK = 1e-3


def held(
    stiffness: Vector, damping: Vector, longest: int
) -> tuple[Vector, CompiledHold, CompiledHold]:
    """The position of the near end, and the holds of set position and set velocity."""
    n = len(stiffness)
    bench = Bench(n, Fraction(1, 1000))
    tank = bench.tank(stiffness, damping, range(n), period=longest * TICK)
    first, second = (bench.hold("pspm", n, tank, row=row) for row in (0, 1))
    return bench.values, first, second


@settings(max_examples=150)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans(), st.integers(1, 4))
def test_nothing_is_created_at_any_instant_on_any_motion_from_any_samples(
    seed, damped, moving, longest
):
    """Random springs, samples at random ticks, steps of random length, motion straight or not
    within them: the work of F = K (y - x) + B (w - v), in closed form on each straight piece, never
    exceeds what the spring held at the start less what it holds now."""
    generator = np.random.default_rng(seed)
    n = 3
    stiffness = 10 ** generator.uniform(-1, 3, n)
    damping = 10 ** generator.uniform(-4, 1, n) * damped
    near, *holds = held(stiffness, damping, longest)
    x = near[:] = generator.normal(size=n)

    def stored(at):
        return float(stiffness @ (y - at) ** 2) / 2

    work, scale = 0.0, 0.0
    tick, due = 0, 0
    sample, rate = generator.normal(size=n), generator.normal(size=n) * moving
    for k in range(60):
        if tick >= due:
            if k:
                sample, rate = generator.normal(size=n), 10 * generator.normal(size=n) * moving
            holds[0].push(tick, sample, tick)
            holds[1].push(tick, rate, tick)
            due = tick + generator.integers(1, 8)
        y, w = (hold.value(tick).copy() for hold in holds)
        if k == 0:
            begin = float(stiffness @ (sample - x) ** 2) / 2
            assert moving or np.array_equal(y, sample)
        step = int(generator.integers(1, longest + 1))
        pieces = int(generator.integers(1, 4))
        parts = generator.dirichlet(np.ones(pieces)) * step * TICK
        for seconds in parts:
            moved = generator.normal(size=n) * 10 ** generator.uniform(-3, -1)
            if moving and generator.random() < 0.9:  # pulled along: what a set velocity costs most
                moved = w * seconds * generator.uniform(0.0, 1.0)
            at = x + moved
            work += stored(x) - stored(at) + float(damping @ (w * moved - moved**2 / seconds))
            x = near[:] = at
            scale = max(scale, abs(work), stored(x))
            assert work <= begin - stored(x) + 1e-12 * scale
        tick += step


def test_a_sample_that_costs_no_more_than_there_is_passes_unchanged():
    x, position, velocity = held(np.array([100.0]), np.array([20.0]), 1)
    position.push(0, np.array([0.1]), 0)  # 0.5 J to begin with
    velocity.push(0, np.array([0.0]), 0)
    assert position.value(0) == 0.1
    x[:] = 0.02  # towards it: the spring gives 0.18 J, the damper takes 8 J
    position.push(1, np.array([0.12]), 1)
    velocity.push(1, np.array([0.5]), 1)
    assert (position.value(1), velocity.value(1)) == (0.12, 0.5)
    position.push(2, np.array([1.02]), 2)  # 50 J are needed: 0.5 - 0.18 + 8 J are there
    velocity.push(2, np.array([0.0]), 2)
    assert position.value(2) == pytest.approx(0.02 + np.sqrt(8.32 / 50.0), rel=1e-12)


def test_a_set_position_that_pumps_a_mass_pumps_nothing():
    """y steps with the sign of the mass's velocity: at resonance, without damping, each swing adds
    to the last. 1 kg on 100 N/m, solved exactly in each step."""

    def swing(name):
        bench = Bench(1, Fraction(1, 1000))
        x, v, y = bench.values, 0.0, np.zeros(1)
        x[:] = 0.05
        hold = bench.hold(name, 1, bench.tank(np.array([100.0]), np.zeros(1), [0]))
        cos, sin, largest = np.cos(10 * TICK), np.sin(10 * TICK), 0.0
        for tick in range(10000):
            if tick % 20 == 0:
                hold.push(tick, np.array([0.02 * np.sign(v)]), tick)
            y = hold.value(tick).copy()
            e = x - y
            x[:] = y + e * cos + v / 10 * sin
            v = float((v * cos - e * 10 * sin)[0])
            largest = max(largest, 0.5 * v * v + 50.0 * float((x - y)[0]) ** 2)
        return largest

    start = 0.5 * 100.0 * 0.05**2
    assert swing("zoh") > 50 * start
    assert swing("pspm") <= start * (1 + 1e-9)


K, B = np.array([100.0, 100.0, 0.1]), np.array([20.0, 20.0, 0.02])
"""Gains of closed-loop-direct."""


@pytest.mark.parametrize(("rate", "sensing"), [(10, "ideal"), (30, "ideal"), (30, "encoders")])
def test_the_controllers_spring_creates_one_steps_surplus_at_most(tmp_path, rate, sensing):
    """F_drift on the handle, from the run's own signals. Sampling F makes 1/2 K dx^2 + B (dx/T - v)
    dx a step: the sum of these is large, and the hold lets through one of them. The work on the
    true handle differs by the force's changes times the encoders' error."""
    sets = ("virtual_mechanism.x -> controller.x_S", "virtual_mechanism.v -> controller.v_S")
    made, steps, true = {}, {}, {}
    for hold in ("zoh", "pspm"):
        options = [f"hold={hold}", f"graphics.rate={rate}", "controller.bias=none"]
        options += [f"sensing={sensing}"]
        found = simulate("closed-loop-direct", tmp_path / hold, options).results
        assert [found.run["holds"][name] for name in sets] == [hold, hold]
        force = found.haptics["controller.F_drift"]
        x, v, handle = (found.haptics[f"haptic_device.{n}"] for n in ("x", "v", "x_true"))
        dx = np.diff(x, axis=0)
        surplus = ((K / 2 * dx + B * (dx * 512.0 - v[:-1])) * dx).sum(axis=1)
        steps[hold] = surplus
        made[hold] = float((force[:-1] * dx).sum(axis=1).cumsum().max())
        work = (force[:-1] * np.diff(handle, axis=0)).sum(axis=1).cumsum()
        error = np.abs(handle - x)
        bound = (np.abs(np.diff(force, axis=0)) * error[1:]).sum(axis=1).cumsum()
        bound += (np.abs(force[1:]) * error[1:]).sum(axis=1) + np.abs(force[0]) @ error[0]
        true[hold] = float((work - bound).max())
    assert made["zoh"] > 1e-3
    assert made["pspm"] <= steps["pspm"].max() + 1e-12
    assert true["pspm"] <= steps["pspm"].max() + 1e-12


@pytest.mark.parametrize("rate", [30, 60])
def test_both_sides_share_what_either_puts_in(tmp_path, rate):
    """A mechanism that starts at speed pulls the handle along: the coupling gives both together no
    more than it got, at every sample, and the handle follows. The work on the mechanism is the
    energy that it gained, which no meter of the run tells."""
    options = ["hold=passive", f"graphics.rate={rate}", "controller.bias=full"]
    options += ["hand.wrench=[0.0, 0.0, 0.0]", "linkage.start_velocity.shoulder1=4.0"]
    options += [f"holds.controller.{end}=pspm" for end in ("x_S", "v_S")]
    found = simulate("closed-loop-direct", tmp_path, options).results
    force, x = (found.haptics[n] for n in ("controller.F_drift", "haptic_device.x_true"))
    near = np.concatenate([[0.0], (force[:-1] * np.diff(x, axis=0)).sum(axis=1).cumsum()])
    frames = found.graphics["time"]
    energy = found.graphics["virtual_mechanism.energy"]
    net = np.interp(frames, found.haptics["time"], near) + energy - energy[0]
    assert net.max() <= 1e-9
    assert tracking(found)[1].max() < 5.0


def test_a_near_end_that_is_an_angle_is_known_as_one():
    """Its tank unwraps what it reads (tests of the tank have what becomes of it)."""
    options = ["hold=pspm", "kinds.haptic_device.x=angle"]
    with build_system(open_scene.load("closed-loop-direct", options)) as system:
        signals = SignalVector(system)
        (of,) = {parts.spring for parts in describe_holds(signals).values() if parts.spring}
        spring = describe_spring(of, signals)
    np.testing.assert_allclose(spring.turns, [0.0, 0.0, 2 * np.pi])


SHARED = {"hold": "pspm", "holds.controller.F_drift": "passive", "duration": 0.2}
MOTORS = "warning: controller.F_motor -> haptic_device.F_motor acts"
ALONE = "pspm of controller does not count controller.F_drift -> virtual_mechanism.F_drift"


@pytest.mark.parametrize(
    ("link", "told"),
    [
        ({}, None),
        ({"coupling": "jacobi"}, MOTORS),
        ({"delays.controller.F_motor": 0.004}, MOTORS),
        ({"delays.controller.F_motor": {"loss": 0.3}}, MOTORS),
        ({"delays.controller.F_drift": 0.004}, ALONE),
    ],
)
def test_a_run_tells_where_a_force_of_the_coupling_is_late(link, told):
    """Its energy is counted over the motion since its sample, or not at all."""
    run = hl.run("closed-loop-direct", SHARED | {"graphics.rate": 32} | link, figures=False)
    found = [line for line in run.run["warnings"] if line.startswith((MOTORS, ALONE))]
    assert len(found) == (told is not None)
    assert not told or found[0].startswith(told)


def test_a_latency_of_nothing_changes_nothing():
    """The energy tank keeps both sides of the coupling."""
    moving = {"hand.wrench": [0.0, 0.0, 0.0], "linkage.start_velocity.shoulder1": 4.0}
    x, none = (
        hl.run("closed-loop-direct", SHARED | moving | late, figures=False)["haptic_device.x"]
        for late in ({}, {"delays.controller.F_drift": 0.0, "delays.controller.x_S.max": 0.0})
    )
    assert np.ptp(x) > 1e-3
    assert np.array_equal(x, none)


def moving(folder: Path, **rates: float) -> None:
    """FMUs whose outputs y = sin(rate t) go their own way; `seen` is the input of the last step."""
    for name, rate in rates.items():
        outputs = {"y": 0.0, "seen": 0.0}
        body = f"values['y'], values['seen'] = sin({rate} * end), values['u']"
        slave(folder, name, ("input", {"u": 0.0}), ("output", outputs), body=body)


SPRING = (
    fmu_table("far", "Far", "rate = 20\n")
    + fmu_table("near", "Near")
    + wire_table("far.y", "near.u")
    + '[[spring]]\nset_position = "near.u"\nposition = "near.{}"\nstiffness = [{}]\n'
)


def test_a_spring_of_another_fmu_is_kept_in_check(tmp_path):
    """Its near end goes its own way, as an output of the FMU that holds the spring."""
    moving(tmp_path, Far=9.0, Near=5.0)
    made = {}
    for hold in ("zoh", "pspm"):
        near = ran(tmp_path, SPRING.format("y", 100.0), f"hold={hold}", "duration=2.0").haptics
        x, y = near["near.y"], near["near.seen"][1:]
        work = np.cumsum(50.0 * ((y - x[:-1]) ** 2 - (y - x[1:]) ** 2))
        made[hold] = float(np.max(work + 50.0 * (y - x[1:]) ** 2))
    assert made["zoh"] > 10.0
    assert made["pspm"] <= 1e-12


@pytest.mark.parametrize(
    ("position", "stiffness", "why"),
    [
        ("nothing", "100.0", "there is no input or output near.nothing"),
        ("y", "100.0, 1.0", "2 gains for the 1 of near.u"),
        ("y", "-1.0", "out of range: give a number >= 0"),
    ],
)
def test_a_spring_that_is_not_there_is_told(tmp_path, position, stiffness, why):
    moving(tmp_path, Far=1.0, Near=1.0)
    with pytest.raises(SceneFault, match=why):
        run(tmp_path, SPRING.format(position, stiffness), "hold=zoh")
