"""The passivity observer and controller: walls far beyond the closed form, and runs that need
none."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares

import hapticlink as hl
from hapticlink.analysis.stability import wall_limits
from hapticlink.analysis.stability.smooth_scene import linearisable
from hapticlink.components.blocks.controller import controller
from hapticlink.components.device.motors_and_encoders import count_energies
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.control import Controller, PassivityLaw
from tests.analysis.stability.own_hand import own_hand
from tests.blocks import Running
from tests.devices import device as twin
from tests.reference.twin_pantograph import NUMBERS, base_angles, dynamics
from tests.shared_fixtures import run_once

MASS, T = 0.3, 1 / 512
M = np.diag([0.3, 0.3, 3e-4])
ARM = {
    "type": "spring",
    "stiffness": [300.0, 0.0, 0.0],
    "damping": [5.0, 0.0, 0.0],
    "target": [[0.0, 0.004, 0.0, 0.0]],
}
TWO_SIDED = {"impedance": False, "teleoperation": False, "topology": False}


def pressed(options: dict[str, Any], guard: float | None = MASS) -> tuple[hl.Run, np.ndarray]:
    """A run of a wall, and the work (J) of its force on the handle at each sample."""
    own = {"duration": 4.0} | ({"fmu.wall.settings.passivity": guard} if guard else {})
    run = run_once("virtual-wall", own | options)
    assert run.fault is None
    x, F = run["virtual_mechanism.x"][:, 0], np.ravel(run["wall.F"])
    return run, np.concatenate([[0.0], np.cumsum(F[:-1] * np.diff(x))])


@pytest.mark.parametrize(
    ("hand", "damping", "seed"),
    [("constant", 0.0, 0), ("constant", 5.0, 1), ("arm", 0.0, 2), ("arm", 5.0, 3)],
)
def test_a_wall_beyond_its_limit_generates_at_most_the_handles_kinetic_energy(hand, damping, seed):
    draw = np.random.default_rng(seed)
    K = 5200.0 * 10 ** draw.uniform(0.05, 1.2)
    assert wall_limits.stable(MASS, 5.0, T) < K
    options = {"fmu.wall.settings.stiffness": K, "linkage.joint.rail.damping": damping}
    options["linkage.start.rail"] = -draw.uniform(0.001, 0.02)
    wrench = [draw.uniform(0.5, 8.0), 0.0, 0.0]
    options |= {"hand": ARM} if hand == "arm" else {"hand.wrench": wrench}
    run, work = pressed(options)
    speed = np.abs(run["virtual_mechanism.v"][:, 0]).max()
    assert work.max() <= 0.5 * MASS * speed**2
    left = np.ravel(run["wall.passivity_energy_left"])
    assert left == pytest.approx(-work, rel=1e-9, abs=1e-12)  # the observer is the work itself
    assert np.ravel(run["wall.passivity_damping"]).max() <= 0.5 / T * (1 + 1e-12)
    _, without = pressed(options, guard=None)
    assert without.max() > 2 * work.max()


def test_the_handle_comes_to_rest_at_ten_times_the_limit():
    options = {"fmu.wall.settings.stiffness": 50000.0, "duration": 6.0}
    for guard, apart in ((MASS, 1e-5), (None, 5e-3)):
        run, _ = pressed(options, guard)
        late = np.ptp(run["virtual_mechanism.x"][-512:, 0])
        assert late < apart if guard else late > apart


def test_where_it_never_acts_the_bits_are_those_without():
    short = {"duration": 1.0}
    plain = run_once("closed-loop-ideal", short)
    guarded = run_once("closed-loop-ideal", short | {"controller.passivity": True})
    assert not np.any(guarded["controller.passivity_damping"])
    for signal in ("haptic_device.x_true", "controller.F_motor", "virtual_mechanism.q"):
        assert np.array_equal(plain[signal], guarded[signal])


def test_a_coupling_beyond_its_limit_gives_the_handle_little():
    """60,000 N/m between mechanism and handle chatter; the motors give 7.9 mJ without."""
    stiff = {
        "controller.teleoperation.stiffness": [2e4, 2e4, 100.0],
        "controller.topology": False,
    }
    given = {}
    for guard in (False, True):
        run = hl.run("closed-loop-ideal", stiff | {"controller.passivity": guard}, figures=False)
        x, F = run["haptic_device.x_true"], run["controller.F_motor"]
        given[guard] = np.cumsum((F[:-1] * np.diff(x, axis=0)).sum(axis=1)).max()
    assert given[True] < 0.1 * given[False]


def test_the_lifted_map_is_that_of_the_loop_without_it():
    given = {"fmu.wall.settings.passivity": MASS}
    without, with_it = (own_hand("virtual-wall", options) for options in ({}, given))
    assert with_it.growth == pytest.approx(without.growth, rel=1e-6)
    with linearisable("virtual-wall", given) as (_, _, removed):
        assert any("passivity controller, taken out" in line for line in removed)


def block(**spec: Any) -> Running:
    """A controller that holds a spring of 1000 N/m, with the passivity controller `spec`."""
    law = Controller(**TWO_SIDED, stiffness=(1000.0, 1000.0, 5.0), passivity=PassivityLaw(**spec))
    return Running(controller(law, PLANE, 0.04), {"M": M}, {"step_size": T})


def sampled(run: Running, x: list[float]) -> tuple[np.ndarray, float, float]:
    """F_motor, the energy left and the damping at the pose x, after which a period passes."""
    run.set(x_D=x)
    y = run.y
    run.step(T)
    return y["F_motor"], y["passivity_energy_left"], y["passivity_damping"]


def test_the_equations():
    run = block(energy=1e-4, limit=1.5, noise=1e-12)
    x = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.01], [2e-4, 5e-4, 0.0], [1e-4, 4e-4, 0.0]])
    K, E, before, held = np.array([1000.0, 1000.0, 5.0]), 1e-4, x[0], np.zeros(3)
    acted = 0
    for pose in x:
        moved = pose - before
        E -= held @ moved
        twice = moved @ M @ moved / T**2
        beta = min(-E / twice, 1.5) if E < 0 and twice > 2e-12 else 0.0
        acted += beta > 0
        held, before = -K * pose - beta / T * M @ moved / T, pose
        F, left, damping = sampled(run, [*pose])
        np.testing.assert_allclose(F, held, rtol=1e-12)
        assert (left, damping) == pytest.approx((E, beta / T), rel=1e-9, abs=1e-15)
    assert acted


def test_a_free_handle_forgets_what_was_absorbed_and_keeps_a_deficit():
    run = block(reset_after=2 * T)
    sampled(run, [1e-3, 0.0, 0.0])
    _, absorbed, _ = sampled(run, [2e-3, 0.0, 0.0])
    assert absorbed > 0
    for _ in range(3):
        _, left, _ = sampled(run, [0.0, 0.0, 0.0])
    assert left <= 0.0
    forgotten = block(reset_after=2 * T, energy=1.0)
    for _ in range(4):
        _, left, _ = sampled(forgotten, [0.0, 0.0, 0.0])
    assert left == 1.0


def warned(scene: str, options: dict[str, Any], why: str) -> list[str]:
    """The warnings of a short run that contain `why`."""
    run = run_once(scene, {"duration": 0.1} | options)
    return [line for line in run.run["warnings"] if line.startswith("warning") and why in line]


LATE = "passivity controller"


@pytest.mark.parametrize(
    ("scene", "guarded", "late", "connection"),
    [
        ("closed-loop-ideal", "controller.passivity", {"coupling": "jacobi"},
         "controller.F_motor -> haptic_device.F_motor"),
        ("closed-loop-ideal", "controller.passivity", {"delays.controller.x_D": 0.002},
         "haptic_device.x -> controller.x_D"),
        *(("virtual-wall", "fmu.wall.settings.passivity", {f"delays.'{end}'": link}, end)
          for end in ("wall.F", "wall.x") for link in (T, {"loss": 0.2})),
    ],
)  # fmt: skip
def test_a_run_warns_where_force_or_pose_of_what_is_guarded_is_late(
    scene, guarded, late, connection
):
    on = {guarded: True if scene == "closed-loop-ideal" else MASS}
    assert not warned(scene, on, LATE)
    (line,) = warned(scene, on | late, LATE)
    assert connection in line
    assert not warned(scene, late, LATE)


def test_of_a_further_users_controller_it_warns_by_its_own_settings():
    late, both = {"coupling": "jacobi"}, {"coupling": "jacobi", "controller.passivity": True}
    left = "warning: controller_left.F_motor -> haptic_device_left.F_motor"
    (line,) = warned("two-users", late | {"controllers.left.passivity": True}, LATE)
    assert line.startswith(left)
    assert len(warned("two-users", both, LATE)) == 2
    (line,) = warned("two-users", both | {"controllers.left.passivity": False}, LATE)
    assert not line.startswith(left)


def test_it_warns_of_motors_at_their_limit():
    """The controller counts what it asked for: 0 J here, where the motors gave more."""
    weak = {
        "controller.passivity": True,
        "controller.stiffness": [3000.0, 3000.0, 3.0],
        "device.motor.torque_limit": 0.02,
        "hand.wrench": [1.0, 0.0, 0.0],
        "stop_when": "",
    }
    (line,) = warned("closed-loop-ideal", weak, "passivity controller counts forces")
    assert "motors of controller were at their limit" in line
    assert not warned("closed-loop-ideal", weak | {"controller.passivity": False}, "passivity")


@pytest.mark.parametrize("rate", [10, 30])
def test_a_run_warns_where_steps_outside_the_premises_matter(rate):
    """`passive` generates more than the hand puts in at 10 Hz, and next to nothing at 30."""
    options = {"hold": "passive", "graphics.rate": rate}
    run = hl.run("closed-loop-direct", options, figures=False).record
    (name,) = (n for n in run.premises if n.startswith("controller.F_drift"))
    counted, said = run.premises[name], f"warning: passive of {name} generated"
    assert any(line.startswith(said) for line in run.warnings or ()) == (rate == 10)
    assert counted.at_stake > run.across[name].peak
    assert (counted.outside > 0.2 * counted.steps) == (rate == 10)


def test_it_warns_where_it_damps_counts_of_the_encoders():
    """The motors give the true handle nothing, and yet it acts, until `noise` is what the warning
    says: the energy of one count."""
    encoders = {"sensing": "encoders", "duration": 1.0, "controller.passivity": True}
    why = "damps counts"
    (line,) = warned("closed-loop-ideal", encoders, why)
    noise = float(line.rpartition("=")[2])
    assert not warned(
        "closed-loop-ideal", encoders | {"controller.passivity": {"noise": noise}}, why
    )
    assert not warned("closed-loop-ideal", encoders | {"sensing": "ideal"}, why)
    enough = encoders | {"controller.passivity": {"energy": 1.0}}
    assert not warned("closed-loop-ideal", enough, why)  # where it never acts


def test_the_energy_of_a_count_is_that_of_the_pose_that_fits_it():
    device, pose = twin(), np.array([0.03, 0.02, 0.4])
    angles = ca.Function("q", [x := ca.SX.sym("x", 3)], [base_angles(x, NUMBERS)])
    inertia = ca.Function("M", [x], [dynamics(x, ca.SX(3, 1), NUMBERS)[0]])
    start = np.asarray(angles(pose)).ravel()
    for i, found in enumerate(count_energies(device, pose, T)):
        # a thousandth of a count, so that the fit is linear
        small = device.encoders[0].resolution * 1e-3
        wanted = start + small * np.eye(4)[i]
        fit = least_squares(lambda p: np.asarray(angles(p)).ravel() - wanted, pose, xtol=1e-15)  # noqa: B023
        v = (fit.x - pose) / 1e-3 / T
        assert found == pytest.approx(v @ np.asarray(inertia(pose)) @ v / 2, rel=1e-3)
