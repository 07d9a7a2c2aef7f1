"""Identification from logs of this project's own device and hand, whose parameters are known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.fit.arm_fit import NAMES, fit_arm
from hapticlink.analysis.fit.device_fit import fit_device
from hapticlink.analysis.fit.estimate import Estimate, standard_deviations
from hapticlink.analysis.fit.log import Log
from hapticlink.components.specs.hand import ArmHand
from tests.analysis.fit import device_log
from tests.devices import device as device_of
from tests.shared_fixtures import status

STILL = ((0.0, 0.0, 0.0, 0.0),)
DEVICE = device_of(
    keys={
        "body.crank.mass": 0.19,
        "body.crank.inertia": 1.5e-4,
        "motor.damping": 2e-3,
        "motor.friction": 6e-3,
    }
)
ARM = ArmHand(
    mass=(1.4, 0.9, 0.003),
    stiffness=(150.0, 420.0, 0.8),
    damping=(6.0, 14.0, 0.015),
    grip_stiffness=(900.0, 1500.0, 4.0),
    grip_damping=(8.0, 15.0, 0.03),
    target=STILL,
)
NOISE = 0.05
"""Of the force sensor (N)."""


@pytest.fixture(scope="module")
def log() -> Log:
    return device_log.recorded(DEVICE, ARM, seconds=3.0, seed=3, noise=NOISE)


def truth(estimate: Estimate) -> float:
    block, _, key = estimate.key.partition(".")
    name, _, axis = key.rstrip("]").partition("[")
    value = getattr(DEVICE if block == "device" else ARM, name)
    return value[int(axis)] if axis else value


def csv(log: Log, path: Path) -> Path:
    columns = {"time": np.arange(len(log.pose)) * log.period}
    for name, values in (
        ("haptic_device.x", log.pose), ("controller.F_motor", log.motors), ("hand.F", log.hand)
    ):  # fmt: skip
        if values is not None:
            columns |= {f"{name}[{i + 1}]": values[:, i] for i in range(3)}
    rows = np.column_stack([*columns.values()])
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    return path


def test_a_device_of_which_every_start_is_wrong(log: Log) -> None:
    """Handle half or twice as heavy and no friction; encoders that count, a noisy force sensor."""
    wrong = device_of(keys={"body.crank.mass": 0.4, "body.crank.inertia": 6e-5})
    estimates, counts = fit_device(log, wrong)
    for estimate in estimates:
        assert abs(estimate.value - truth(estimate)) < max(
            5 * estimate.spread, 0.02 * truth(estimate)
        ), estimate.text
        assert estimate.spread < 0.2 * estimate.value, estimate.text
    assert 0.25 < counts < 0.33


@pytest.mark.parametrize("start", [{}, {"damping": (0.0, 0.0, 0.0)}], ids=["damped", "undamped"])
def test_an_arm_of_which_every_start_is_wrong(log: Log, start: dict[str, Any]) -> None:
    estimates, unexplained = fit_arm(log, ArmHand(target=STILL, **start))
    assert len(estimates) == 15
    for estimate in estimates:
        assert estimate.value == pytest.approx(truth(estimate), rel=0.04), estimate.text
    assert max(unexplained) < 0.02


def test_the_spread_is_that_of_repeated_logs(log: Log) -> None:
    """The standard deviations of 12 logs with a noise of their own of 0.3 N, against the scatter of
    their estimates."""
    random, values, spreads = np.random.default_rng(5), [], []
    for _ in range(12):
        noise = random.normal(0, 0.3, log.hand.shape) * [1, 1, 0.01]
        estimates, _ = fit_arm(replace(log, hand=log.hand + noise), ARM)
        values.append([np.log(e.value) for e in estimates])
        spreads.append([e.spread / e.value for e in estimates])
    scatter, spread = np.std(values, axis=0, ddof=1), np.mean(spreads, axis=0)
    assert np.median(scatter / spread) == pytest.approx(1.0, abs=0.4)
    assert np.all(scatter < 2.5 * spread)


def test_standard_deviations_of_a_line_through_noise() -> None:
    """Independent errors: those of ordinary least squares; errors that repeat: larger by the root
    of how often."""
    random = np.random.default_rng(1)
    J = np.column_stack([np.ones(4000), np.linspace(-1, 1, 4000)])
    noise = random.normal(0, 0.5, 4000)
    known = 0.5 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert standard_deviations(J, noise, 200, 2) == pytest.approx(known, rel=0.15)
    repeated = np.repeat(noise[::20], 20)
    assert standard_deviations(J, repeated, 200, 2) == pytest.approx(known * 20**0.5, rel=0.15)
    assert standard_deviations(J * [1, 0], noise, 200, 2)[1] == np.inf


def test_a_log_without_motion_in_an_axis_has_no_estimates_there(log: Log) -> None:
    still = replace(log, pose=log.pose * [1, 1, 0])
    estimates, _ = fit_arm(still, ARM)
    assert {e.key.partition("[")[2] for e in estimates} == {"0]", "1]"}


def test_the_command_writes_what_a_scene_takes(log: Log, tmp_path: Path, capsys) -> None:
    path = csv(log, tmp_path / "shaken.csv")
    out = tmp_path / "fit"
    assert status("fit", path, "--device", "body.crank.mass", "--out", out, "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["parameters"] == json.loads((out / "fit.json").read_text())["parameters"]
    scene = tmp_path / "mine.toml"
    scene.write_text('extends = "closed-loop-ideal"\n' + (out / "fitted.toml").read_text())
    read = hl.scene(scene)
    fitted = record["parameters"]["device.body.crank.mass"]["value"]
    assert read.device.body[0].mass == pytest.approx(fitted, rel=1e-12)
    assert read.hand.type == "arm"


def test_a_run_whose_hand_is_held_is_fitted_without_bias(tmp_path: Path) -> None:
    """The device to rounding, as its equations are the same; the arm to what differences of the
    pose leave of its velocity. Noise at the controller makes the motors shake."""
    arm = {name: getattr(ARM, name) for name in NAMES}
    options = {
        "duration": 2.0,
        "device.body.crank.mass": 0.2,
        "device.motor.damping": 2e-3,
        "hand": {"type": "arm", "target": [[0, 0.0445477, 0.0148492, -0.785398]], **arm},
        "at": [{"time": 0.0, "noise": {"controller.x_D": 0.02}}],
    }
    hl.run("closed-loop-ideal", options, out=tmp_path, figures=False)
    found = hl.fit(tmp_path, device=["body.crank.mass", "motor.damping"])
    value = {e.key: e.value for e in found.estimates}
    assert value["device.body.crank.mass"] == pytest.approx(0.2, rel=1e-6)
    assert value["device.motor.damping"] == pytest.approx(2e-3, rel=1e-3)
    for name in NAMES:
        fitted = [value[f"hand.{name}[{axis}]"] for axis in range(3)]
        assert fitted == pytest.approx(arm[name], rel=0.01), name
    assert "target = [[0.0, 0.0445" in found.scene()


def test_what_a_run_cannot_say_is_left_out_in_words(tmp_path: Path) -> None:
    hl.run("closed-loop-ideal", {"duration": 0.6}, out=tmp_path, figures=False)
    found = hl.fit(tmp_path, device=["body.crank.mass"])
    assert [e.key for e in found.estimates] == ["device.body.crank.mass"]
    assert found.left_out == ('hand: type = "constant" in this run, no arm to be fitted',)
    assert "[hand]" not in found.scene()


def test_an_axis_whose_force_stays_is_left_out(log: Log, tmp_path: Path) -> None:
    still = replace(log, hand=log.hand * [1, 1, 0], motors=None)
    found = hl.fit(csv(still, tmp_path / "log.csv"))
    assert {e.key.partition("[")[2] for e in found.estimates} == {"0]", "1]"}
    assert "axis 2 is left out" in found.left_out[0]


def test_an_arm_that_is_shaken_by_few_counts_is_warned_of(
    log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An eighth of the motion: rotation comes out more than half off, with small deviations."""
    log = replace(log, motors=None)
    assert [*hl.fit(csv(log, tmp_path / "log.csv")).warnings] == []
    monkeypatch.setattr(device_log, "AMPLITUDES", device_log.AMPLITUDES / 8)
    weak = device_log.recorded(DEVICE, ARM, seconds=3.0, seed=3, noise=NOISE)
    found = hl.fit(csv(replace(weak, motors=None), tmp_path / "weak.csv"))
    turned = [e for e in found.estimates if e.key.startswith("hand.") and e.key.endswith("[2]")]
    assert max(abs(e.value / truth(e) - 1) for e in turned) > 0.5
    (*_, last) = found.warnings
    assert "of axis 2 unexplained" in last
    assert last in found.lines()
    assert last in found.record()["warnings"]


def test_hdf5_and_csv_are_one_log(log: Log, tmp_path: Path) -> None:
    from hapticlink.analysis.fit.log import read_log

    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"] = np.arange(len(log.pose)) * log.period
        file["haptic_device.x"], file["hand.F"] = log.pose, log.hand
    one, other = read_log(tmp_path / "log.h5"), read_log(csv(log, tmp_path / "log.csv"))
    assert np.array_equal(one.pose, other.pose)
    assert np.array_equal(one.hand, other.hand)
    assert one.motors is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda log: replace(log, motors=None, hand=None), "neither the motors' nor the hand's"),
        (lambda log: replace(log, pose=log.pose[:40], motors=None, hand=log.hand[:40]), "257"),
        (lambda log: replace(log, pose=log.pose * 0 + 0.01, hand=None), "does not move"),
        (lambda log: replace(log, pose=np.where(log.pose > 0.02, np.nan, log.pose)), "row"),
    ],
)
def test_a_log_that_determines_nothing_is_refused(change, message, log: Log, tmp_path) -> None:
    with pytest.raises(hl.InputFault, match=message):
        hl.fit(csv(change(log), tmp_path / "log.csv"))


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        (0.0, "its time does not grow"),
        (1e3, r"samples are 1\.953 s apart, 0\.512 Hz.*it would be 512 Hz in ms\)"),
        (1e6, r"would be 512 Hz in us\)"),
        (1e9, r"would be 512 Hz in ns\)"),
        (1e-6, r"1\.953e-09 s apart, 5\.12e\+08 Hz, where 20 to 100000 Hz.*write time in s, or"),
        (1e-318, r"s apart, inf Hz"),
    ],
)
def test_times_in_another_unit_are_refused_by_it(unit: float, message, log: Log, tmp_path) -> None:
    with pytest.raises(hl.InputFault, match=message):
        hl.fit(csv(replace(log, period=unit * log.period), tmp_path / "log.csv"))


def test_times_that_are_no_numbers_are_named(log: Log, tmp_path: Path) -> None:
    """Infinite in a CSV, two in a row of an HDF5 file."""
    path = csv(log, tmp_path / "log.csv")
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *rows[:-1], "inf" + rows[-1][rows[-1].index(",") :]]))
    with pytest.raises(hl.InputFault, match=f"time is not finite in row {len(rows)}"):
        hl.fit(path)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"], file["haptic_device.x"] = np.zeros((300, 2)), np.zeros((300, 3))
    with pytest.raises(hl.InputFault, match=r"time has a shape of \(2,\) a sample, not \(\)"):
        hl.fit(tmp_path / "log.h5")


def test_a_deviation_that_a_log_does_not_tell_is_none_in_json() -> None:
    lost = Estimate("hand.mass[0]", "kg", 1.0, np.inf, 2.0)
    assert json.loads(json.dumps(lost.record(), allow_nan=False))["standard_deviation"] is None
    assert lost.text == "hand.mass[0] = 1 +- unknown kg (assumed 2)"


def test_a_gap_and_an_unknown_parameter_are_named(log: Log, tmp_path: Path) -> None:
    path = csv(log, tmp_path / "log.csv")
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:300] + lines[303:]))
    with pytest.raises(hl.InputFault, match=r"row 300 comes 0\.0078"):
        hl.fit(path)
    with pytest.raises(hl.InputFault, match=r"'crank' cannot be fitted; body\.crank\.mass"):
        hl.fit(csv(log, path), device=["crank"])


@pytest.mark.parametrize("name", ["x" * 5000, "no\0name", "/dev/zero", "missing.csv"])
def test_a_log_is_a_file(name: str) -> None:
    with pytest.raises(hl.InputFault, match="cannot be read as a log: not a regular file"):
        hl.fit(name)
