"""The N-four-bar through its singular poses against its closed form.

IFToMM library of computational benchmark problems, A02: all rods stay parallel, so the mechanism is
one pendulum. With a = g ((N+1)/2 + N) / ((N+1)/3 + N), phi from the top and phi'(0) = 1 rad/s,

    phi'^2 = 1 + 2 a (1 - cos phi),   t = 2 F(phi/2 | m = -4a)

The pose is singular each time that the rods line up (N = 2: ten times in 10 s).
"""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipkinc

from hapticlink.orchestrator import open_scene
from tests.blocks import Running, advance, virtual_mechanism
from tests.shared_fixtures import sets, status

G = 9.81


def exact_tip(n, t):
    """B0 at t."""
    a = G * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    turn = 2 * ellipkinc(math.pi, -4 * a)
    most = 2 * math.pi * (t / turn + 1)
    phi = brentq(lambda phi: 2 * ellipkinc(phi / 2, -4 * a) - t, 0, most, xtol=1e-14)
    return np.array([math.sin(phi), math.cos(phi)])


def mechanism(n, rate):
    scene = open_scene.load("n-four-bar", [f"linkage.n={n}"])
    return virtual_mechanism(scene.linkage, scene.mechanism, step_s=1 / rate)


def tip_after(component, rate, duration=10):
    block = advance(Running(component), duration, rate)
    return block.outputs("x")["x"][:2]


def test_closed_form_at_published_times():
    assert exact_tip(2, 1.0) == pytest.approx([-0.19502030194943509, -0.98079920566217383])
    assert exact_tip(2, 10.0) == pytest.approx([0.32845811154081538, 0.94451853817860096])


def test_two_windows_at_512_hz():
    block = Running(mechanism(2, 512))
    energies = [block.outputs("energy")["energy"]]
    for _ in range(5120):
        block.step(1 / 512)
        energies.append(block.outputs("energy")["energy"])
    assert np.abs(block.outputs("x")["x"][:2] - exact_tip(2, 10.0)).max() < 1e-8
    assert np.abs(np.array(energies) - energies[0]).max() < 1e-8


def test_forty_windows_hold_their_branch():
    component = mechanism(40, 1024)
    assert np.abs(tip_after(component, 512) - exact_tip(40, 10.0)).max() < 1e-7


def turned(linkage, angle):
    """The linkage and gravity in a frame where its singular closures are along no axis."""
    R = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    joints = tuple(
        replace(j, at_parent=tuple(R @ (j.at_parent or (0.0, 0.0)))) if j.parent == "ground" else j
        for j in linkage.joint
    )
    grounded = {j.name for j in joints if j.parent == "ground"}
    start = {k: v + angle * (k in grounded) for k, v in linkage.start.items()}
    gravity = tuple(R @ linkage.gravity)
    return replace(linkage, joint=joints, start=start, gravity=gravity), R


def test_steps_and_stages_that_land_on_a_singular_pose():
    """At these rates one comes within 1e-4 to 1e-7 rad: what mu cuts, and what rounding makes."""
    scene = open_scene.load("n-four-bar", ["linkage.n=2"])
    linkage, R = turned(scene.linkage, 0.7)
    component = virtual_mechanism(linkage, scene.mechanism, step_s=1e-3)
    for rate in (561, 596, 976, 1016, 1289, 2246):
        error = np.abs(tip_after(component, rate) - R @ exact_tip(2, 10.0)).max()
        assert error < 2e-8, f"{rate} Hz: {error:.1e} m"


def test_four_windows_as_an_fmu_from_the_command_line(tmp_path, monkeypatch):
    monkeypatch.setenv("HAPTICLINK_CACHE", str(tmp_path / "cache"))
    options = ["linkage.n=4", "duration=2", "haptics.rate=512"]
    command = ["run", "n-four-bar", *sets(options), "--no-figures", "--out", tmp_path / "out"]
    assert status(*command) == 0
    with (tmp_path / "out" / "haptics.csv").open() as file:
        *_, last = csv.DictReader(file)
    tip = [float(last[f"virtual_mechanism.x[{i}]"]) for i in (1, 2)]
    np.testing.assert_allclose(tip, exact_tip(4, float(last["time"])), rtol=0, atol=1e-9)
