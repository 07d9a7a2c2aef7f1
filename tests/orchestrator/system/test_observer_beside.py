"""The observer beside the device: the numbers of the one within it, in runs and in what is found of
them, and devices of others that it observes."""

import re
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.forces import torques
from hapticlink.analysis.findings.tracking import FIRST
from hapticlink.analysis.transparency import mobility_at_hand as transparency
from hapticlink.components.device.models import device_model
from hapticlink.orchestrator.results.recorded_scene import all_devices
from hapticlink.orchestrator.system.build_system import build_system
from tests.devices import device as twin
from tests.little_fmus import entries, slave
from tests.shared_fixtures import run_once

BESIDE: dict[str, Any] = {"device.observer.beside": True}
MEASURED = re.compile(r"^haptic_device(\w*)\.(x|v|M|c|F_hand_observed)$")


def has(run: hl.Run, signal: str) -> bool:
    return any(signal in table for table in run.tables.values())


def differing(within: hl.Run, beside: hl.Run) -> list[str]:
    """The signals of a run that are not the same bits in the other."""
    columns = {c.partition("[")[0] for table in within.tables.values() for c in table.columns}
    signals = sorted(columns - {"time"})
    names = {s: s if has(beside, s) else MEASURED.sub(r"observer\1.\2", s) for s in signals}
    return [s for s, name in names.items() if within[s].tobytes() != beside[name].tobytes()]


@pytest.mark.parametrize("packaging", ["python", "native"])
def test_three_seconds_of_the_closed_loop_have_the_same_bits(packaging: str) -> None:
    within = hl.run("closed-loop", {"packaging": packaging}, figures=False)
    beside = hl.run("closed-loop", {"packaging": packaging, **BESIDE}, figures=False)
    assert len(within["haptic_device.x"]) == len(beside["observer.x"]) == 1537
    assert differing(within, beside) == []


@pytest.mark.parametrize("observed", [("device", "devices.left"), ("devices.left",)])
def test_each_user_has_an_observer_of_its_own(observed: tuple[str, ...]) -> None:
    options = {"sensing": "encoders", "duration": 0.3}
    within = run_once("two-users", options)
    beside = run_once("two-users", options | {f"{d}.observer.beside": True for d in observed})
    assert has(beside, "observer.x") == ("device" in observed)
    assert differing(within, beside) == []


def test_no_sample_is_late_and_each_block_comes_before_those_that_it_feeds() -> None:
    with build_system(hl.scene("closed-loop", BESIDE)) as system:
        order = [fmu.name for fmu in system.fmus if fmu.sampled]
    assert order == ["hand", "observer", "controller", "motor_map"]
    record = run_once("closed-loop", {"duration": 0.3, **BESIDE}).record
    late = {n: age.max for n, age in record.delays.items() if "virtual_environment" not in n}
    assert set(late.values()) == {0.0}
    assert {"haptic_device.q -> observer.q", "motor_map.tau -> haptic_device.tau"} <= {*late}


def test_what_is_found_of_a_run_is_the_same() -> None:
    """The energies that count motors are those of torques over angles there: the posture changes
    within a step by a few parts in ten thousand of them."""
    within, beside = (run_once("closed-loop", {"duration": 1.0, **o}) for o in ({}, BESIDE))
    device = all_devices(within)[""]
    for a, b in zip(*(torques(r, device, FIRST) or () for r in (within, beside)), strict=True):
        np.testing.assert_array_equal(a, b)
    one, other = within.record.user_port, beside.record.user_port
    assert one
    assert other
    for name in ("generated", "peak", "hand_work"):
        assert getattr(one, name) == getattr(other, name)
    assert one.works["F_T"] == other.works["F_T"]
    assert one.works["motors"] == pytest.approx(other.works["motors"], rel=1e-3)
    torque, angle = beside["motor_map.tau"], beside["haptic_device.theta_true"]
    work = (torque[:-1] * np.diff(angle, axis=0)).sum()
    assert other.works["motors"] == pytest.approx(work, rel=1e-9)
    assert sum(b.generated for b in other.blocks.values()) == pytest.approx(other.generated)
    assert within.record.warnings == beside.record.warnings
    assert within.record.unstable == beside.record.unstable


def test_the_handle_feels_the_same() -> None:
    def felt(options: dict[str, Any]) -> transparency.Transparency:
        return transparency.transparency("closed-loop", write(options), count=1)[0]

    within, beside = felt({}), felt(BESIDE)
    for a, b in zip(within.free, beside.free, strict=True):
        np.testing.assert_allclose(a.felt, b.felt, rtol=1e-6)
    for a, b in zip(within.constrained, beside.constrained, strict=True):
        np.testing.assert_allclose(a.stiffness, b.stiffness, rtol=1e-6)


def write(options: dict[str, Any]) -> list[str]:
    return [f"{key}={str(value).lower()}" for key, value in options.items()]


def test_a_fit_takes_the_pose_of_the_observer(tmp_path: Path) -> None:
    found = []
    for name, options in (("within", {}), ("beside", BESIDE)):
        hl.run("closed-loop", {"duration": 0.6, **options}, out=tmp_path / name, figures=False)
        found.append(hl.fit(tmp_path / name, device=["body.crank.mass"]).estimates)
    assert found[0] == found[1]


def test_with_ideal_sensing_nothing_is_observed() -> None:
    run = run_once("closed-loop-ideal", {"duration": 0.05})
    assert not [c for t in run.tables.values() for c in t.columns if "observed" in c]
    with pytest.raises(hl.InputFault, match=r"device\.observer\.beside: true, and with sensing"):
        hl.scene("closed-loop", {"sensing": "ideal", **BESIDE})
    with pytest.raises(hl.InputFault, match=r"devices\.left\.observer\.beside: true, and"):
        hl.scene("two-users", {"devices.left.observer.beside": True})


POSE, TORQUES = (-0.02, 0.01, 0.3), (0.03, -0.02, 0.01, 0.04)


@pytest.mark.parametrize("replaces", [True, False])
def test_a_device_from_elsewhere_is_observed(replaces: bool, tmp_path: Path) -> None:
    """One that is held still against its motors: the hand's wrench is -J_q' tau."""
    pose, model = ca.SX.sym("pose", 3), device_model(twin())
    shown = [model.angles(pose, model.numbers), model.jacobian(pose, model.numbers)]
    angles, J = (np.array(value) for value in ca.Function("shown", [pose], shown)(POSE))
    outputs = entries("angles", 4) | entries("torques", 4)
    outputs |= {f"angles[{i + 1}]": float(q) for i, q in enumerate(angles.ravel())}
    outputs |= {f"torques[{i + 1}]": tau for i, tau in enumerate(TORQUES)}
    board = slave(tmp_path, "Board", ("input", entries("command", 4)), ("output", outputs))
    place = ", ".join(f'"x_start[{i + 1}]" = {x}' for i, x in enumerate(POSE))
    text = """
        title = "A board"
        duration = 1.0
        haptics.rate = 512
    """
    if replaces:
        text += f"""
            sensing = "encoders"
            [device]
            observer.beside = true
            [[fmu]]
            path = "{board}"
            replaces = "haptic_device"
            map = {{ q = "angles", tau_applied = "torques", tau = "command" }}
        """
    else:
        text += f"""
            [[fmu]]
            name = "board"
            path = "{board}"
            [[fmu]]
            name = "observer"
            block = "observer"
            settings = {{ device = {{}} }}
            start = {{ {place} }}
            [[connection]]
            from = "board.angles"
            to = "observer.q"
            [[connection]]
            from = "board.torques"
            to = "observer.tau"
        """
    scene = tmp_path / "board.toml"
    scene.write_text(re.sub(r"(?m)^ +", "", text))
    run = hl.run(scene, figures=False)
    np.testing.assert_allclose(run["observer.x"][-1], POSE, rtol=1e-9)
    hand = -J.T @ TORQUES
    error = run["observer.F_hand_observed"][-1] - hand
    assert np.abs(error).max() < 5e-3 * np.abs(hand).max()
