"""Blocks by MuJoCo against our equations: two codes that share the scene alone."""

import json
import math

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.fmus.blocks import build_block, component
from hapticlink.fmus.check import check_fmu
from hapticlink.fmus.engine import mujoco_fmu
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.blocks import blocks
from tests.shared_fixtures import run_once

mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install hapticlink[engine]")
from hapticlink.fmus.engine import mujoco_functions  # noqa: E402 - it imports mujoco


def by(block: str) -> str:
    return f'fmu.+={{replaces="{block}", engine="mujoco"}}'


def both(scene, block, folder, *options):
    """Our component of a block, the same by MuJoCo, and the plan of the block."""
    loaded = open_scene.load(scene, options)
    plan = next(b for b in blocks(loaded).loop if b.name == block)
    ours = component(plan.block, plan.settings)
    files = mujoco_fmu.entries(ours, plan.settings, stop_time=1.0, step_size=1 / 512)
    for name in ("model.xml", "engine.json"):
        (folder / name).write_bytes(files[f"resources/{name}"])
    return ours, mujoco_functions.Engine(str(folder)), json.loads(files["resources/engine.json"])


def named(variables, flat):
    found, start = {}, 0
    for v in variables:
        found[v.name] = np.array(flat[start : start + v.size])
        start += v.size
    return found


@pytest.mark.parametrize(
    "scene", ["five-bar", "geared-five-bar", "two-users", "parallelogram", "watt-six-bar"]
)
def test_mobility_directions_and_bias_at_random_poses(scene, tmp_path):
    ours, theirs, about = both(scene, "virtual_mechanism", tmp_path, "mechanism.directions=true")
    random, compared = np.random.default_rng(3), 0
    p = np.array(ours.start_parameters)
    given = named(ours.parameters, p)
    n = sum(v.size for v in ours.parameters if v.name == "q_start")
    u = random.normal(size=len(ours.start_inputs)) * 0.1
    start = np.array(ours.initialize(u, p)).ravel()
    for _ in range(20):
        x = start.copy()
        x[:n] += random.normal(size=n) * 0.1
        theirs._place(x[:n], random.normal(size=n))
        for _ in range(8):
            theirs._project()
        q, qd = theirs._d.qpos[theirs._order].copy(), theirs._d.qvel[theirs._order].copy()
        if max((np.linalg.norm(theirs._gap(loop)) for loop in theirs._loops), default=0) > 1e-14:
            continue  # no assembly near that pose
        x[:n], x[n : 2 * n] = q, qd
        y = named(ours.outputs, np.array(ours.output(x, u, p, 0.0)).ravel())
        flat = np.concatenate([given[name] for name in about["parameters"]])
        out = np.zeros(sum(about["outputs"].values()))
        theirs.output(x, u, flat, [0.0], memoryview(out), [])
        z, at = {}, 0
        for name, size in about["outputs"].items():
            z[name] = out[at : at + size]
            at += size
        for name, value in z.items():
            port = name.split(".")[-1]
            if port in ("qdd", "closure_error", "F_env"):
                continue  # its closures are soft
            scale = max(1.0, np.abs(y[name]).max())
            np.testing.assert_allclose(value, y[name], atol=1e-8 * scale, err_msg=name)
        compared += 1
    assert compared >= 6


def difference(one, two, name):
    a, b = (r.haptics[name] for r in (one, two))
    assert len(a) == len(b)
    return np.abs(a - b).max()


def test_a_placed_copy_gives_the_same_loop():
    ours = run_once("closed-loop-ideal", ["duration=0.5"])
    theirs = hl.run("closed-loop-ideal", ["duration=0.5", by("virtual_environment")])
    assert not any(theirs.run["replaced"]["virtual_environment"].values())
    for name in ("virtual_mechanism.x[1]", "haptic_device.x[3]", "controller.F_motor[2]"):
        assert difference(ours, theirs, name) < 1e-11


def test_a_pulled_copy_follows_as_ours_does():
    """Both take the pull with x and v at the end of a substep."""
    options = ["duration=0.5", "graphics.sync=operational"]
    ours = hl.run("closed-loop-ideal", options)
    placed = run_once("closed-loop-ideal", ["duration=0.5"])
    theirs = hl.run("closed-loop-ideal", [*options, by("virtual_environment")])
    name = "haptic_device.x[1]"
    assert 0 < difference(ours, theirs, name) < 1e-4
    assert difference(ours, theirs, name) < 0.2 * difference(ours, placed, name)


def test_a_mechanism_moves_as_ours_does():
    ours = run_once("closed-loop-ideal", ["duration=0.5"])
    theirs = hl.run("closed-loop-ideal", ["duration=0.5", by("virtual_mechanism")])
    assert any("has no energy: there is no energy at" in line for line in theirs.run["warnings"])
    for i in (1, 2):
        assert 0 < difference(ours, theirs, f"virtual_mechanism.x[{i}]") < 1e-5


BOUNCE = """
title = "a disc at a wall"
duration = 0.3
haptics.rate = 4096
[linkage]
operational_point.body = "disc"
start_velocity.disc = [1.0, 0.0, 0.0]
[[linkage.body]]
name = "disc"
mass = 0.2
radius = 0.01
[[linkage.joint]]
name = "disc"
type = "free"
child = "disc"
[contacts]
enclosure = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]
stiffness = 3000.0
damping = 10.0
detection = "haptics"
"""


def test_a_disc_bounces_as_its_spring_and_damper_say(tmp_path):
    """Rebound of m x'' + b x' + k x = 0 that lets go where its force is 0."""
    path = tmp_path / "bounce.toml"
    path.write_text(BOUNCE)
    found = hl.run(path, [by("virtual_mechanism")]).haptics
    m, k, b = 0.2, 3000.0, 10.0
    delta = b / 2 / m
    omega = math.sqrt(k / m - delta**2)
    rebound = math.exp(-delta / omega * 2 * math.atan2(omega, delta))
    assert found["virtual_mechanism.v[1]"][0] == 1.0
    assert found["virtual_mechanism.v[1]"][-1] == pytest.approx(-rebound, abs=0.02)
    x, gap = found["virtual_mechanism.x[1]"], found["virtual_mechanism.contact_gap"]
    assert gap[x > 0.0901] == pytest.approx(0.09 - x[x > 0.0901], abs=1e-9)
    assert gap.min() < -0.005


def test_the_fmu_keeps_the_contract_of_our_fmus(tmp_path):
    loaded = open_scene.load("closed-loop-ideal")
    plan = next(b for b in blocks(loaded).loop if b.name == "virtual_environment")
    path = build_block(plan.block, plan.settings, tmp_path, engine="mujoco")
    assert check_fmu(path) == []


@pytest.mark.parametrize(
    ("scene", "block", "options", "why"),
    [
        ("quick-return", "virtual_mechanism", [], "leave the block to hapticlink"),
        ("enclosure", "virtual_mechanism", [], 'contacts.detection = "haptics"'),
        ("closed-loop-ideal", "virtual_environment", ["graphics.sync=joint"], "sync"),
        ("closed-loop-ideal", "virtual_mechanism", ["mechanism.integrator=heun"], "not MuJoCo's"),
    ],
)
def test_what_it_does_not_hold_is_refused_with_the_remedy(scene, block, options, why):
    with pytest.raises(InputFault, match=why):
        hl.run(scene, [*options, by(block)])


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(mujoco_fmu, "find_spec", lambda name: None)
    monkeypatch.setenv("HAPTICLINK_CACHE", "off")
    with pytest.raises(InputFault, match=r"hapticlink\[engine\]"):
        hl.run("closed-loop-ideal", [by("virtual_environment")])


def test_a_motion_that_diverges_ends_the_run_with_its_cause():
    huge = 'hand={type="constant", wrench=[1e14, 0.0, 0.0]}'
    found = hl.run("five-bar", [huge, by("virtual_mechanism")])
    assert "MuJoCo finds a huge or undefined" in found.run["fault"]["message"]
