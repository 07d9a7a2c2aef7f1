"""The passivity controller of Hannaford and Ryu on a virtual wall, through FMUs: rows that were
computed independently, by 40 semi-implicit steps in each period of 1 ms."""

import math

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.component import Block, Component, Variable
from hapticlink.fmus.build_fmu import build
from tests.orchestrator.foreign_scenes import fmu_table, wire_table

T, QUANTUM = 1e-3, 2 * math.pi * 0.010 / 1024

SCENE = (
    """title = "A hand pushes on a wall"
duration = 1.5
haptics.rate = 1000
hold = "zoh"
mechanism = {{ integrator = "semi-implicit-euler", substeps = 40 }}

[linkage]
operational_point.body = "handle"
start.rail = 0.029
body = [{{ name = "handle", mass = 0.04, inertia = 1.0 }}]

[[linkage.joint]]
name = "rail"
type = "prismatic"
axis = 0.0
child = "handle"
damping = 0.8
stiffness = 400.0
rest = 0.033
ports = ["effort", "position"]

[[fmu]]
name = "wall"
block = "virtual_wall"
rate = {rate}
settings = {{ stiffness = {stiffness}, position = 0.030, quantum = {quantum} }}
"""
    + fmu_table("passivity", "passivity_controller", "start.max_damping = {damping}\n")
    + wire_table("virtual_mechanism.rail.position", "wall.x")
    + wire_table("virtual_mechanism.rail.position", "passivity.x")
    + wire_table("wall.F", "passivity.F")
    + wire_table("passivity.f", "virtual_mechanism.rail.effort")
)


def passivity_controller() -> Component:
    """Hannaford, Ryu, IEEE Trans. Robotics and Automation 18 (2002), 1, in series, with the force
    that was held: F and f within 2 N, alpha at most `max_damping`.

        G_k = G_{k-1} + f_{k-1} (x_k - x_{k-1}),   f_k = F_k - alpha v_k
        alpha = G_k/(T v_k^2) where G_k > 0,   v_k = (x_k - x_{k-1})/T
    """
    energy = Variable("energy", (), "J")
    block = Block(
        inputs=[Variable("x", (), "m"), Variable("F", (), "N")],
        parameters=[Variable("max_damping", (), "N.s/m")],
        states=[energy, Variable("x_last", (), "m"), Variable("f_last", (), "N")],
        outputs=[Variable("f", (), "N"), energy],
    )
    u, before = block.u, block.x
    x = QUANTUM * ca.floor(u["x"] / QUANTUM)

    def kept(force: ca.SX) -> ca.SX:
        return ca.fmax(ca.fmin(force, 2.0), -2.0)

    moved = x - before["x_last"]
    generated = before["energy"] + before["f_last"] * moved
    v = moved / T
    moving = ca.logic_and(generated > 0.0, moved != 0.0)
    ideal = generated / (T * ca.if_else(moving, v * v, 1.0))
    alpha = ca.if_else(moving, ca.fmin(ideal, block.p["max_damping"]), 0.0)
    f = kept(kept(u["F"]) - alpha * v)
    return block.component(
        "passivity_controller",
        "a passivity observer and controller",
        "sampled",
        initial={"energy": ca.SX(0.0), "x_last": x, "f_last": ca.SX(0.0)},
        step={"energy": generated, "x_last": x, "f_last": f},
        output={"f": f, "energy": generated},
    )


@pytest.mark.parametrize(
    ("stiffness", "every", "damping", "expected"),
    [
        (400.0, 1, 0.0, (33.53, 0.001, -0.32)),
        (2500.0, 1, 0.0, (31.79, 1.658, -17.6)),
        (2500.0, 1, 0.8, (31.79, 0.080, -1.81)),
        (400.0, 5, 0.0, (34.07, 5.277, -69.67)),
        (400.0, 5, 0.8, (33.90, 0.001, -1.44)),
    ],
)
def test_peak_swing_and_energy(tmp_path, stiffness, every, damping, expected):
    """Peak and peak to peak of the last 0.5 s (mm), energy absorbed (mJ): negative where the wall
    generates it."""
    path = tmp_path / "pushed.toml"
    settings = {"stiffness": stiffness, "rate": 1000 // every, "damping": damping}
    path.write_text(SCENE.format(**settings, quantum=repr(QUANTUM)))
    build(passivity_controller(), tmp_path)
    run = hl.run(path)
    x = run["virtual_mechanism.rail.position"] * 1e3
    energy = -run["passivity.energy"] * 1e3  # of the 1500 forces from 0 to 1.499 s
    assert x.max() == pytest.approx(expected[0], abs=0.006)
    assert np.ptp(x[-500:]) == pytest.approx(expected[1], abs=0.0006)
    assert energy[1499] == pytest.approx(expected[2], abs=0.006 if abs(expected[2]) < 10 else 0.06)
