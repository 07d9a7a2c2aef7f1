"""Joints as ports, against a drive of the scene and a controller outside."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from tests.blocks import Running, advance, virtual_mechanism
from tests.little_fmus import slave

ACTIVE = """
extends = "slider-crank"
title = "A motor outside"
duration = 1.0
haptics.rate = 512
fmu = [{ name = "motor", path = "PATH", timing = "sampled" }]
connection = [
  { from = "virtual_mechanism.crank.position", to = "motor.angle" },
  { from = "virtual_mechanism.crank.velocity", to = "motor.rate" },
  { from = "motor.torque", to = "virtual_mechanism.crank.effort" },
]
"""
PORTS = {
    "linkage.joint.0.ports": ["effort", "position", "velocity"],
    "linkage.joint.0.drive": {"type": "profile", "table": [[0.0, 0.0]]},
}


def test_a_constant_effort_from_outside_is_that_of_a_drive() -> None:
    """To the bit, friction at the start included."""
    scene = open_scene.load("slider-crank")
    assert scene.linkage
    driven, *others = scene.linkage.joint
    open_joint = replace(driven, drive=None, ports=("effort", "position", "velocity"))
    ported = replace(scene.linkage, joint=(open_joint, *others))
    inside = Running(virtual_mechanism(scene.linkage, scene.mechanism, step_s=1 / 512))
    outside = Running(
        virtual_mechanism(ported, scene.mechanism, step_s=1 / 512), {"crank.effort": 0.08}
    )
    drive, y = (advance(block, 0.5, 512).y for block in (inside, outside))
    assert y["q"][0] > 2
    assert np.array_equal(y["q"], drive["q"])
    assert (y["crank.position"], y["crank.velocity"]) == (y["q"][0], y["qd"][0])


def test_a_controller_outside_turns_a_joint_and_its_work_is_booked(tmp_path: Path) -> None:
    """The work of the held torque, by its own sum over the recorded steps."""
    servo = "self.torque = 20.0 * (1.3 - self.angle) - 0.4 * self.rate"
    ports = ("input", {"angle": 0.0, "rate": 0.0}), ("output", {"torque": 0.0})
    fmu = slave(tmp_path, "Servo", *ports, body=servo)
    path = tmp_path / "active.toml"
    path.write_text(ACTIVE.replace("PATH", fmu.as_posix()))
    run = hl.run(path, PORTS)
    angle, torque = run["virtual_mechanism.crank.position"], run["motor.torque"]
    assert angle[-1] == pytest.approx(1.3, abs=0.02)
    booked = run.run["energies_within_a_rate"]["motor.torque -> virtual_mechanism.crank.effort"]
    steps = np.diff(angle)
    assert booked["held"] == pytest.approx(torque[: len(steps)] @ steps, rel=0.02)
